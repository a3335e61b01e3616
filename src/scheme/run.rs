//! A member's run between two dispatches, and a step that it takes.

use super::{
    Parameters, State,
    member::{Counters, NEVER, Report},
    observe,
};
use crate::{number::Real, solver::Blocks};

/// One member on its way: everything that a dispatch reads and writes.
#[derive(Clone, Debug)]
pub struct Run<T> {
    /// The curve.
    pub state: State<T>,
    /// What governs it.
    pub parameters: Parameters<T>,
    /// Its counters.
    pub counters: Counters,
    /// Its report; the excess of the last accepted curve is the start of the next step's events.
    pub report: Report<T>,
}

impl<T: Real> Run<T> {
    /// A member at its start, with no step to make and no events behind it.
    pub fn new(state: State<T>, parameters: Parameters<T>) -> Run<T> {
        let blocks = Blocks::new(state.curve.len()).expect("a ring of 6 nodes or more");
        let sums = observe::sums(&state.curve, &parameters, blocks);
        let now = observe::observed(&sums, &observe::maxima(&state.curve), &parameters);
        let mut report = Report { before: now, middle: now, now, ..Report::default() };
        report.progress.turning = sums.turning;
        let counters = Counters { relax_step: NEVER, half_step: NEVER, ..Counters::default() };
        Run { state, parameters, counters, report }
    }

    /// Reports what its curves are; not compiled into the vector code, since it is one member's.
    #[inline(never)]
    pub(super) fn report_on(&mut self, blocks: Blocks, adaptive: bool) {
        let Run { state, parameters, report, counters } = self;
        // The start is known as it was handed in; observed here it may be a rounding away, and the next step's events with
        // it, which must not depend on where a dispatch ended.
        if counters.steps == 0 {
            return;
        }
        report.before = observe::observe(&state.before, parameters, blocks);
        report.now = observe::observe(&state.curve, parameters, blocks);
        report.middle = if adaptive { observe::observe(&state.middle, parameters, blocks) } else { report.before };
    }

    /// The same member in another precision, rounded.
    pub fn convert<U: Real>(&self) -> Run<U> {
        Run {
            state: self.state.convert(),
            parameters: self.parameters.convert(),
            counters: self.counters,
            report: self.report.convert(),
        }
    }
}

/// A step that is taken: its length where it is adaptive, the excess on its way, and the gap between k and the polygon.
pub(super) struct Taken<T> {
    pub(super) h: T,
    pub(super) before: T,
    pub(super) middle: T,
    pub(super) after: T,
    pub(super) gap: T,
}
