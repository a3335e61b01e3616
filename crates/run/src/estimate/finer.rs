//! How many members need more nodes than they have, by those that the pilots of the first three levels ran.

use super::pilot::PilotResult;
use curvelax_ensemble::{LevelRow, LevelTimes, RefinementLevel, Spec, Study, request::spec::Pace};
use curvelax_flow::number::Precision;

/// Rows of a member that needs more nodes at finer levels.
pub const ROWS: f64 = 4.0;

/// How work grows with nodes from level to level.
pub struct LevelGrowth {
    /// Work at all its finer levels of a member that needs some, in that of a member of n nodes.
    all: f64,
    /// The share of the finest one in it.
    finest: f64,
    /// Work of a member of n nodes in that of one of n/2, n/√2 and n nodes on average.
    of_levels: f64,
}

impl LevelGrowth {
    /// Work goes with n. Measured: 3 for flowers with an amplitude of 0.1, 10 for ellipses of 4:1, 11 for flowers with
    /// 0.3; all levels up to 16 n would be 51.
    const DIRECT: LevelGrowth =
        LevelGrowth { all: 8.0, finest: 0.5, of_levels: 3.0 / (0.5 + std::f64::consts::FRAC_1_SQRT_2 + 1.0) };
    /// Work goes with n⁴, measured from 64 to 181 nodes. The same levels.
    const BY_SWEEPS: LevelGrowth = LevelGrowth { all: 200.0, finest: 0.75, of_levels: 3.0 / (0.0625 + 0.25 + 1.0) };

    /// Returns that of the levels of a spec: beside fixed steps they are solved directly.
    pub fn of(spec: &Spec) -> LevelGrowth {
        match spec.pace() {
            Pace::Adaptive(_) if spec.solver().sweeps() => LevelGrowth::BY_SWEEPS,
            _ => LevelGrowth::DIRECT,
        }
    }

    /// Returns the work at finer levels of so many members, from the mean of a member of a level.
    pub fn work(&self, members: f64, of_level: f64) -> f64 {
        members * self.all * self.of_levels * of_level
    }

    /// Returns the work of so many members on variations, each at the finest level of its member, from the mean of a
    /// member of a level; the `share` of members needs more nodes.
    pub fn varied_work(&self, members: f64, share: f64, of_level: f64) -> f64 {
        members * self.of_levels * of_level * (1.0 + share * (self.finest * self.all - 1.0))
    }
}

/// The times of members at the first three levels.
#[derive(Default)]
pub struct FinerPilot {
    levels: LevelTimes,
    /// Those that ran at the last of them.
    members: Vec<u64>,
}

impl FinerPilot {
    /// Adds what the first pilot of a stage at `level` shows, which has the same members at all levels.
    pub fn add(&mut self, level: RefinementLevel, cell: &Spec, precision: Precision, seen: &PilotResult) {
        for ended in &seen.ended {
            let row = LevelRow::new(level, cell, precision, ended);
            if self.levels.add(&row).is_ok() && level == RefinementLevel::FULL {
                self.members.push(ended.member);
            }
        }
    }

    /// The share of the members of `study` that need more nodes, if it is known, and the largest that it may well be.
    pub fn share(&self, study: &Study) -> Option<[f64; 2]> {
        let cell_of = |member: u64| study.cells().get((member / study.spec().members_per_cell()) as usize);
        let needs = |member: u64| {
            let spec = &cell_of(member)?.spec;
            let first = RefinementLevel::finer(spec.points).next();
            Some(spec.refine && first.is_some_and(|level| self.levels.needs(spec, member, level)))
        };
        let judged: Vec<bool> = self.members.iter().filter_map(|member| needs(*member)).collect();
        let finer = judged.iter().filter(|needs| **needs).count();
        // Of m members without one that needs them, a share of 3/m may: the rule of three.
        (!judged.is_empty()).then(|| [finer, finer + 3].map(|count| (count as f64 / judged.len() as f64).min(1.0)))
    }
}
