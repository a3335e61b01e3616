// The entry point's work: one workgroup advances one member by up to `dispatch.steps` steps towards its goal. Twin of
// crates/flow/src/scheme/evolve.rs. A fixed step that fails is not accepted: the member ends in its last good state. An
// adaptive step is retried with a shorter length until that is too short to mean anything.
//
// A dispatch also ends when its sweeps are used up. The attempt then pauses: the increments so far are stored, and the
// next dispatch recomputes the same rows and continues sweeping. Results do not depend on where a dispatch ends, to the
// last bit.

/// What thread 0 found of an attempt, and the next one that it plans: the order of an adaptive step, the systems that
/// are solved, the sweeps made for the next one, how often direct solutions are refined, the length of the step and
/// that of the last one.
struct Plan { found: u32, order: u32, phase: u32, solve_sweeps: u32, refinements: u32, length: real, taken: real }

var<workgroup> plan: Plan;

fn take_member(index: u32) {
    member = all_due[index];
    tau = all_parameters[member].tau;
    // Not through `member`: a compiler must see that this is the same in every thread.
    let moves = all_parameters[all_due[index]].redistribution > real(0.5);
    if lane == 0u { begin_dispatch(); }
    var next = workgroupUniformLoad(&plan);
    if (next.found & IS_DUE) == 0u { return; }
    curve = CURVE;
    var course = Course(SOLVED, next.phase, next.solve_sweeps, dispatch.steps, dispatch.sweeps, 0u);
    while (next.found & IS_DUE) != 0u && course.steps > 0u && course.sweeps > 0u {
        course.refinements = next.refinements;
        let advanced = advance(next.order, course, moves);
        course = advanced.course;
        next = advanced.next;
    }
    // Outside the loop, because some drivers execute every branch.
    if !ADAPTIVE && (next.found & AT_GOAL) != 0u {
        // An output time may lie between the two curves.
        copy_curve(BEFORE, CURVE);
        keep_step();
    }
}

fn keep_step() {
    store_fields(CURVE, here(new_x), here(new_y), new_k, new_r);
}

/// Plans the first attempt, perhaps one that was paused. In thread 0, like all functions below that read or change
/// counters and report.
fn begin_dispatch() {
    let counters = &all_counters[member];
    counters.sweeps_k = 0u;
    counters.sweeps_x = 0u;
    resident = member;
    make_plan(REFUSED);
    plan.phase = counters.phase;
    plan.solve_sweeps = counters.solve_sweeps;
    // `pause` sets them again.
    counters.phase = 0u;
    counters.solve_sweeps = 0u;
}

/// Plans the next attempt after one of which `found` was found.
fn make_plan(found: u32) {
    let counters = &all_counters[member];
    plan.found = found | select(0u, IS_DUE, counters.status == RUNNING && counters.steps < counters.goal);
    if ADAPTIVE {
        plan.order = counters.order;
        plan.length = stride().length;
        if REFINED && !SWEEPS { plan.refinements = refinements(plan.length, all_reports[member].report.now.length); }
        plan.taken = all_reports[member].report.progress.taken;
    }
}

/// What became of an attempt; of an accepted one also whether it reaches the goal, and whether the member is relaxed if
/// its curvature is that of its polygon.
const REFUSED = 0u;
const ACCEPTED = 1u;
const AT_GOAL = 2u;
const MAY_RELAX = 4u;
/// Another attempt is due.
const IS_DUE = 8u;

/// What is left to do, and the next attempt.
struct Advanced { course: Course, next: Plan }

