//! How the cells of a study compare: the test that holds for them, or the reason why none does.
//!
//! Cells whose members are drawn on their own are independent groups, and the log-rank test compares them. Its χ²
//! distribution is a limit for many events. With few it is wrong: cells of one member each have the same χ² whatever
//! their times are. So each cell must have [`MIN_EXPECTED`] expected events, the usual rule for χ².
//!
//! With common random numbers cells are not independent: member j of every cell has the same draw. Then each cell is
//! compared with the first, member by member, by the [differences](PairedDifferences) of their times.

use std::{cmp::Ordering, ops::Range};

use serde::Serialize;

use super::tally::{CellTally, EventTally, Tally};
use curvelax_base::error::Result;
use curvelax_ensemble::Spec;
use curvelax_statistics::{LogRank, Observation, PairedDifferences, Sample, log_rank};

/// Expected events that each cell needs for the log-rank test.
pub const MIN_EXPECTED: f64 = 5.0;
/// The log-rank test needs time cubic in the number of cells.
const MAX_COMPARED: usize = 500;

/// How the cells compare.
#[derive(Clone, Debug, PartialEq)]
pub enum CellComparison {
    /// There is only one.
    Single,
    /// Independent groups, by the log-rank test that all have one distribution.
    LogRank(LogRank),
    /// Cells whose members share their random numbers: each but the first against the first.
    Paired(Vec<CellDifference>),
    /// No test holds, with the reason as a clause.
    Refused(String),
}

/// Differences of the times between the members of a cell and those of the first cell with the same random numbers.
///
/// A pair counts if both relaxed. The others are left out, since their difference is unknown; they are counted by
/// what is known of its sign.
#[derive(Clone, Debug, PartialEq)]
pub struct CellDifference {
    /// Index of the cell.
    pub cell: u64,
    /// Of the pairs of members that both relaxed: this cell's time less that of the first.
    pub found: PairedDifferences,
    /// Pairs that are left out.
    pub left_out: LeftOut,
}

/// Pairs of which a member did not relax.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// The other member had not relaxed when this cell's had.
    pub earlier: usize,
    /// This cell's member had not relaxed when the other had.
    pub later: usize,
    /// Which one relaxes first is not known.
    pub unknown: usize,
}

impl LeftOut {
    /// All of them.
    pub fn count(self) -> usize {
        self.later + self.earlier + self.unknown
    }

    fn add(&mut self, first: Observation, other: Observation) {
        match () {
            _ if first.happened && other.time >= first.time => self.later += 1,
            _ if other.happened && first.time >= other.time => self.earlier += 1,
            _ => self.unknown += 1,
        }
    }
}

impl CellDifference {
    /// Compares cell `cell` with the first. The observations of both come with the ranks of their members.
    fn new(
        cell: u64,
        first: impl Iterator<Item = (u64, Observation)>,
        other: impl Iterator<Item = (u64, Observation)>,
    ) -> Result<CellDifference> {
        let (mut first, mut other) = (first.peekable(), other.peekable());
        let (mut differences, mut left_out) = (Vec::new(), LeftOut::default());
        while let (Some((rank, a)), Some((own, b))) = (first.peek().copied(), other.peek().copied()) {
            match rank.cmp(&own) {
                Ordering::Equal if a.happened && b.happened => differences.push(b.time - a.time),
                Ordering::Equal => left_out.add(a, b),
                // Only some members ran.
                Ordering::Less | Ordering::Greater => {}
            }
            first.next_if(|_| rank <= own);
            other.next_if(|_| own <= rank);
        }
        Ok(CellDifference { cell, found: PairedDifferences::new(differences)?, left_out })
    }
}

