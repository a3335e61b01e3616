//! The stages of a study: its members run side by side in parts, at one level after another and then as they are.

use std::{collections::BTreeSet, ops::Range};

use super::Cell;
use crate::{RefinementLevel, Spec, request::spec::Pace};
use curvelax_flow::solver::{Order, Solver};

/// A part of a study whose members run side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// The level of its members, if they are not the study's own.
    pub level: Option<RefinementLevel>,
    /// Its cells in the study.
    pub range: Range<usize>,
    /// Its members; of a selective one the members of its cells, of which [some](super::Study::members_of) run.
    pub members: u64,
}

impl Stage {
    /// Whether only those members run that need it: more nodes than they have, or variations of their outlines.
    pub fn is_selective(&self) -> bool {
        self.level.is_some_and(RefinementLevel::is_selective)
    }
}

/// All stages of a study of these cells. Where its members are computed changes none of them.
pub(super) fn stages(cells: &[Cell]) -> Vec<Stage> {
    let mut stages = Vec::new();
    // Variations come last, when it is known which level is a member's finest.
    for level in cells.iter().flat_map(Cell::levels).collect::<BTreeSet<_>>() {
        let at = |cell: &Cell| cell.levels().contains(&level).then(|| cell.at(level).ok()).flatten();
        stages.extend(stages_of(Some(level), &cells.iter().map(at).collect::<Vec<_>>()));
    }
    let own: Vec<_> = cells.iter().map(|cell| Some(cell.spec.clone())).collect();
    stages.extend(stages_of(None, &own));
    stages
}

/// The stages of cells with these specs, where they have one.
fn stages_of(level: Option<RefinementLevel>, specs: &[Option<Spec>]) -> Vec<Stage> {
    let mut stages: Vec<(Cohort, Stage)> = Vec::new();
    for (i, spec) in specs.iter().enumerate() {
        let Some(spec) = spec else { continue };
        let (cohort, members) = (Cohort::of(spec), spec.member_count());
        match stages.last_mut() {
            Some((own, stage)) if *own == cohort => {
                stage.range.end = i + 1;
                stage.members += members;
            }
            _ => stages.push((cohort, Stage { level, range: i..i + 1, members })),
        }
    }
    stages.into_iter().map(|(_, stage)| stage).filter(|stage| stage.level.is_none() || stage.members > 0).collect()
}

/// The properties that members must share to run side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cohort {
    points: usize,
    pub(super) solver: Solver,
    order: Order,
    pub(super) adaptive: bool,
    geometric: bool,
}

impl Cohort {
    pub(super) fn of(spec: &Spec) -> Cohort {
        let Spec { points, order, .. } = *spec;
        let (adaptive, geometric) = (matches!(spec.pace(), Pace::Adaptive(_)), spec.is_geometric());
        Cohort { points, solver: spec.solver(), order, adaptive, geometric }
    }
}
