//! A member's run on the CPU, with what its bounds depend on.

use super::{device::Left, setup::blocks};
use curvelax_base::error::Result;
use curvelax_ensemble::schedule::Ticks;
use curvelax_flow::scheme::{
    evolve::{Evolves, Team},
    extrapolation::LEAST_ORDER,
    pace,
    run::Run,
    step::Method,
};

/// A member's run on the CPU.
pub(super) struct Twin {
    pub(super) left: Left,
    /// Its longest step.
    pub(super) longest: f64,
    /// The largest decrease of the excess in one step.
    pub(super) steepest: f64,
    /// The highest order of a step.
    pub(super) order: u32,
    /// How much more the length of the next step depends on the error of the one that it was chosen after than where
    /// that error is the tolerance.
    pub(super) leverage: f64,
    /// The largest product of a length and of that leverage, of the steps whose lengths add up to where the last one
    /// begins.
    pub(super) leveraged: f64,
}

/// Runs the twin of `launch` to its goal.
pub(super) fn twin<T: Evolves>(launch: &Run<f64>, method: &Method, n: usize) -> Result<Twin> {
    let mut run: Run<T> = launch.convert();
    let (mut longest, mut steepest, mut order) = (0.0_f64, 0.0_f64, LEAST_ORDER);
    let (mut work, mut leverage) = (Team::new(blocks(n)?), 1.0);
    // The product of the last step is left out.
    let (mut product, mut leveraged) = (0.0, 0.0_f64);
    while run.counters.is_running() {
        leveraged = leveraged.max(product);
        let before = run.report.now.excess.to_f64();
        let (own_order, is_aimed) = (run.counters.order, pace::is_aimed(&run.report.progress));
        order = order.max(own_order);
        Evolves::evolve(&mut run, method, &mut work, 1);
        steepest = steepest.max((run.report.now.excess.to_f64() - before).abs());
        longest = longest.max(run.report.progress.taken.to_f64());
        product = leverage * run.report.progress.taken.to_f64();
        let growth = (run.report.progress.next / run.report.progress.taken).to_f64();
        if !is_aimed && run.counters.refused == 0 {
            leverage = leverage_of(growth, own_order);
        }
    }
    let left = Left { state: run.state.convert(), counters: run.counters, report: run.report.convert() };
    Ok(Twin { left, longest, steepest, order, leverage, leveraged: leveraged.max(longest) })
}

/// How near to each other, relatively, two lengths may be whose order decides what the next step is. Rounding changes
/// lengths of steps by up to 4e-3, and how far it is from the end of a step to an aim behind it by ten times as much.
const TIE: f64 = 0.08;
/// By how much of itself an end and a first step are shortened.
const SHORTER: f64 = 1.0 / 32.0;

/// An adaptive launch in which nothing near a tie decides the length of a step: else one side might make a step more.
/// It begins with a shorter step and ends earlier, if need be.
pub(super) fn without_ties<T: Evolves>(mut launch: Run<f64>, method: &Method, n: usize) -> Result<Run<f64>> {
    let mut work = Team::new(blocks(n)?);
    loop {
        let mut run: Run<T> = launch.convert();
        let mut tied = false;
        // The first length is given.
        Evolves::evolve(&mut run, method, &mut work, 1);
        while run.counters.is_running() && !tied {
            let (p, progress) = (&run.parameters, &run.report.progress);
            let left = (p.end_high - progress.time_high) + (p.end_low - progress.time_low);
            let [of_left, aim] = [progress.next / left, progress.aim / progress.next].map(T::to_f64);
            let decisions = [(of_left, 1.0), (of_left, 0.5), (aim, 1.0), (aim, pace::NEAREST_AIM)];
            tied = decisions.into_iter().any(|(length, bound)| (length / bound - 1.0).abs() < TIE);
            Evolves::evolve(&mut run, method, &mut work, 1);
        }
        if !tied {
            return Ok(launch);
        }
        let p = &mut launch.parameters;
        let ticks = Ticks { unit: p.time_unit, tick: p.time_tick };
        p.clock_end = (p.end_high + p.end_low) * (1.0 - SHORTER);
        (p.end_high, p.end_low) = ticks.split(p.clock_end);
        (p.goal_high, p.goal_low) = (p.end_high, p.end_low);
        launch.report.progress.next *= 1.0 - SHORTER;
    }
}

/// The leverage of the error of a step of this order after which the next one is `growth` times as long: that length
/// goes with the error to the power -1/order, and does not depend on it at the largest growth.
fn leverage_of(growth: f64, order: u32) -> f64 {
    if growth >= pace::MAX_GROWTH {
        1.0
    } else {
        ((growth / pace::SAFETY).powi(order as i32) / f64::from(order)).max(1.0)
    }
}
