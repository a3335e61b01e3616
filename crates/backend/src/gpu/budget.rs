//! The budget of one dispatch, and how it follows the time that dispatches take.

use std::time::Duration;

use super::shader::Variant;
use curvelax_flow::solver::{Blocks, Solver, gauss_seidel::SWEEPS_PER_CHECK};

/// Target time of a dispatch: short enough for every watchdog, long enough to hide its overhead of some 0.1 ms.
const DISPATCH_TIME: Duration = Duration::from_millis(40);

/// How much one dispatch may do. Results do not depend on it, to the last bit: a dispatch that runs out pauses, even
/// inside a solve, and the next one continues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Steps of the paper per member.
    pub steps: u32,
    /// Sweeps per member, rounded up to the next check of the residual, or to the end of a round.
    pub sweeps: u32,
}

/// llvmpipe silently leaves all loops of a shader once they have made 65 535 iterations together.
const SOFTWARE_ITERATIONS: u32 = 50_000;

impl Budget {
    /// The maximum budget of a dispatch, on hardware or on a software GPU.
    pub fn most(hardware: bool, blocks: Blocks, Variant { solver, adaptive, .. }: Variant) -> Budget {
        if hardware {
            return Budget { steps: 1 << 20, sweeps: 1 << 24 };
        }
        // A sweep is one iteration. A check of the residual walks over at most all blocks; a step does so twelve times,
        // and the end of an adaptive one, which may come after any of its parts, as often again.
        let walk = blocks.count() as u32 + 1;
        let walks = if adaptive { 24 } else { 12 };
        // Before a round, which may be as short, what its equations need is computed anew. The last one may be long.
        let check = if adaptive && solver.sweeps() { 8 * walk } else { walk };
        Budget {
            steps: (SOFTWARE_ITERATIONS / 2 / (walks * walk)).max(1),
            sweeps: (SOFTWARE_ITERATIONS / 2 / (SWEEPS_PER_CHECK + check) * SWEEPS_PER_CHECK).max(SWEEPS_PER_CHECK),
        }
    }

    /// The budget of the first dispatch: small, to be safe.
    pub fn first(solver: Solver, most: Budget) -> Budget {
        match solver.sweeps() {
            true => Budget { sweeps: most.sweeps.min(256), ..most },
            false => Budget { steps: 1, ..most },
        }
    }

    /// The budget after a dispatch that took `took`: at most twice the sweeps, or steps where there are no sweeps. A
    /// dispatch that was short because no member used up its budget (`used_up`) says nothing of a larger one.
    pub fn after(self, took: Duration, used_up: bool, solver: Solver, most: Budget) -> Budget {
        let share = DISPATCH_TIME.as_secs_f64() / took.as_secs_f64().max(1e-6);
        let growth = if used_up { 2 } else { 1 };
        let next = |now: u32, most: u32| ((f64::from(now) * share) as u32).clamp(1, growth * now).min(most);
        match solver.sweeps() {
            true => Budget { sweeps: next(self.sweeps, most.sweeps), ..self },
            false => Budget { steps: next(self.steps, most.steps), ..self },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_work_of_a_dispatch_settles_at_its_time() {
        let most = Budget { steps: 1 << 20, sweeps: 1 << 24 };
        for solver in Solver::ALL {
            for nanoseconds_per_unit in [3_u32, 700, 90_000, 3_000_000] {
                let units = |b: Budget| if solver.sweeps() { b.sweeps } else { b.steps };
                let time = |b: Budget| Duration::from_nanos(u64::from(nanoseconds_per_unit)) * units(b);
                let mut budget = Budget::first(solver, most);
                for _ in 0..30 {
                    budget = budget.after(time(budget), true, solver, most);
                }
                let settled = (0.5..1.1).contains(&(time(budget).as_secs_f64() / DISPATCH_TIME.as_secs_f64()));
                let largest = units(budget) == units(most);
                assert!(settled || largest, "{solver:?} at {nanoseconds_per_unit} ns: {budget:?}");
                assert_eq!(budget.after(Duration::from_secs(3600), true, solver, most).steps.min(1), 1);
                assert_eq!(budget.after(Duration::ZERO, false, solver, most), budget);
                assert!(budget == most || budget.after(Duration::ZERO, true, solver, most) != budget);
                assert!(
                    units(budget) == 1 || units(budget.after(2 * DISPATCH_TIME, false, solver, most)) < units(budget)
                );
            }
        }
    }
}