/// Attempts the planned step and handles the result.
///
/// A step and an observation are each called in one place only, but for looks inside the steps of members that pause at
/// levels: compilers inline the whole body of every call.
fn advance(order: u32, begun: Course, moves: bool) -> Advanced {
    var course = begun;
    find_member();
    forget();
    let count = select(1u, parts(order), ADAPTIVE);
    if ADAPTIVE && course.phase == 0u && course.solve_sweeps == 0u {
        begin_attempt();
        begin_row(plan.length, plan.taken);
    }
    course.ended = SOLVED;
    for (var part = course.phase / 2u; part < count && course.ended == SOLVED && course.steps > 0u; part++) {
        if ADAPTIVE { begin_part(part); }
        course = step(course, moves);
        if ADAPTIVE && course.ended == SOLVED { end_part(part); }
        course.steps -= 1u;
    }
    let solved = course.ended == SOLVED;
    if course.ended == PAUSED || (solved && course.phase < 2u * count) {
        if lane == 0u { pause(course); }
        return Advanced(course, workgroupUniformLoad(&plan));
    }
    course.phase = 0u;
    course.solve_sweeps = 0u;
    if ADAPTIVE && solved { finish_attempt(); }
    var gaps = LargestGaps();
    var looks = Looks();
    if solved {
        if ADAPTIVE && WATCHED { looks = look_inside(); }
        observe(new_x, new_y, new_k, new_r, displacement);
        if ADAPTIVE { gaps = gaps_of_attempt(); }
    }
    var errors = vec2<real>(0.0, 0.0);
    if lane == 0u {
        if ADAPTIVE && solved { errors = errors_of_attempt(gaps); }
        let found = judge_attempt(course.ended, count, plan.length, errors, looks);
        plan.found = found;
        // A fixed step whose curve need not be looked at again is concluded at once, which saves a decision.
        let is_plain = !ADAPTIVE && found != REFUSED && (found & MAY_RELAX) == 0u;
        if is_plain { conclude(plan.length, errors, vec2<real>(0.0, 0.0), 0.0); }
        if is_plain || found == REFUSED { make_plan(found); }
    }
    var next = workgroupUniformLoad(&plan);
    let judged = next.found;
    if (judged & ACCEPTED) == 0u { return Advanced(course, next); }
    if ADAPTIVE || (judged & MAY_RELAX) != 0u {
        var declines = vec2<real>(0.0, 0.0);
        if ADAPTIVE { declines = decline(); }
        var apart = real(0.0);
        if (judged & MAY_RELAX) != 0u { apart = gap(); }
        if lane == 0u {
            conclude(plan.length, errors, declines, apart);
            make_plan(judged);
        }
        next = workgroupUniformLoad(&plan);
    }
    if ADAPTIVE {
        keep_attempt();
    } else {
        after_step();
        // That at the goal waits until the one before is stored.
        if (judged & AT_GOAL) == 0u { keep_step(); }
    }
    return Advanced(course, next);
}

/// Stores where the attempt pauses, and ends the dispatch.
fn pause(course: Course) {
    all_counters[member].phase = course.phase;
    all_counters[member].solve_sweeps = course.solve_sweeps;
    plan.found = REFUSED;
}

/// Whether an attempt of `count` steps of the paper is accepted; reports the new curve if it is.
fn judge_attempt(ended: u32, count: u32, h: real, errors: vec2<real>, looks: Looks) -> u32 {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    counters.solves += count;
    if ADAPTIVE && ended == SOLVED && !(errors.x <= allowed(h, report.now.length)) {
        refuse_inaccurate(h, errors);
        return REFUSED;
    }
    let failure = failure_of_step(ended);
    if failure != RUNNING {
        if ADAPTIVE { refuse_failure(h, failure); } else { counters.status = failure; }
        return REFUSED;
    }
    report.before = report.now;
    report.now = observed();
    // The host looks at the curves before and after it.
    if WATCHED {
        let watched = p.watched > real(0.5);
        let passed = ADAPTIVE && watched && passes_level(report.before, looks, report.now);
        counters.passed = select(0u, 1u, passed);
        if passed || (watched && reaches_level(report.now)) { counters.goal = counters.steps + 1u; }
    }
    let at_goal = select(0u, AT_GOAL, counters.steps + 1u == counters.goal);
    let relaxes = counters.relax_step == NEVER && report.now.excess <= nearness() * p.relax_at;
    return ACCEPTED | at_goal | select(0u, MAY_RELAX, relaxes);
}

/// Records an accepted step of length h, of which `apart` is the gap between curvature and polygon.
fn conclude(h: real, errors: vec2<real>, declines: vec2<real>, apart: real) {
    let report = &all_reports[member].report;
    var taken = Taken(0.0, report.before.excess, report.now.excess, Fall());
    if ADAPTIVE {
        taken.h = h;
        taken.fall = fall_of(h, declines);
    }
    record_events(taken, apart);
    follow(taken);
    if ADAPTIVE {
        lengthen(stride(), errors, declines);
        aim_at_relaxation();
    }
    accepted();
}

fn failure_of_step(solved: u32) -> u32 {
    if solved == NOT_FINITE { return NONFINITE; }
    if solved != SOLVED { return STALLED; }
    if !is_finite() { return NONFINITE; }
    if is_singular(all_reports[member].report.progress.turning) { return SINGULAR; }
    return RUNNING;
}

