//! A member's run between two dispatches, and members that can run side by side.

use super::{
    Branches, Parameters, State,
    member::{Counters, NEVER, Report},
    observe,
};
use crate::{number::Real, solver::Blocks};

/// Order of the first adaptive step.
pub const FIRST_ORDER: u32 = 5;

/// One member in progress: everything that a dispatch reads and writes.
#[derive(Clone, Debug)]
pub struct Run<T> {
    /// The curve.
    pub state: State<T>,
    /// Its parameters.
    pub parameters: Parameters<T>,
    /// Its counters.
    pub counters: Counters,
    /// Its report; the excess of the last accepted curve is where the next step's events start.
    pub report: Report<T>,
}

/// Members that take the same branches of the scheme, and so can run side by side.
pub struct Group<'a, 'b, T> {
    /// Their runs.
    pub runs: &'a mut [&'b mut Run<T>],
    /// Their branches.
    pub branches: Branches,
}

impl<'a, 'b, T: Real> Group<'a, 'b, T> {
    /// Sorts members into groups of at most `most`.
    pub fn of(runs: &'a mut [&'b mut Run<T>], most: usize) -> Vec<Group<'a, 'b, T>> {
        let branches = |run: &Run<T>| run.parameters.branches();
        runs.sort_by_key(|run| branches(run));
        let alike = runs.chunk_by_mut(|one, other| branches(one) == branches(other));
        let groups = alike.flat_map(|alike| alike.chunks_mut(most));
        groups.map(|runs| Group { branches: branches(runs[0]), runs }).collect()
    }
}

impl<T: Real> Run<T> {
    /// Creates a member at its start, without steps to make and without past events.
    pub fn new(state: State<T>, parameters: Parameters<T>) -> Run<T> {
        let blocks = Blocks::new(state.curve.len()).expect("a ring of 6 nodes or more");
        let sums = observe::sums(&state.curve, &parameters, parameters.kind_of_law(), blocks);
        let now = observe::observed(&sums, &state.curve, &parameters);
        let mut report = Report { before: now, now, ..Report::default() };
        report.progress.turning = sums.turning;
        let counters = Counters { relax_step: NEVER, half_step: NEVER, order: FIRST_ORDER, ..Counters::default() };
        Run { state, parameters, counters, report }
    }

    /// Reports on its curves; not compiled into the vector code, since it concerns a single member.
    #[inline(never)]
    pub(super) fn report_on(&mut self, blocks: Blocks) {
        let Run { state, parameters, report, counters } = self;
        // The start is known as it was passed in. Observing it here could change it, and the next step's events, by a
        // rounding, which must not depend on where a dispatch ended.
        if counters.steps == 0 {
            return;
        }
        report.before = observe::observe(&state.before, parameters, blocks);
        report.now = observe::observe(&state.curve, parameters, blocks);
    }

    /// Converts the member to another precision, rounding.
    pub fn convert<U: Real>(&self) -> Run<U> {
        Run {
            state: self.state.convert(),
            parameters: self.parameters.convert(),
            counters: self.counters,
            report: self.report.convert(),
        }
    }
}
