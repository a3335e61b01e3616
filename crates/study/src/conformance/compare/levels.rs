//! Where members pause because an observable reaches a level, and the times of the events that follow.

use super::{
    device::{Left, on_gpu},
    ends::{launches, roundings},
    row::{ConformanceRow, Sides},
    scales::Scales,
    setup::method,
    twin::{Twin, twin},
};
use crate::conformance::{
    bounds::{Bound, EVENT, REPORT},
    cases::Driven,
};
use curvelax_base::error::Result;
use curvelax_flow::scheme::evolve::Evolves;
use curvelax_flow::{
    number::BIG,
    scheme::{member::Observed, run::Run, step::Method},
    solver::Solver,
};
use curvelax_gpu as gpu;
use curvelax_gpu::kernel::Budget;

/// Fixed steps.
const STEPS: u32 = 100;
/// Changes of an observable below this multiple of its rounding are not watched.
const CLEAR: f64 = 1e3;

/// A member that pauses where an observable has gone half of its way.
struct Watched {
    /// The member.
    launch: Run<f64>,
    /// The place of the observable, and its level; none if no observable changes enough.
    level: Option<(usize, f64)>,
}

/// Compares the times at which watched observables reach their levels, within 100 fixed steps or adaptive ones over the
/// time of [`ADAPTIVE_STEPS`](super::ADAPTIVE_STEPS), in dispatches of `budget`; `tamper` as in [`runs`](super::runs).
pub fn events<T: Evolves>(
    adapter: &gpu::Gpu,
    solver: Solver,
    n: usize,
    adaptive: bool,
    budget: Budget,
    tamper: impl FnOnce(&mut [Run<f64>]),
) -> Result<ConformanceRow> {
    let launches = launches::<T>(Driven::Paper, solver, n, (!adaptive).then_some(STEPS))?;
    let method = method(solver);
    let watched = watched::<T>(&launches, &method, n)?;
    let mut paused: Vec<Run<f64>> = watched.iter().map(|watched| watched.launch.clone()).collect();
    tamper(&mut paused);
    let ours = on_gpu::<T>(adapter, solver, n, &paused, budget)?;
    agree::<T>(adapter.is_hardware(), &method, n, &watched, &ours)
}

/// The members of `launches`, each watching another observable.
fn watched<T: Evolves>(launches: &[Run<f64>], method: &Method, n: usize) -> Result<Vec<Watched>> {
    let of = |(member, launch): (usize, &Run<f64>)| {
        let Twin { left, order, .. } = twin::<T>(launch, method, n)?;
        let scales = Scales::of(launch)?;
        let rounding = T::EPSILON * roundings::<T>(left.counters.steps, order, launch.parameters.adaptive > 0.0);
        let (start, end) = (launch.report.now.to_numbers(), left.report.now.to_numbers());
        let clear =
            |place: &usize| (end[*place] - start[*place]).abs() > CLEAR * rounding * scales.get(REPORT[*place].scale);
        let place = (0..start.len()).map(|i| (member + i) % start.len()).find(clear);
        let level = place.map(|place| (place, T::of(0.5 * (start[place] + end[place])).to_f64()));
        let mut launch = launch.clone();
        if let Some((place, level)) = level {
            let (mut low, mut high) = (vec![-BIG; start.len()], vec![BIG; start.len()]);
            let side = if end[place] < start[place] { &mut low } else { &mut high };
            side[place] = level;
            launch.parameters.watched = 1.0;
            launch.parameters.low = Observed::from_numbers(&low);
            launch.parameters.high = Observed::from_numbers(&high);
        }
        Ok(Watched { launch, level })
    };
    launches.iter().enumerate().map(of).collect()
}

/// Compares the times of the events, see [`EVENT`].
fn agree<T: Evolves>(
    hardware: bool,
    method: &Method,
    n: usize,
    watched: &[Watched],
    ours: &[Left],
) -> Result<ConformanceRow> {
    let steps = ours.iter().map(|left| left.counters.steps).max().unwrap_or(0);
    let adaptive = watched.iter().all(|watched| watched.launch.parameters.adaptive > 0.0);
    let mut row = ConformanceRow { adaptive, ..ConformanceRow::begin::<T>(&EVENT, method.solver, n, steps) };
    for (member, (Watched { launch, level }, ours)) in watched.iter().zip(ours).enumerate() {
        let Some((place, level)) = *level else { continue };
        let Twin { left: theirs, longest, order, .. } = twin::<T>(launch, method, n)?;
        let mut at = launch.clone();
        at.parameters.tau = at.parameters.tau.max(longest);
        let scales = Scales::of(&at)?;
        let roundings = T::EPSILON * roundings::<T>(theirs.counters.steps, order, adaptive);
        let crossing = |left: &Left| Crossing::of(launch, left, place, level);
        let Crossing { step, slope, .. } = crossing(&theirs);
        let bound: &Bound = &REPORT[place];
        let rounding = bound.factor(hardware) * roundings * scales.get(bound.scale);
        let estimate = if adaptive { roundings * scales.stiffness() / launch.parameters.adaptive } else { 0.0 };
        let bound = EVENT.factor(hardware) * (rounding / slope + estimate * step);
        if bound.is_finite() {
            let sides = Sides { member, on_gpu: ours, on_cpu: &theirs };
            sides.compare(&mut row, step, bound, |left| vec![crossing(left).t]);
        }
    }
    Ok(row)
}

/// Where an observable reaches a level in the last step, on a straight line.
struct Crossing {
    t: f64,
    /// Length of the step.
    step: f64,
    /// Rate of change of the observable.
    slope: f64,
}

impl Crossing {
    fn of(launch: &Run<f64>, left: &Left, place: usize, level: f64) -> Crossing {
        let [before, now] = [&left.report.before, &left.report.now].map(|at| at.to_numbers()[place]);
        let (p, progress) = (&launch.parameters, &left.report.progress);
        let (step, end) = match p.adaptive > 0.0 {
            true => (progress.taken, progress.time_high + progress.time_low),
            false => (p.tau, p.tau * f64::from(left.counters.steps)),
        };
        Crossing { t: end - step * (now - level) / (now - before), step, slope: (now - before).abs() / step }
    }
}
