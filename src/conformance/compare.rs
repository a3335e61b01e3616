//! The two comparisons, and their rows.

use serde::Serialize;

use super::{
    bounds::{Bound, DECAY, FIELDS, PACE, REPORT, STAGES, Scale},
    cases::{adaptive_members, members},
};
use crate::{
    backend::{
        Backend,
        gpu::{self, Variant, kernel::Budget, shader::TRACE_FIELDS},
    },
    error::{Error, Result},
    number::Real,
    scheme::{
        Curve, Increments, Parameters, State, Workspace,
        evolve::{Team, evolve},
        member::{Counters, Decay, NEVER, Progress, Report},
        run::Run,
        step::{self, Method},
    },
    solver::{Blocks, Order, Ring, Solver},
};

pub use super::cases::MEMBERS;

/// What the kernel computed.
struct Gpu<V>(V);
/// What its twin computed. A type of its own, so that one side cannot be passed twice.
struct Cpu<V>(V);

/// Moves one node of one member on the GPU side by `by`, relative to the radius: the comparison must then fail.
#[derive(Clone, Copy, Debug)]
pub struct Tamper {
    /// The member.
    pub member: usize,
    /// The node.
    pub node: usize,
    /// How far.
    pub by: f64,
}

/// One line of the table: the worst case of a quantity over all members and nodes.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The quantity.
    pub quantity: &'static str,
    /// Solver of the systems.
    pub solver: Solver,
    /// `f32` or `f64`.
    pub precision: &'static str,
    /// Nodes per member.
    pub n: usize,
    /// Steps after which it was compared; of adaptive ones the most that a member took.
    pub steps: u32,
    /// The steps were adaptive.
    pub adaptive: bool,
    /// Natural scale where the error is worst.
    pub scale: f64,
    /// The difference that takes the largest share of its bound.
    pub error: f64,
    /// The bound there, `k · ε · scale`.
    pub bound: f64,
    /// Member and node of the largest difference.
    pub at: (usize, usize),
}

impl Row {
    /// Whether the error is within its bound; NaN is not, and neither is a row that compared nothing.
    pub fn passes(&self) -> bool {
        self.error <= self.bound && self.bound.is_finite()
    }

    /// Whether nothing was compared.
    pub(super) fn is_empty(&self) -> bool {
        self.bound == f64::INFINITY
    }

    /// The error as a share of its bound.
    pub fn share(&self) -> f64 {
        if self.error == 0.0 { 0.0 } else { self.error / self.bound }
    }

    fn begin<T: Real>(bound: &Bound, solver: Solver, n: usize, steps: u32) -> Row {
        Row {
            quantity: bound.quantity,
            solver,
            precision: T::NAME,
            n,
            steps,
            adaptive: false,
            scale: 1.0,
            error: f64::NAN,
            bound: f64::INFINITY,
            at: (0, 0),
        }
    }

    /// Takes a member into account; the larger share of the bound wins, and NaN wins always.
    fn add(&mut self, member: usize, scale: f64, bound: f64, Gpu(ours): Gpu<&[f64]>, Cpu(theirs): Cpu<&[f64]>) {
        assert!(!ours.is_empty() && ours.len() == theirs.len(), "{}: sides of different length", self.quantity);
        for (node, (a, b)) in ours.iter().zip(theirs).enumerate() {
            let error = (a - b).abs();
            let first = self.is_empty();
            let share = if error == 0.0 { 0.0 } else { error / bound };
            if first || error.is_nan() || share > self.share() {
                (self.scale, self.error, self.bound, self.at) = (scale, error, bound, (member, node));
            }
            if error.is_nan() {
                return;
            }
        }
    }
}

fn method(solver: Solver) -> Method {
    Method { solver, order: Order::Coloured, max_sweeps: MAX_SWEEPS }
}

/// Sweeps at most in these comparisons.
pub const MAX_SWEEPS: u32 = 200_000;

fn tampered(mut launches: Vec<Run<f64>>, tamper: Option<Tamper>) -> Vec<Run<f64>> {
    if let Some(Tamper { member, node, by }) = tamper {
        let curve = &mut launches[member].state.curve;
        for coordinate in [&mut curve.x, &mut curve.y] {
            coordinate[node] *= 1.0 + by;
            coordinate.close();
        }
    }
    launches
}