/// The ranks, within cell `cell`, of its members that run, in order.
fn ranks(spec: &Spec, cell: u64) -> Box<dyn Iterator<Item = u64> + '_> {
    let own: Range<u64> = cell * spec.members_per_cell()..(cell + 1) * spec.members_per_cell();
    let (start, shard) = (own.start, spec.shard);
    let all: Box<dyn Iterator<Item = u64>> = match &spec.only {
        None => Box::new(own),
        Some(only) => {
            let place = |member: u64| only.partition_point(|own| *own < member);
            Box::new(only[place(own.start)..place(own.end)].iter().copied())
        }
    };
    Box::new(all.filter(move |member| shard.is_none_or(|shard| shard.has(*member))).map(move |member| member - start))
}

impl CellComparison {
    /// Compares the cells of a study of `spec` whose members share their random numbers. Times, or limits, are still in
    /// `tally`, in the order of the members.
    ///
    /// # Errors
    /// If a time is not finite.
    pub fn paired(spec: &Spec, tally: &Tally, of_limits: bool) -> Result<CellComparison> {
        let count = spec.sweep.cells();
        if count < 2 {
            return Ok(CellComparison::Single);
        }
        let none = CellTally::default();
        let times = |cell: u64| {
            let EventTally { times, limits, .. } = &tally.cells.get(cell as usize).unwrap_or(&none).relaxing;
            if of_limits { limits } else { times }
        };
        if let Some(cell) = (0..count).find(|cell| ranks(spec, *cell).count() != times(*cell).len()) {
            return Ok(CellComparison::Refused(format!(
                "cell {cell} has {} members of {}; pairs are made of all members",
                times(cell).len(),
                ranks(spec, cell).count()
            )));
        }
        let ranked = |cell: u64| ranks(spec, cell).zip(times(cell).iter());
        (1..count)
            .map(|cell| CellDifference::new(cell, ranked(0), ranked(cell)))
            .collect::<Result<_>>()
            .map(CellComparison::Paired)
    }

    /// Compares the times of cells of a study of `spec`, in order.
    ///
    /// # Errors
    /// [`Error::Request`](curvelax_base::error::Error::Request) if the values of a cell do not fit the spec.
    pub fn independent(spec: &Spec, samples: &[&Sample]) -> Result<CellComparison> {
        for cell in 0..samples.len() as u64 {
            if samples.len() > 1 && !spec.of_cell(cell)?.has_different_members() {
                return Ok(CellComparison::Refused(format!(
                    "cell {cell} has amplitude 0; its members are copies of one curve, not independent draws"
                )));
            }
        }
        Ok(CellComparison::by_log_rank(samples, "cell", |cell| cell.to_string(), "use more --curves"))
    }

    /// The comparison of so many samples of copies of outlines: none.
    pub fn of_copies(samples: u64) -> CellComparison {
        if samples < 2 {
            return CellComparison::Single;
        }
        CellComparison::Refused(
            "members are copies of the same outlines, not independent draws; leave out --curves for one member of each"
                .into(),
        )
    }

    /// Compares the times of groups of outlines, with their names.
    pub fn of_groups(samples: &[&Sample], names: &[&str]) -> CellComparison {
        CellComparison::by_log_rank(samples, "group", |group| format!("`{}`", names[group]), "use fewer groups")
    }

    /// Compares independent samples; `what` is one of them, `name` its name, and `remedy` helps where they are too
    /// small.
    fn by_log_rank(samples: &[&Sample], what: &str, name: impl Fn(usize) -> String, remedy: &str) -> CellComparison {
        let count = samples.len();
        if count < 2 {
            return CellComparison::Single;
        }
        let refused = CellComparison::Refused;
        if count > MAX_COMPARED {
            return refused(format!("{count} {what}s; the log-rank test compares at most {MAX_COMPARED}"));
        }
        let Some(test) = log_rank(samples) else {
            return refused(format!("fewer than two {what}s still have members when the first one relaxes"));
        };
        let fewest = test.groups.iter().enumerate().min_by(|a, b| a.1.expected.total_cmp(&b.1.expected));
        match fewest.filter(|(_, group)| group.expected < MIN_EXPECTED) {
            None => CellComparison::LogRank(test),
            Some((rank, group)) => refused(format!(
                "{what} {} has {:.1} expected relaxations; the log-rank test needs {MIN_EXPECTED} in each {what}: \
                 {remedy}",
                name(rank),
                group.expected
            )),
        }
    }

