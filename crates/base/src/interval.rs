//! Bounds of an estimated number that say what they cover.

use crate::text::rounded;

/// Bounds of an estimated number, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The lower end; `None` if there is none.
    pub lower: Option<f64>,
    /// The upper end; `None` if there is none.
    pub upper: Option<f64>,
    /// Probability with which it holds the number, at least.
    pub coverage: f64,
    /// The number of values whose range it is, if they are too few for 95 %.
    pub range_of: Option<usize>,
}

impl Interval {
    /// The 95 % interval between two numbers.
    pub fn between(lower: f64, upper: f64) -> Interval {
        Interval { lower: Some(lower), upper: Some(upper), coverage: 0.95, range_of: None }
    }

    /// Both ends, if it has both.
    pub fn bounds(&self) -> Option<(f64, f64)> {
        self.lower.zip(self.upper)
    }

    /// `95 % interval 0.401 to 0.42`, `95 % interval 0.401 or more`, `range of all 4, 0.401 to 0.42,
    /// which contains the median with probability 87.5 %`.
    pub fn in_words(&self, shown: impl Fn(f64) -> String) -> String {
        let ends = self.ends(shown);
        match self.range_of {
            None => format!("95 % interval {ends}"),
            Some(values) => {
                format!(
                    "range of all {values}, {ends}, which contains the median with probability {} %",
                    self.percent()
                )
            }
        }
    }

    /// `95 %: 0.401 to 0.42`, `range of 4, covers 87.5 %: 0.401 to 0.42`.
    pub fn in_short(&self, shown: impl Fn(f64) -> String) -> String {
        let ends = self.ends(shown);
        match self.range_of {
            None => format!("95 %: {ends}"),
            Some(values) => format!("range of {values}, covers {} %: {ends}", self.percent()),
        }
    }

    fn percent(&self) -> String {
        rounded(100.0 * self.coverage, 3)
    }

    fn ends(&self, shown: impl Fn(f64) -> String) -> String {
        match (self.lower.map(&shown), self.upper.map(&shown)) {
            (Some(lower), Some(upper)) => format!("{lower} to {upper}"),
            (Some(lower), None) => format!("{lower} or more"),
            (None, Some(upper)) => format!("{upper} or less"),
            (None, None) => "not known".into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_says_what_it_covers_and_where_it_is_open() {
        let told = |interval: Interval| [interval.in_words(|x| x.to_string()), interval.in_short(|x| x.to_string())];
        let closed = Interval::between(0.5, 0.75);
        assert_eq!(told(closed), ["95 % interval 0.5 to 0.75", "95 %: 0.5 to 0.75"]);
        let open = Interval { upper: None, ..closed };
        assert_eq!((open.bounds(), told(open)[1].as_str()), (None, "95 %: 0.5 or more"));
        assert_eq!(told(Interval { lower: None, ..closed })[0], "95 % interval 0.75 or less");
        let range = Interval { coverage: 0.875, range_of: Some(4), ..closed };
        let words = "range of all 4, 0.5 to 0.75, which contains the median with probability 87.5 %";
        assert_eq!(told(range), [words, "range of 4, covers 87.5 %: 0.5 to 0.75"]);
    }
}
