//! How the cells of a study compare: the test that holds for them, or the reason why none does.
//!
//! Cells whose members are drawn on their own are independent groups, and the log-rank test compares them. Its χ²
//! distribution is a limit for many events. With few it is wrong: cells of one member each have the same χ² whatever
//! their times are. So each cell must have [`LEAST_EXPECTED`] expected events, the usual rule for χ².

use crate::{
    ensemble::Spec,
    error::Result,
    statistics::{LogRank, Sample, log_rank},
};

/// Expected events that each cell needs for the log-rank test.
pub const LEAST_EXPECTED: f64 = 5.0;
/// The log-rank test needs time cubic in the number of cells.
const MAX_COMPARED: usize = 500;

/// How the cells compare.
#[derive(Clone, Debug, PartialEq)]
pub enum Comparison {
    /// There is only one.
    Single,
    /// Independent groups, by the log-rank test that all have one distribution.
    LogRank(LogRank),
    /// No test holds, with the reason as a clause.
    Refused(String),
}

impl Comparison {
    /// Compares the times of cells of a study of `spec`, in order.
    ///
    /// # Errors
    /// [`Error::Request`](crate::Error::Request) if the values of a cell do not fit the spec.
    pub fn independent(spec: &Spec, samples: &[&Sample]) -> Result<Comparison> {
        let count = samples.len();
        if count < 2 {
            return Ok(Comparison::Single);
        }
        let refused = |why: String| Ok(Comparison::Refused(why));
        if count > MAX_COMPARED {
            return refused(format!("{count} cells; the log-rank test compares at most {MAX_COMPARED}"));
        }
        for cell in 0..count as u64 {
            if spec.of_cell(cell)?.amplitude == 0.0 {
                return refused(format!(
                    "cell {cell} has amplitude 0; its members are copies of one curve, not independent draws"
                ));
            }
        }
        let Some(test) = log_rank(samples) else {
            return refused("fewer than two cells still have members when the first one relaxes".into());
        };
        let fewest = test.groups.iter().enumerate().min_by(|a, b| a.1.expected.total_cmp(&b.1.expected));
        match fewest.filter(|(_, group)| group.expected < LEAST_EXPECTED) {
            None => Ok(Comparison::LogRank(test)),
            Some((cell, group)) => refused(format!(
                "cell {cell} has {:.1} expected relaxations; the log-rank test needs {LEAST_EXPECTED} in each cell: \
                 use more --curves",
                group.expected
            )),
        }
    }

    /// The log-rank test, if it holds.
    pub fn log_rank(&self) -> Option<&LogRank> {
        if let Comparison::LogRank(test) = self { Some(test) } else { None }
    }

    /// Why no test holds, if none does.
    pub fn refusal(&self) -> Option<&str> {
        if let Comparison::Refused(why) = self { Some(why) } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{random::Stream, statistics::Observation};

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

    fn compared(cells: usize, curves: u64, factor: f64) -> Comparison {
        let samples = samples(cells, curves, factor);
        Comparison::independent(&swept(cells, curves), &samples.iter().collect::<Vec<_>>()).unwrap()
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
        assert_eq!(compared(1, 200, 1.0), Comparison::Single);
    }

    #[test]
    fn copies_of_one_curve_are_not_compared() {
        let samples = samples(2, 200, 1.3);
        let mut spec = swept(2, 200);
        let compared = |spec: &Spec| Comparison::independent(spec, &samples.iter().collect::<Vec<_>>()).unwrap();
        assert!(compared(&spec).log_rank().is_some());
        spec.amplitude = 0.0;
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
        let refused = Comparison::independent(&swept(2, 50), &[&none, &none]).unwrap();
        assert!(refused.refusal().unwrap().starts_with("fewer than two cells still have members"), "{refused:?}");
        let many = vec![&none; 501];
        let refused = Comparison::independent(&swept(501, 50), &many).unwrap();
        assert_eq!(refused.refusal(), Some("501 cells; the log-rank test compares at most 500"));
    }
}
