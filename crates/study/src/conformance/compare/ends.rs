//! The results of whole runs.

use super::{
    device::{Left, on_gpu},
    row::{ConformanceRow, Sides},
    scales::Scales,
    setup::method,
    twin::{twin, without_ties},
};
use crate::conformance::{
    bounds::{Bound, DECAY, FIELDS, PACE, REPORT, growth},
    cases::{Driven, MEMBERS, adaptive_members, adaptive_tolerance, members},
};
use curvelax_base::error::{Error, Result};
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::{
    number::Real,
    scheme::{
        Curve, dense, extrapolation,
        member::{Counters, Decay, NEVER, Progress, Report},
        run::Run,
        step::Method,
    },
    solver::Solver,
};
use curvelax_gpu as gpu;
use curvelax_gpu::kernel::Budget;

/// Fixed steps of a member that take as long as its adaptive run in the comparison.
pub const ADAPTIVE_STEPS: u32 = 40;

/// Compares members driven so after so many fixed steps, or adaptive ones to the same time, in dispatches of `budget`.
/// Those on the GPU are changed by `tamper`; if that does anything, the comparison must fail.
///
/// Rounding changes the length of an adaptive step by its change of the error estimate, relative to the tolerance; a
/// changed length changes the curve by the tolerance times that. So rounding changes the curve no more than with fixed
/// steps of the longest length taken, five of them per step, and the bounds are the same. Bounds of quantities inside
/// the run are in [`PACE`].
pub fn runs<T: Evolves>(
    driven: Driven,
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    steps: Option<u32>,
    budget: Budget,
    tamper: impl FnOnce(&mut [Run<f64>]),
) -> Result<Vec<ConformanceRow>> {
    let launches = launches::<T>(driven, solver, n, steps)?;
    let mut tampered = launches.clone();
    tamper(&mut tampered);
    let ours = on_gpu::<T>(adapter, solver, n, &tampered, budget)?;
    compare_ends::<T>(adapter.is_hardware(), &method(solver), n, &launches, &ours)
}

/// Members driven so, of so many fixed steps, or of adaptive ones to the time of [`ADAPTIVE_STEPS`].
pub(super) fn launches<T: Evolves>(
    driven: Driven,
    solver: Solver,
    n: usize,
    steps: Option<u32>,
) -> Result<Vec<Run<f64>>> {
    let mut launches = match steps {
        Some(steps) => members(n, MEMBERS, steps)?,
        None => adaptive_members(n, MEMBERS, ADAPTIVE_STEPS, adaptive_tolerance::<T>(), T::PRECISION)?,
    };
    driven.change(&mut launches);
    match steps {
        Some(_) => Ok(launches),
        None => launches.into_iter().map(|launch| without_ties::<T>(launch, &method(solver), n)).collect(),
    }
}

/// Compares a device's results of `launches` with those of the twin by `method`, within the bounds for hardware or
/// software.
pub(in crate::conformance) fn compare_ends<T: Evolves>(
    hardware: bool,
    method: &Method,
    n: usize,
    launches: &[Run<f64>],
    ours: &[Left],
) -> Result<Vec<ConformanceRow>> {
    let steps = ours.iter().map(|left| left.counters.steps).max().unwrap_or(0);
    let adaptive = launches.iter().all(|launch| launch.parameters.adaptive > 0.0);
    let quantities: Vec<Bound> = FIELDS.iter().chain(&REPORT).copied().collect();
    let inside: &[Bound] = if adaptive { &PACE } else { &[] };
    let begin = |bound| ConformanceRow { adaptive, ..ConformanceRow::begin::<T>(bound, method.solver, n, steps) };
    let mut rows: Vec<ConformanceRow> = quantities.iter().chain(&DECAY).chain(inside).map(begin).collect();
    for (member, (launch, left)) in launches.iter().zip(ours).enumerate() {
        let twin = twin::<T>(launch, method, n)?;
        let sides = Sides { member, on_gpu: left, on_cpu: &twin.left };
        same_events(left, &twin.left, adaptive).map_err(|differ| {
            let place = format!("{} n = {n}, member {member}", T::NAME);
            Error::Failed(format!("{place}: {differ}"))
        })?;
        let mut at = launch.clone();
        at.parameters.tau = at.parameters.tau.max(twin.longest);
        let scales = Scales::of(&at)?;
        let roundings = roundings::<T>(twin.left.counters.steps, twin.order, adaptive);
        let limit = |bound: &Bound, scale: f64| bound.factor(hardware) * T::EPSILON * scale * roundings;
        let (of_curve, rest) = rows.split_at_mut(quantities.len());
        let (of_decay, inside) = rest.split_at_mut(DECAY.len());
        curves_agree(of_curve, &quantities, &scales, limit, &sides);
        // The effect of a changed step length inside the run; none with fixed steps.
        let estimate = T::EPSILON * roundings * scales.stiffness() / launch.parameters.adaptive;
        let change = if adaptive { estimate * twin.steepest } else { 0.0 };
        let factors = DECAY.map(|bound| bound.factor(hardware));
        let rounding = T::EPSILON * roundings + change;
        decays_agree(of_decay, launch, factors, rounding, &sides);
        if adaptive {
            let roundings = [T::EPSILON * roundings, estimate];
            let mut factors = PACE.map(|bound| bound.factor(hardware));
            factors[3] *= twin.leveraged / twin.longest;
            factors[4] *= twin.leverage;
            insides_agree(inside, &scales, factors, roundings, &sides);
        }
    }
    Ok(rows)
}