fn blocks(n: usize) -> Result<Blocks> {
    Blocks::new(n).ok_or_else(|| Error::Failed(format!("n = {n}: a ring has at least 6 nodes")))
}

/// A workspace that keeps the systems, whatever the solver.
fn traced_workspace<T: Real>(n: usize) -> Result<Workspace<T>> {
    Ok(Workspace { traced: true, ..Workspace::new(blocks(n)?) })
}

/// Everything that one step computes, stage by stage.
pub fn stages<T: Real>(adapter: &gpu::Gpu, solver: Solver, n: usize, tamper: Option<Tamper>) -> Result<Vec<Row>> {
    let launches = members(n, MEMBERS, 1, T::PRECISION.tolerance())?;
    let mut kernel = gpu::Kernel::<T>::new(
        adapter,
        blocks(n)?,
        MEMBERS,
        MAX_SWEEPS,
        Variant { traced: true, ..adapter.capacity().variant(blocks(n)?, solver) },
    )?;
    for (slot, launch) in tampered(launches.clone(), tamper).iter().enumerate() {
        kernel.load(slot, launch)?;
    }
    kernel.poison_trace()?;
    while (0..MEMBERS).any(|slot| kernel.counters(slot).is_running()) {
        kernel.advance()?;
    }
    let trace = kernel.trace()?;
    let mut rows: Vec<Row> = STAGES.iter().map(|bound| Row::begin::<T>(bound, solver, n, 1)).collect();
    for (member, launch) in launches.iter().enumerate() {
        let mut run: Run<T> = launch.convert();
        let mut work = traced_workspace(n)?;
        let Run { state, parameters, .. } = &mut run;
        step::step(&state.curve, &mut state.increments, parameters, &method(solver), &mut work);
        let twin = traced(&work, &run.state.increments);
        let scales = Scales::of(launch)?;
        for (field, (row, bound)) in rows.iter_mut().zip(&STAGES).enumerate() {
            let at = (member * TRACE_FIELDS + field) * n;
            let scale = scales.get(bound.scale);
            let limit = bound.factor(adapter.is_hardware()) * T::EPSILON * scale;
            row.add(member, scale, limit, Gpu(&trace[at..at + n]), Cpu(&twin[field]));
        }
    }
    Ok(rows)
}

/// The curve after `steps` steps, in dispatches of `budget`.
pub fn runs<T: Real>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    steps: u32,
    budget: Budget,
    tamper: Option<Tamper>,
) -> Result<Vec<Row>> {
    let launches = members(n, MEMBERS, steps, T::PRECISION.tolerance())?;
    ends_agree::<T>(adapter, solver, n, launches, budget, tamper)
}

/// Tolerance of adaptive steps in the comparison.
const ADAPTIVE: f64 = 1e-3;
/// Fixed steps of a member in whose time it is compared with adaptive ones.
pub const ADAPTIVE_STEPS: u32 = 40;

/// The curve after adaptive steps to the same time, in dispatches of `budget`.
///
/// What rounding changes in a step length is what it changes in the error estimate, relative to the tolerance; what a
/// changed length changes in the curve is the tolerance times that. So rounding changes the curve no more than with fixed
/// steps of the longest length taken, five of them a step, and the bounds are the same. Those of what lies inside the run
/// are in [`PACE`].
pub fn adaptive<T: Real>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    budget: Budget,
    tamper: Option<Tamper>,
) -> Result<Vec<Row>> {
    let launches = adaptive_members(n, MEMBERS, ADAPTIVE_STEPS, ADAPTIVE, T::PRECISION)?;
    ends_agree::<T>(adapter, solver, n, launches, budget, tamper)
}

/// Both sides of `launches` at their ends.
fn ends_agree<T: Real>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    launches: Vec<Run<f64>>,
    budget: Budget,
    tamper: Option<Tamper>,
) -> Result<Vec<Row>> {
    let ours = on_gpu::<T>(adapter, solver, n, &tampered(launches.clone(), tamper), budget)?;
    compare_ends::<T>(adapter.is_hardware(), &method(solver), n, &launches, &ours)
}

