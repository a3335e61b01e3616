//! What a run lacks of the goal of `--accuracy`, and why.

use super::{EnsembleStatistics, cells::CellStatistics};
use curvelax_base::text::{count, number, rounded, rounded_beside};
use curvelax_ensemble::{Spec, request::spec::Precision};

/// Standard errors of a median of n times in half the 95 % interval, in shares of n: 1.96/2.
const HALF_WIDTH: f64 = 0.98;
/// Distance from the median, in shares of the members, of the two quantiles between which times are taken as evenly
/// spread.
const NEAR: f64 = 0.15;

/// What was asked for, what was reached in the cell that is farthest from it, and why it is not the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Shortfall {
    /// The goal.
    goal: f64,
    /// The uncertainty; infinite if a cell has no interval.
    reached: f64,
    /// The reason and the remedy.
    why: String,
}

impl Shortfall {
    /// What a run of `spec` lacks; none if it lacks nothing, or has no goal.
    pub fn of(spec: &Spec, statistics: &EnsembleStatistics) -> Option<Shortfall> {
        let (goal, reached) = (spec.accuracy?, statistics.uncertainty());
        let farthest =
            |cell: &&CellStatistics| cell.uncertainty(statistics.of_each).map_or(f64::INFINITY, |(all, _)| all);
        let cell = statistics.cells.iter().max_by(|one, other| farthest(one).total_cmp(&farthest(other)))?;
        (reached > goal).then(|| Shortfall { goal, reached, why: why(spec, cell, goal, statistics.of_each) })
    }

    /// `0.013 reached, 0.01 requested: …`.
    pub fn in_words(&self) -> String {
        let Shortfall { goal, reached, why } = self;
        format!("{} reached, {} requested: {why}", rounded_beside(*reached, *goal), number(*goal))
    }

    /// `--accuracy 0.01: 0.013 was reached; …`.
    pub fn sentence(&self) -> String {
        let Shortfall { goal, reached, why } = self;
        format!("--accuracy {}: {} was reached; {why}", number(*goal), rounded_beside(*reached, *goal))
    }
}

fn why(spec: &Spec, cell: &CellStatistics, goal: f64, of_each: bool) -> String {
    let (points, finer) = (spec.points, finer(spec));
    match cell.uncertainty(of_each) {
        _ if cell.relaxing.times.median() == Some(0.0) => {
            "at least half of the members are relaxed at the start: use a larger --amplitude, or another --shape".into()
        }
        None => format!(
            "{} of {} have a limit, too few for a median with an interval: use more --curves or a longer --t-end, or a \
             curve that relaxes",
            cell.relaxing.limits.as_ref().map_or(0, |limits| limits.times.sample.events()),
            count(cell.members(), "member")
        ),
        Some((all, _)) if of_each && 2.0 * rounding(cell) > all => format!(
            "{} of it is due to the rounding of corners: use a smaller --rounding, or a larger --accuracy",
            rounded(rounding(cell), 2)
        ),
        Some(_) if of_each => {
            format!("t_error is larger for some members at n = {points}: {finer}")
        }
        Some((all, discretisation)) if 2.0 * discretisation > all => {
            let discretisation = rounded(discretisation, 2);
            format!("{discretisation} of it is due to discretisation at n = {points}: {finer}")
        }
        Some(_) => match needed(cell, goal) {
            Some(members) => format!(
                "sampling alone needs about {} members in each cell: use more --curves to begin with, or a larger --accuracy",
                rounded(members, 2)
            ),
            None => "use more --curves to begin with".into(),
        },
    }
}

/// What makes the error of each member smaller.
fn finer(spec: &Spec) -> &'static str {
    match spec.precision {
        Some(Precision::F32) => "use --precision f64, more --points, or a larger --accuracy",
        _ => "use more --points, or a larger --accuracy",
    }
}

/// The part of the widest errors of its members that the rounding of corners has, relative to their limits.
fn rounding(cell: &CellStatistics) -> f64 {
    cell.relaxing.limits.as_ref().and_then(|limits| limits.fixed).unwrap_or_default()
}