/// By how much rounding grows in so many steps.
pub(super) fn roundings<T: Real>(steps: u32, order: u32, adaptive: bool) -> f64 {
    growth(steps) * if adaptive { extrapolation::roundings::<T>(order) } else { 1.0 }
}

/// Checks that both sides ended alike, after equally many steps and with their events in the same ones; else returns
/// the difference. An event where two adaptive steps meet may be in either: the [times](PACE) of events are compared,
/// too, if there are both.
fn same_events(ours: &Left, theirs: &Left, adaptive: bool) -> Result<(), String> {
    let (a, b) = (&ours.counters, &theirs.counters);
    let timed = adaptive && ![a, b].into_iter().any(|c| c.half_step == NEVER || c.relax_step == NEVER);
    let step = |own: u32, other: u32| if timed && own.abs_diff(other) == 1 { own.min(other) } else { own };
    let end = |Left { counters, report, .. }: &Left, other: &Counters| {
        let half_step = step(counters.half_step, other.half_step);
        let relax_step = step(counters.relax_step, other.relax_step);
        let Counters { status, steps, rejected, fit_points, noted, .. } = *counters;
        let Progress { time_high, time_low, .. } = report.progress;
        format!(
            "status {status} after {steps} steps and {rejected} refused at t = {time_high:e} + {time_low:e}, events in \
             steps {half_step} and {relax_step}, {fit_points} points and {noted} times noted"
        )
    };
    let (on_gpu, on_cpu) = (end(ours, b), end(theirs, a));
    match on_gpu == on_cpu {
        true => Ok(()),
        false => Err(format!("{on_gpu} on the GPU, {on_cpu} on the CPU")),
    }
}

/// Compares the last curve and its report, see [`FIELDS`] and [`REPORT`]; `limit` is the bound at a scale.
fn curves_agree(
    rows: &mut [ConformanceRow],
    quantities: &[Bound],
    scales: &Scales,
    limit: impl Fn(&Bound, f64) -> f64,
    sides: &Sides,
) {
    for (i, (row, bound)) in rows.iter_mut().zip(quantities).enumerate() {
        let scale = scales.get(bound.scale);
        sides.compare(row, scale, limit(bound, scale), |left| match left.state.curve.fields().get(i) {
            Some(field) => field.nodes().to_vec(),
            None => vec![reported(&left.report)[i - FIELDS.len()]],
        });
    }
}

/// Compares the recorded decay of a member, see [`DECAY`]; `rounding` is that of an excess.
fn decays_agree(rows: &mut [ConformanceRow], launch: &Run<f64>, factors: [f64; 2], rounding: f64, sides: &Sides) {
    let [way, rate] = rows else { panic!("{} rows of DECAY", rows.len()) };
    sides.compare(way, 1.0, factors[0] * rounding, |left| left.report.excess_at.to_vec());
    let slope = |decay: &Decay<f64>| if decay.xx > 0.0 { decay.xy / decay.xx } else { 0.0 };
    let theirs = &sides.on_cpu.report;
    let (least, span) = (theirs.now.excess.max(launch.parameters.fit_to), theirs.decay.x);
    let scale = if span > 0.0 { 1.0 / (least * span) } else { 0.0 };
    sides.compare(rate, scale, factors[1] * rounding * scale, |left| vec![slope(&left.report.decay)]);
}