/// What a device left of `launches`, within the bounds of hardware or of software, against the twin by `method`.
pub(super) fn compare_ends<T: Real>(
    hardware: bool,
    method: &Method,
    n: usize,
    launches: &[Run<f64>],
    ours: &[Left],
) -> Result<Vec<Row>> {
    let solver = method.solver;
    let steps = ours.iter().map(|left| left.counters.steps).max().unwrap_or(0);
    let adaptive = launches.iter().all(|launch| launch.parameters.adaptive > 0.0);
    let quantities: Vec<Bound> = FIELDS.iter().chain(&REPORT).copied().collect();
    let inside: &[Bound] = if adaptive { &PACE } else { &[] };
    let of_curve = quantities.len();
    let begin = |bound| Row { adaptive, ..Row::begin::<T>(bound, solver, n, steps) };
    let mut rows: Vec<Row> = quantities.iter().chain(&DECAY).chain(inside).map(begin).collect();
    for (member, (launch, left)) in launches.iter().zip(ours).enumerate() {
        let Left { state, counters, report } = left;
        let mut twin: Run<T> = launch.convert();
        // Of its steps; and the most that one took off the excess.
        let (mut longest, mut steepest) = (0.0_f64, 0.0_f64);
        let mut work = Team::new(blocks(n)?);
        while twin.counters.is_running() {
            let before = twin.report.now.excess.to_f64();
            evolve(&mut twin, method, &mut work, 1);
            steepest = steepest.max((twin.report.now.excess.to_f64() - before).abs());
            longest = longest.max(twin.report.progress.taken.to_f64());
        }
        let end = |counters: &Counters, report: &Report<f64>| {
            let Counters { status, steps, rejected, half_step, relax_step, fit_points, noted, .. } = *counters;
            let Progress { time_high, time_low, .. } = report.progress;
            format!(
                "status {status} after {steps} steps and {rejected} refused at t = {time_high:e} + {time_low:e}, events \
                 in steps {half_step} and {relax_step}, {fit_points} points and {noted} times noted"
            )
        };
        let (on_gpu, on_cpu) = (end(counters, report), end(&twin.counters, &twin.report.convert()));
        if on_gpu != on_cpu {
            let place = format!("{} n = {n}, member {member}", T::NAME);
            return Err(Error::Failed(format!("{place}: {on_gpu} on the GPU, {on_cpu} on the CPU")));
        }
        let widened = twin.state.convert::<f64>();
        let (our_report, their_report) = (reported(report), reported(&twin.report.convert()));
        let ours = state.curve.fields().into_iter().map(|field| field.nodes());
        let ours: Vec<&[f64]> = ours.chain(our_report.chunks(1)).collect();
        let theirs = widened.curve.fields().into_iter().map(|field| field.nodes());
        let theirs: Vec<&[f64]> = theirs.chain(their_report.chunks(1)).collect();
        let mut at = launch.clone();
        at.parameters.tau = at.parameters.tau.max(longest);
        let scales = Scales::of(&at)?;
        // 2B - A takes the roundings of both half steps twice and those of the whole one once.
        let roundings = growth(twin.counters.steps) * if adaptive { 5.0 } else { 1.0 };
        for (field, (row, bound)) in rows.iter_mut().zip(&quantities).enumerate() {
            let scale = scales.get(bound.scale);
            let limit = bound.factor(hardware) * T::EPSILON * scale * roundings;
            row.add(member, scale, limit, Gpu(ours[field]), Cpu(theirs[field]));
        }
        // What a changed step length changes inside the run: nothing with fixed steps.
        let estimate = T::EPSILON * growth(twin.counters.steps) * scales.stiffness() / launch.parameters.adaptive;
        let change = if adaptive { estimate * steepest } else { 0.0 };
        let factors = DECAY.map(|bound| bound.factor(hardware));
        let wide = twin.report.convert::<f64>();
        let rounding = T::EPSILON * roundings + change;
        decays_agree(&mut rows[of_curve..][..2], member, launch, factors, rounding, Gpu(report), Cpu(&wide));
        if adaptive {
            let twin = Left { state: widened, counters: twin.counters, report: wide };
            let rounding = T::EPSILON * roundings;
            let factors = PACE.map(|bound| bound.factor(hardware));
            let inside = &mut rows[of_curve + DECAY.len()..];
            insides_agree(inside, member, &scales, factors, [rounding, estimate], Gpu(left), Cpu(&twin));
        }
    }
    Ok(rows)
}

fn before(state: &State<f64>) -> &Curve<f64> {
    &state.before
}