/// Retries with a step of length `next`, or ends the member for `cause` if that is below `least` of `(L/n)⁴`.
fn refuse(next: real, least: real, cause: u32) {
    let counters = &all_counters[member];
    counters.rejected += 1u;
    counters.refused += 1u;
    all_reports[member].report.progress.next = next;
    if !(least_step(least) <= next) { counters.status = cause; }
}

/// Refuses a step of length h that failed outright.
fn refuse_failure(h: real, cause: u32) {
    // In short numbers a curve that grows creeps towards the end of its coordinates.
    let creeps = cause == SINGULAR || (IS_SHORT && cause == NONFINITE);
    let least = select(real(MIN_STEP), real(MIN_TO_SINGULAR), creeps);
    refuse(real(AFTER_FAILURE) * h, least, cause);
}

/// Refuses a step of length h whose error is too large.
fn refuse_inaccurate(h: real, errors: vec2<real>) {
    let counters = &all_counters[member];
    let most = select(real(AFTER_REFUSALS), real(AFTER_REFUSAL), counters.refused == 0u);
    let next = choose(h, counters.order, errors, most, allowed(h, all_reports[member].report.now.length));
    counters.order = next.order;
    refuse(next.length, real(MIN_STEP), SINGULAR);
}

/// Excess after a step, as a multiple of a threshold, up to which it may have reached the threshold.
fn nearness() -> real { return select(real(1.0), real(NEAR), ADAPTIVE); }

/// Records the steps in which the excess falls to half its start and to the relaxation threshold, and where inside
/// them.
fn record_events(taken: Taken, apart: real) {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    if counters.half_step == NEVER && taken_falls_to(taken, p.half_at) {
        counters.half_step = counters.steps;
        report.progress.half_high = report.progress.time_high;
        report.progress.half_low = report.progress.time_low;
        report.progress.half_length = taken.h;
        report.progress.half_fraction = taken_fraction_at(taken, p.half_at);
    }
    // A curve whose curvature is not that of its polygon does not count as relaxed.
    let near = counters.relax_step == NEVER && report.now.excess <= nearness() * p.relax_at;
    if near && taken_falls_to(taken, p.relax_at) && apart <= real(MAX_GAP) {
        counters.relax_step = counters.steps;
        report.progress.relax_high = report.progress.time_high;
        report.progress.relax_low = report.progress.time_low;
        report.progress.relax_length = taken.h;
        report.progress.relax_fraction = taken_fraction_at(taken, p.relax_at);
    }
}

/// Advances the clock by an accepted adaptive step, and chooses the length and the order of the next one.
fn lengthen(by: Stride, errors: vec2<real>, declines: vec2<real>) {
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    // A step that was shorter than its error allowed tells little of the next one.
    if !is_aimed() {
        let most_growth = select(real(1.0), real(MAX_GROWTH), counters.refused == 0u);
        let next = choose(by.length, counters.order, errors, most_growth, allowed(by.length, report.before.length));
        report.progress.next = next.length;
        counters.order = next.order;
        if IS_SHORT { report.progress.next = min(next.length, longest_step(report.now.length)); }
    }
    report.progress.slope = declines.x;
    report.progress.bend = declines.y;
    pass_time(by);
    counters.refused = 0u;
}

/// Aims the next step at the place where the excess falls to the relaxation threshold, by its slope if that is more
/// than rounding. In short numbers otherwise by its last fall.
fn aim_at_relaxation() {
    let report = &all_reports[member].report;
    let relax_at = all_parameters[member].relax_at;
    let excess = report.now.excess;
    report.progress.aim = 0.0;
    let resolved = is_by_polygon() || real(RESOLVED * EPSILON) <= abs(excess * report.progress.slope);
    let is_ahead = all_counters[member].relax_step == NEVER && !(excess <= relax_at) && !(relax_at <= real(0.0));
    if is_ahead && (resolved || IS_SHORT) {
        var slope = report.progress.slope;
        var bend = report.progress.bend;
        if !resolved {
            slope = ln_ratio(report.before.excess, excess);
            bend = 0.0;
        }
        report.progress.aim = aim(ln_ratio(excess, relax_at), slope, bend, report.progress.taken);
    }
}

/// Counts an accepted step.
fn accepted() {
    let p = &all_parameters[member];
    let report = &all_reports[member].report;
    let counters = &all_counters[member];
    report.progress.travel += others.z;
    counters.steps += 1u;
    if counters.relax_step != NEVER && counters.stop_when_relaxed != 0u { counters.status = RELAXED; }
    if p.look_at <= report.progress.travel && report.now.k_min <= real(0.0) { counters.goal = counters.steps; }
    if ADAPTIVE && is_at_goal() { counters.goal = counters.steps; }
}