/// Compares what a member's run leaves in addition to its end, see [`PACE`]. `rounding` is the effect of rounding
/// relative to a scale, `estimate` its relative effect on a step length.
fn insides_agree(
    rows: &mut [ConformanceRow],
    scales: &Scales,
    factors: [f64; 6],
    [rounding, estimate]: [f64; 2],
    sides: &Sides,
) {
    let [start, middle, reports, last, next, events] = rows else { panic!("{} rows of PACE", rows.len()) };
    let Left { state, counters, report } = sides.on_cpu;
    // The bound of a quantity that changes by `change` in a step.
    let inside = |scale: f64, change: f64| rounding * scale + estimate * change;
    let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let start_of: fn(&Left) -> Curve<f64> = |left| left.state.before.clone();
    let middle_of: fn(&Left) -> Curve<f64> = |left| dense::inside(&left.state, &left.report.progress, 0.5);
    for (row, factor, curve_of) in [(start, factors[0], start_of), (middle, factors[1], middle_of)] {
        let own = curve_of(sides.on_cpu);
        for (i, bound) in FIELDS.iter().enumerate() {
            let (nodes, scale) = (|curve: &Curve<f64>| curve.fields()[i].nodes().to_vec(), scales.get(bound.scale));
            let bound = factor * inside(scale, largest(&nodes(&state.curve), &nodes(&own)));
            sides.compare(row, scale, bound, |left| nodes(&curve_of(left)));
        }
    }
    let (before, end) = (report.before.to_numbers(), report.now.to_numbers());
    for (j, bound) in REPORT.iter().take(end.len()).enumerate() {
        let scale = scales.get(bound.scale);
        let bound = factors[2] * inside(scale, (before[j] - end[j]).abs());
        sides.compare(reports, scale, bound, |left| vec![left.report.before.to_numbers()[j]]);
    }
    let own = &report.progress;
    // The last step reaches the final time, so its length has the total error of those before it.
    let longest = scales.parameters.tau;
    sides.compare(last, longest, factors[3] * estimate * longest, |left| vec![left.report.progress.taken]);
    sides.compare(next, own.next, factors[4] * estimate * own.next, |left| vec![left.report.progress.next]);
    if counters.half_step != NEVER && counters.relax_step != NEVER {
        let half = |p: &Progress<f64>| p.half_high + (p.half_low + p.half_fraction * p.half_length);
        let relaxed = |p: &Progress<f64>| p.relax_high + (p.relax_low + p.relax_fraction * p.relax_length);
        // The rounding of an excess over its rate of decay, and the effect of the place inside its step.
        let p = &scales.parameters;
        let rate = (p.half_at - p.relax_at) / (relaxed(own) - half(own));
        let bound = factors[5] * (rounding / rate + estimate * own.half_length.max(own.relax_length));
        let both = |left: &Left| vec![half(&left.report.progress), relaxed(&left.report.progress)];
        sides.compare(events, own.relax_length, bound, both);
    }
}

/// The compared values of a report, in the order of [`REPORT`].
fn reported(report: &Report<f64>) -> Vec<f64> {
    let mut numbers = report.now.to_numbers();
    numbers.extend([report.progress.turning, report.progress.travel]);
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_flow::scheme::State;
    use glam::DVec2;

    #[test]
    fn steps_of_events_differ_by_one_only_where_their_times_are_compared() {
        let left = |half_step, relax_step| Left {
            state: State::from_nodes(&(0..6).map(|i| DVec2::from_angle(f64::from(i))).collect::<Vec<_>>()),
            counters: Counters { half_step, relax_step, ..Counters::default() },
            report: Default::default(),
        };
        let agree = |ours: [u32; 2], theirs: [u32; 2], adaptive| {
            same_events(&left(ours[0], ours[1]), &left(theirs[0], theirs[1]), adaptive).is_ok()
        };
        assert!(agree([4, 9], [4, 9], false) && agree([4, 9], [4, 8], true));
        assert!(!agree([4, 9], [4, 8], false), "fixed steps");
        assert!(!agree([4, 9], [4, 7], true), "two steps apart");
        assert!(!agree([4, NEVER], [3, NEVER], true), "no time is compared where one event is missing");
        assert!(!agree([4, 9], [4, NEVER], true), "one side has no event");
    }
}