fn between(state: &State<f64>) -> &Curve<f64> {
    &state.middle
}

/// What a member keeps of its way down, see [`DECAY`]; `rounding` is that of an excess.
fn decays_agree(
    rows: &mut [Row],
    member: usize,
    launch: &Run<f64>,
    factors: [f64; 2],
    rounding: f64,
    ours: Gpu<&Report<f64>>,
    theirs: Cpu<&Report<f64>>,
) {
    let (Gpu(ours), Cpu(theirs)) = (ours, theirs);
    let [way, rate] = rows else { panic!("{} rows of DECAY", rows.len()) };
    way.add(member, 1.0, factors[0] * rounding, Gpu(&ours.excess_at), Cpu(&theirs.excess_at));
    let slope = |decay: &Decay<f64>| if decay.xx > 0.0 { decay.xy / decay.xx } else { 0.0 };
    let (least, span) = (theirs.now.excess.max(launch.parameters.fit_to), theirs.decay.x);
    let scale = if span > 0.0 { 1.0 / (least * span) } else { 0.0 };
    rate.add(member, scale, factors[1] * rounding * scale, Gpu(&[slope(&ours.decay)]), Cpu(&[slope(&theirs.decay)]));
}

/// What a member's run leaves besides its end, see [`PACE`]. `rounding` is what rounding does relative to a scale,
/// `estimate` what it does to a step length, relative to it.
fn insides_agree(
    rows: &mut [Row],
    member: usize,
    scales: &Scales,
    factors: [f64; 6],
    [rounding, estimate]: [f64; 2],
    ours: Gpu<&Left>,
    theirs: Cpu<&Left>,
) {
    let (Gpu(ours), Cpu(theirs)) = (ours, theirs);
    let [start, middle, reports, last, next, events] = rows else { panic!("{} rows of PACE", rows.len()) };
    let (a, b) = (&ours.report, &theirs.report);
    // Of a quantity that changes by `change` in a step.
    let inside = |scale: f64, change: f64| rounding * scale + estimate * change;
    let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let bounds = FIELDS.map(|bound| scales.get(bound.scale));
    let curves = [(start, factors[0], before as fn(&State<f64>) -> &Curve<f64>), (middle, factors[1], between)];
    for (row, factor, of) in curves {
        let (a, b) = (of(&ours.state).fields(), of(&theirs.state).fields());
        let fields = a.into_iter().zip(b).zip(theirs.state.curve.fields()).zip(bounds);
        for (((a, b), end), scale) in fields {
            let bound = factor * inside(scale, largest(end.nodes(), b.nodes()));
            row.add(member, scale, bound, Gpu(a.nodes()), Cpu(b.nodes()));
        }
    }
    for (a, b) in [(&a.before, &b.before), (&a.middle, &b.middle)] {
        let (a, b, end) = (a.to_numbers(), b.to_numbers(), theirs.report.now.to_numbers());
        for (j, bound) in REPORT.iter().take(a.len()).enumerate() {
            let scale = scales.get(bound.scale);
            let bound = factors[2] * inside(scale, (b[j] - end[j]).abs());
            reports.add(member, scale, bound, Gpu(&a[j..=j]), Cpu(&b[j..=j]));
        }
    }
    let (a, b) = (&a.progress, &b.progress);
    // The last step reaches the final time, so its length is off by what the ones before it were off together.
    let longest = scales.parameters.tau;
    last.add(member, longest, factors[3] * estimate * longest, Gpu(&[a.taken]), Cpu(&[b.taken]));
    next.add(member, b.next, factors[4] * estimate * b.next, Gpu(&[a.next]), Cpu(&[b.next]));
    let half = |p: &Progress<f64>| p.half_high + (p.half_low + p.half_fraction * p.half_length);
    let relaxed = |p: &Progress<f64>| p.relax_high + (p.relax_low + p.relax_fraction * p.relax_length);
    if theirs.counters.half_step != NEVER && theirs.counters.relax_step != NEVER {
        // The rounding of an excess over the rate at which it falls, and what the place of a parabola inside its step does.
        let p = &scales.parameters;
        let rate = (p.half_at - p.relax_at) / (relaxed(b) - half(b));
        let bound = factors[5] * (rounding / rate + estimate * b.half_length.max(b.relax_length));
        events.add(member, b.relax_length, bound, Gpu(&[half(a), relaxed(a)]), Cpu(&[half(b), relaxed(b)]));
    }
}