/// Members for which the interval of the median time would be within `sampling` times the median: the share of the
/// members per time near the median gives its width. None if it is not known.
pub fn needed(cell: &CellStatistics, sampling: f64) -> Option<f64> {
    let [low, median, high] = [0.5 - NEAR, 0.5, 0.5 + NEAR].map(|share| cell.relaxing.times.sample.quantile(share));
    let spread = (high? - low?) / (2.0 * NEAR);
    Some((HALF_WIDTH * spread / (median? * sampling)).powi(2).ceil())
        .filter(|members| sampling > 0.0 && members.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{results::tally::Tally, samples::outcome};
    use curvelax_ensemble::{LevelTimes, Outcome, Status};
    use curvelax_statistics::Limit;

    /// What 64 members lack, whose limits are evenly spread over ± `spread` about 1, each with this error.
    fn lacks(goal: f64, spread: f64, error: f64, outlines: Option<u64>) -> Option<String> {
        lacks_with(goal, spread, [error, 0.0], outlines)
    }

    /// The same where so much of the error is of rounded corners.
    fn lacks_with(goal: f64, spread: f64, [error, fixed]: [f64; 2], outlines: Option<u64>) -> Option<String> {
        let spec = Spec { accuracy: Some(goal), refine: true, outlines, ..Spec::default() };
        let mut tally = Tally::of(&spec, &LevelTimes::default());
        for member in 0..64_u32 {
            let t = 1.0 + spread * (f64::from(member) / 31.5 - 1.0);
            let limit = Limit { t, error, fixed, order: None, asymptotic: true, relative: 0.0 };
            let (t_limit, judged) = (Some(t), Some(limit));
            let ended = Outcome { t_limit, judged, ..outcome(member.into(), Status::Relaxed, Some(t)) };
            tally.add(&ended).unwrap();
        }
        let statistics = EnsembleStatistics::new(&spec, &mut tally).unwrap();
        Shortfall::of(&spec, &statistics).map(|lack| lack.sentence())
    }

    #[test]
    fn the_reason_is_the_larger_part() {
        // Ranks 24 and 41 of 64 are 8.5/31.5 of the spread from the median. The 19 steps of 0.2/63 from rank 23 to 42
        // are 0.3 of the members, so (0.98·0.2011/(0.9984·0.02))² are needed.
        let sampling =
            "--accuracy 0.02: 0.027 was reached; sampling alone needs about 98 members in each cell: use more --curves";
        assert_eq!(lacks(0.02, 0.1, 1e-5, None).unwrap().split(" to begin").next(), Some(sampling));
        assert_eq!(lacks(0.028, 0.1, 1e-5, None), None);
        let steps = "--accuracy 0.028: 0.057 was reached; 0.03 of it is due to discretisation at n = 100: use more --points, or";
        assert!(lacks(0.028, 0.1, 0.03, None).unwrap().starts_with(steps), "{:?}", lacks(0.028, 0.1, 0.03, None));
        let short = Spec { precision: Some(Precision::F32), ..Spec::default() };
        assert!(finer(&short).contains("f64") && !finer(&Spec::default()).contains("f64"));
        // Of outlines each member counts, and sampling is no error.
        assert_eq!(lacks(0.02, 0.1, 1e-3, Some(64)), None);
        let each = "--accuracy 0.02: 0.033 was reached; t_error is larger for some members at n = 100";
        assert!(lacks(0.02, 0.1, 0.03, Some(64)).unwrap().starts_with(each), "{:?}", lacks(0.02, 0.1, 0.03, Some(64)));
    }

    #[test]
    fn errors_that_no_nodes_lessen_name_the_radius_of_corners() {
        let of_rounding =
            "--accuracy 0.02: 0.033 was reached; 0.022 of it is due to the rounding of corners: use a smaller";
        let told = lacks_with(0.02, 0.1, [0.03, 0.02], Some(64)).unwrap();
        assert!(told.starts_with(of_rounding), "{told}");
        // The control: a small part of it.
        assert!(!lacks_with(0.02, 0.1, [0.03, 0.01], Some(64)).unwrap().contains("rounding"));
    }

    #[test]
    fn without_an_interval_the_reason_is_given() {
        let spec = Spec { accuracy: Some(0.1), refine: true, ..Spec::default() };
        let told = |times: &[Option<f64>]| {
            let mut tally = Tally::of(&spec, &LevelTimes::default());
            for t in times {
                let status = if t.is_some() { Status::Relaxed } else { Status::Unfinished };
                tally.add(&outcome(0, status, *t)).unwrap();
            }
            Shortfall::of(&spec, &EnsembleStatistics::new(&spec, &mut tally).unwrap()).unwrap().in_words()
        };
        assert!(
            told(&[None; 8]).starts_with("no interval reached, 0.1 requested: 0 of 8 members have a limit, too few")
        );
        assert!(told(&[Some(0.0); 8]).contains("relaxed at the start: use a larger --amplitude"));
    }
}