    /// The log-rank test, if it holds.
    pub fn log_rank(&self) -> Option<&LogRank> {
        if let CellComparison::LogRank(test) = self { Some(test) } else { None }
    }

    /// The differences from the first cell, if the cells are paired.
    pub fn paired_cells(&self) -> Option<&[CellDifference]> {
        if let CellComparison::Paired(cells) = self { Some(cells) } else { None }
    }

    /// Why no test holds, if none does.
    pub fn refusal(&self) -> Option<&str> {
        if let CellComparison::Refused(why) = self { Some(why) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::outcome;
    use curvelax_base::random::Stream;
    use curvelax_ensemble::{Outcome, Status};
    use curvelax_statistics::Observation;

    fn swept(cells: usize, curves: u64) -> Spec {
        let mut spec = Spec { curves, ..Spec::default() };
        let values = (1..=cells).map(|value| value.to_string()).collect::<Vec<_>>().join(",");
        spec.sweep.set(format!("omega={values}").parse().unwrap());
        spec
    }

    /// Times of `cells` cells, those of the last one `factor` times as long.
    fn samples(cells: usize, curves: u64, factor: f64) -> Vec<Sample> {
        let time = |cell: usize, member: u64| {
            let [u, _] = Stream::new(3, cell as u64 * curves + member, 0).uniforms(0);
            Observation { time: (1.0 + u) * if cell + 1 == cells { factor } else { 1.0 }, happened: true }
        };
        (0..cells).map(|cell| Sample::new((0..curves).map(|member| time(cell, member))).unwrap()).collect()
    }

    fn compared(cells: usize, curves: u64, factor: f64) -> CellComparison {
        let samples = samples(cells, curves, factor);
        CellComparison::independent(&swept(cells, curves), &samples.iter().collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn cells_of_one_member_each_are_not_compared() {
        for cells in [10, 20] {
            // Whatever the times are, the test gives the same number.
            let chi = |factor| log_rank(&samples(cells, 1, factor)).unwrap().statistic;
            assert!((chi(0.1) - chi(17.0)).abs() < 1e-9 * chi(1.0), "{cells}");
            let refused = compared(cells, 1, 17.0);
            let why = refused.refusal().unwrap();
            assert!(why.contains("expected relaxations; the log-rank test needs 5 in each cell: use more"), "{why}");
        }
    }

    #[test]
    fn many_independent_members_are_compared_and_the_test_sees_a_difference() {
        let p = |factor| compared(3, 200, factor).log_rank().unwrap().p_value;
        assert!(p(1.0) > 0.01 && p(1.3) < 1e-12, "seed 3: {} {}", p(1.0), p(1.3));
        let few = compared(3, 5, 1.3);
        assert!(few.refusal().is_some_and(|why| why.contains(" expected relaxations; ")), "{few:?}");
        assert_eq!(compared(1, 200, 1.0), CellComparison::Single);
    }

    /// Cells with common random numbers: times by cell and rank, negative for members that end unfinished there.
    fn paired(cells: &[&[f64]], only: Option<Vec<u64>>) -> CellComparison {
        let mut spec = swept(cells.len(), cells[0].len() as u64);
        (spec.common_random_numbers, spec.only) = (true, only);
        let mut tally = Tally::default();
        for member in spec.members() {
            let (cell, rank) = (member / spec.curves, member % spec.curves);
            let time = cells[cell as usize][rank as usize];
            let outcome = match time < 0.0 {
                true => Outcome { t_end: -time, ..outcome(member, Status::Unfinished, None) },
                false => outcome(member, Status::Relaxed, Some(time)),
            };
            tally.add(&Outcome { cell, ..outcome }).unwrap();
        }
        CellComparison::paired(&spec, &tally, false).unwrap()
    }

    #[test]
    fn pairs_show_a_difference_of_one_sign_that_the_log_rank_test_does_not_see() {
        let first: Vec<f64> = samples(1, 512, 1.0)[0].observations().map(|seen| seen.time).collect();
        let later: Vec<f64> = first.iter().map(|t| t * (1.0 + 1e-6)).collect();
        let sample = |times: &[f64]| Sample::new(times.iter().map(|t| Observation::new(Some(*t), 9.0))).unwrap();
        assert!(log_rank(&[sample(&first), sample(&later)]).unwrap().p_value > 0.3);
        let compared = paired(&[&first, &later, &first], None);
        let [different, equal] = compared.paired_cells().unwrap() else { panic!("{compared:?}") };
        let (low, high) = different.found.interval.unwrap();
        assert!(
            low > 1.4e-6 && high < 1.6e-6 && different.found.test.unwrap().p_value < 1e-80,
            "seed 3: {different:?}"
        );
        let copies = PairedDifferences { pairs: 512, equal: 512, median: Some(0.0), interval: None, test: None };
        assert_eq!((equal.cell, equal.found), (2, copies));
    }

    #[test]
    fn members_are_paired_by_their_rank_and_those_that_did_not_relax_are_counted() {
        let [first, other] = [&[1.0, 2.0, -3.0, 4.0, -5.0, 6.0][..], &[1.5, -2.0, 2.5, -3.5, -5.0, 7.0]];
        let of = |only: Option<Vec<u64>>| paired(&[first, other], only).paired_cells().unwrap()[0].clone();
        let all = of(None);
        // Differences ½ and 1; the second is later, the third earlier, and two are of unknown order.
        assert_eq!((all.found.pairs, all.found.median), (2, Some(0.75)));
        assert_eq!((all.left_out, all.left_out.count()), (LeftOut { later: 1, earlier: 1, unknown: 2 }, 4));
        // Members 0, 2, 5 of the first cell and 0, 1, 5 of the other: two pairs.
        let some = of(Some(vec![0, 2, 5, 6, 7, 11]));
        assert_eq!((some.found.pairs, some.found.median, some.left_out.count()), (2, Some(0.75), 0));
        let none = of(Some(vec![0, 2, 7]));
        assert_eq!((none.found.pairs, none.found.median, none.left_out.count()), (0, None, 0));
    }

    #[test]
    fn a_table_without_some_members_makes_no_pairs() {
        let mut spec = swept(2, 3);
        spec.common_random_numbers = true;
        let mut tally = Tally::default();
        tally.add(&outcome(0, Status::Relaxed, Some(1.0))).unwrap();
        let refused = CellComparison::paired(&spec, &tally, false).unwrap();
        assert_eq!(refused.refusal(), Some("cell 0 has 1 members of 3; pairs are made of all members"));
    }

    #[test]
    fn copies_of_one_curve_are_not_compared() {
        let samples = samples(2, 200, 1.3);
        let mut spec = swept(2, 200);
        let compared = |spec: &Spec| CellComparison::independent(spec, &samples.iter().collect::<Vec<_>>()).unwrap();
        assert!(compared(&spec).log_rank().is_some());
        spec.amplitude = 0.0.into();
        let refused = compared(&spec);
        assert!(
            refused.refusal().unwrap().starts_with("cell 0 has amplitude 0; its members are copies"),
            "{refused:?}"
        );
        spec.sweep = Default::default();
        spec.sweep.set("amplitude=0.1,0".parse().unwrap());
        assert!(compared(&spec).refusal().unwrap().starts_with("cell 1 has amplitude 0"));
    }

    #[test]
    fn cells_without_relaxations_and_too_many_cells_are_not_compared() {
        let none = Sample::new([Observation { time: 1.0, happened: false }; 50]).unwrap();
        let refused = CellComparison::independent(&swept(2, 50), &[&none, &none]).unwrap();
        assert!(refused.refusal().unwrap().starts_with("fewer than two cells still have members"), "{refused:?}");
        let many = vec![&none; 501];
        let refused = CellComparison::independent(&swept(501, 50), &many).unwrap();
        assert_eq!(refused.refusal(), Some("501 cells; the log-rank test compares at most 500"));
    }
}