/// What of a report is compared, in the order of [`REPORT`].
fn reported(report: &Report<f64>) -> Vec<f64> {
    let mut numbers = report.now.to_numbers();
    numbers.extend([report.progress.turning, report.progress.travel]);
    numbers
}

/// How roundings add up over steps: like a random walk, since the flow itself damps what they leave.
fn growth(steps: u32) -> f64 {
    f64::from(steps).sqrt()
}

/// What a member leaves on the GPU.
#[derive(Clone, Debug)]
pub struct Left {
    /// Its last accepted state.
    pub state: State<f64>,
    /// Its counters; the sweeps are those of the last dispatch.
    pub counters: Counters,
    /// Its report.
    pub report: Report<f64>,
}

/// Runs `launches` to their goals on the GPU.
pub fn on_gpu<T: Real>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    launches: &[Run<f64>],
    budget: Budget,
) -> Result<Vec<Left>> {
    let adaptive = launches.iter().any(|launch| launch.parameters.adaptive > 0.0);
    let variant = Variant { adaptive, ..adapter.capacity().variant(blocks(n)?, solver) };
    on_gpu_by::<T>(adapter, variant, n, launches, budget)
}

/// The same by a kernel of choice.
pub fn on_gpu_by<T: Real>(
    adapter: &gpu::Gpu,
    variant: Variant,
    n: usize,
    launches: &[Run<f64>],
    budget: Budget,
) -> Result<Vec<Left>> {
    let kernel = gpu::Kernel::<T>::new(adapter, blocks(n)?, launches.len(), MAX_SWEEPS, variant)?;
    let mut kernel = kernel.with_budget(budget);
    for (slot, launch) in launches.iter().enumerate() {
        kernel.load(slot, launch)?;
    }
    while (0..launches.len()).any(|slot| kernel.counters(slot).is_running()) {
        kernel.advance()?;
    }
    let left =
        |slot| Ok(Left { state: kernel.state(slot)?, counters: kernel.counters(slot), report: kernel.report(slot) });
    (0..launches.len()).map(left).collect()
}

/// The twin's side of the trace, in the order of [`STAGES`].
fn traced<T: Real>(work: &Workspace<T>, increments: &Increments<T>) -> Vec<Vec<f64>> {
    let wide = |values: &[T]| values.iter().map(|v| v.to_f64()).collect::<Vec<f64>>();
    let ring = |ring: &Ring<T>| wide(ring.nodes());
    let rows = |rows: &[crate::solver::Row<T>]| {
        let column = |entry: fn(&crate::solver::Row<T>) -> T| rows.iter().map(|row| entry(row).to_f64()).collect();
        [column(|row| row.a), column(|row| row.b), column(|row| row.d), column(|row| row.e), column(|row| row.weight)]
    };
    let mut fields = vec![wide(&work.motion.beta), ring(&work.motion.alpha), ring(&work.new.r)];
    fields.extend(rows(&work.curvature.system.rows));
    fields.extend([wide(&work.curvature.system.rhs[0]), ring(&increments.k)]);
    fields.extend(rows(&work.position.system.rows));
    fields.extend([
        wide(&work.position.system.rhs[0]),
        wide(&work.position.system.rhs[1]),
        ring(&increments.x),
        ring(&increments.y),
        ring(&work.new.k),
    ]);
    fields
}

/// Natural scales of one member, from its first step in f64.
struct Scales {
    curve: Curve<f64>,
    parameters: Parameters<f64>,
    work: Workspace<f64>,
}

impl Scales {
    fn of(launch: &Run<f64>) -> Result<Scales> {
        let mut run = launch.clone();
        let mut work = traced_workspace(run.state.curve.len())?;
        let increments = &mut run.state.increments;
        step::step(&run.state.curve, increments, &run.parameters, &method(Solver::Direct), &mut work);
        Ok(Scales { curve: run.state.curve, parameters: run.parameters, work })
    }

    /// How much a solve passes rounding on: the root of the largest weight.
    fn stiffness(&self) -> f64 {
        (self.get(Scale::SolvedCurvature) / self.get(Scale::Curvature)).max(1.0)
    }

    fn get(&self, scale: Scale) -> f64 {
        scale.of(&self.curve, &self.parameters, &self.work)
    }
}
