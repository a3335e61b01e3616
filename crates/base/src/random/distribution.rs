//! Distributions of one number, in the words in which they are written: `uniform(1.2..3)`.
//!
//! A draw is the quantile of one uniform number in (0, 1): it needs exactly one number, and the points of a
//! [design](super::Design) stay evenly spread. A choice keeps the order in which its values are written.
//!
//! | | quantile at u |
//! |---|---|
//! | `uniform(a..b)` | a + u (b - a) |
//! | `loguniform(a..b)` | a (b/a)^u |
//! | `normal(mean,sd)` | mean + sd z(u) |
//! | `lognormal(median,sigma)` | median exp(sigma z(u)) |
//! | `halfnormal(sd)` | sd z((1 + u)/2) |
//! | `gamma(shape,scale)` | where the incomplete gamma function of [`gamma`] is u |
//! | `weibull(shape,scale)` | scale (-ln(1 - u))^(1/shape) |
//! | `choice(a,b,...)` | the value with the rank ⌊u count⌋ |
//! | `each(a,b,...)` | the same, but member j has value j |
//! | `empirical(a,b,...)` | between the two values, in ascending order, with ranks around u count - 1/2 |
//!
//! `DISTRIBUTION in a..b` is the continuous law under the condition that the number lies there: its quantile at F(a) +
//! u (F(b) - F(a)), F the share of the law below a number. `table(FILE,COLUMN)` is `each` of a column of a file; it is
//! read once, so that a run can be repeated without the file.
//!
//! z(u) is the [quantile of the standard normal law](super::normal_quantile).

use std::{f64::consts::SQRT_2, fmt, path::Path, str::FromStr};

use super::normal_quantile;
use crate::{
    error::{did_you_mean, echo},
    gamma, input,
    text::number,
};

/// More values than this are a list of another kind.
const MAX_CHOICES: usize = 1000;
/// Maximum values, one for each member.
const MAX_VALUES: usize = 100_000;
/// The distributions, with what each needs.
const USAGE: &str = "uniform(A..B), loguniform(A..B), normal(MEAN,SD), lognormal(MEDIAN,SIGMA), halfnormal(SD), \
                     gamma(SHAPE,SCALE), weibull(SHAPE,SCALE), choice(A,B,...), each(A,B,...), empirical(A,B,...), \
                     table(FILE,COLUMN); continuous ones also as DISTRIBUTION in A..B";

/// The law of one number.
#[derive(Clone, Debug, PartialEq)]
pub enum Distribution {
    /// Any number from the first to the second, all equally probable.
    Uniform([f64; 2]),
    /// A number from the first, above 0, to the second whose logarithm is uniform.
    LogUniform([f64; 2]),
    /// The normal law of this mean and standard deviation, above 0.
    Normal([f64; 2]),
    /// A number whose logarithm is normal: its median, above 0, and the standard deviation of its natural logarithm,
    /// above 0.
    LogNormal([f64; 2]),
    /// The absolute value of a normal number of mean 0 and this standard deviation, above 0.
    HalfNormal(f64),
    /// The gamma law of this shape, above 0, the square of mean over standard deviation; and scale, above 0: the mean
    /// is shape times scale.
    Gamma([f64; 2]),
    /// The Weibull law of this shape, above 0, and scale, above 0: a share 1 - 1/e lies below it.
    Weibull([f64; 2]),
    /// One of these values, all equally probable.
    Choice(Vec<f64>),
    /// These values, one for each member in their order.
    Each(Vec<f64>),
    /// A number between two neighbours of these values, which ascend.
    Empirical(Vec<f64>),
    /// A continuous law, under the condition that the number lies between two others.
    Within {
        /// The law without the condition.
        law: Box<Distribution>,
        /// The smallest.
        low: f64,
        /// The largest.
        high: f64,
        /// The shares of the law below the two.
        shares: [f64; 2],
    },
}

impl Distribution {
    /// The distribution `name(arguments)`.
    ///
    /// # Errors
    /// A message for an unknown name, and for parameters that are not those of a distribution.
    pub fn of(name: &str, arguments: &str) -> Result<Distribution, String> {
        let wrong = |problem: &str, usage: &str| format!("{name}({}): {problem}; write {usage}", echo(arguments));
        let finite = |word: &str| word.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        let range = |usage: &str| {
            let ends = arguments.split_once("..").and_then(|(low, high)| Some((finite(low)?, finite(high)?)));
            let (low, high) = ends.ok_or_else(|| wrong("not a range of finite numbers", usage))?;
            if low < high { Ok([low, high]) } else { Err(wrong("the range is empty", usage)) }
        };
        let pair = |what: &str, usage: &str| {
            let pair = arguments.split_once(',').and_then(|(first, last)| Some((finite(first)?, finite(last)?)));
            let (centre, scale) = pair.ok_or_else(|| wrong("not two finite numbers", usage))?;
            if scale > 0.0 { Ok([centre, scale]) } else { Err(wrong(&format!("the {what} must be above 0"), usage)) }
        };
        match name {
            _ if name != "table" && arguments.contains('(') => Err(wrong("a distribution inside another", USAGE)),
            "uniform" => range("uniform(A..B) with A < B").map(Distribution::Uniform),
            "loguniform" => match range("loguniform(A..B) with 0 < A < B")? {
                ends if ends[0] > 0.0 => Ok(Distribution::LogUniform(ends)),
                _ => Err(wrong("a logarithm needs numbers above 0", "loguniform(A..B) with 0 < A < B")),
            },
            "normal" => pair("standard deviation", "normal(MEAN,SD) with SD > 0").map(Distribution::Normal),
            "lognormal" => {
                let usage =
                    "lognormal(MEDIAN,SIGMA) with MEDIAN > 0 and SIGMA > 0, the standard deviation of the logarithm";
                match pair("standard deviation of the logarithm", usage)? {
                    law if law[0] > 0.0 => Ok(Distribution::LogNormal(law)),
                    _ => Err(wrong("the median must be above 0", usage)),
                }
            }
            "halfnormal" => match finite(arguments).filter(|sd| *sd > 0.0) {
                Some(sd) => Ok(Distribution::HalfNormal(sd)),
                None => Err(wrong("not a number above 0", "halfnormal(SD) with SD > 0")),
            },
            "gamma" | "weibull" => {
                let usage = format!("{name}(SHAPE,SCALE) with SHAPE > 0 and SCALE > 0");
                match pair("scale", &usage)? {
                    [shape, _] if !(MIN_SHAPE..=MAX_SHAPE).contains(&shape) => {
                        Err(wrong(&format!("the shape must be {MIN_SHAPE} to {MAX_SHAPE}"), &usage))
                    }
                    law if name == "gamma" => Ok(Distribution::Gamma(law)),
                    law => Ok(Distribution::Weibull(law)),
                }
            }
            "choice" | "each" | "empirical" => {
                let values = (1..).zip(arguments.split(',')).map(|(place, word)| {
                    let problem = || format!("value {place}, `{}`, is not a finite number", echo(word.trim()));
                    finite(word).ok_or_else(|| wrong(&problem(), &format!("{name}(A,B,...)")))
                });
                let max = if name == "choice" { MAX_CHOICES } else { MAX_VALUES };
                let mut values = values.collect::<Result<Vec<f64>, String>>()?;
                match name {
                    _ if values.len() > max => Err(format!("{name} of {} values; at most {max}", values.len())),
                    "choice" => Ok(Distribution::Choice(values)),
                    "each" => Ok(Distribution::Each(values)),
                    _ => {
                        values.sort_by(f64::total_cmp);
                        match values[..] {
                            [first, .., last] if first < last => Ok(Distribution::Empirical(values)),
                            _ => Err(wrong("fewer than two different numbers", "empirical(A,B,...)")),
                        }
                    }
                }
            }
            "table" => {
                let usage = "table(FILE,COLUMN), a file with a heading and columns separated by commas";
                let (file, column) = arguments.rsplit_once(',').ok_or_else(|| wrong("not two names", usage))?;
                column_of(Path::new(file.trim()), column.trim()).map(Distribution::Each)
            }
            _ => {
                let names = USAGE.split(", ").filter_map(|form| Some(form.split_once('(')?.0));
                Err(format!("unknown distribution `{}`{}; one of {USAGE}", echo(name), did_you_mean(name, names)))
            }
        }
    }

    /// This law between `low..high`, as written after `in`.
    ///
    /// # Errors
    /// A message for a law of single values, for no range, and for one that the law hardly reaches.
    pub fn within(self, range: &str) -> Result<Distribution, String> {
        let wrong =
            |problem: &str| format!("{self} in {}: {problem}; write DISTRIBUTION in A..B with A < B", echo(range));
        let end = |word: &str| word.trim().parse::<f64>().ok().filter(|end| end.is_finite());
        let ends = range.split_once("..").and_then(|(low, high)| Some((end(low)?, end(high)?)));
        if range.trim().is_empty() {
            return Err(format!("{self} in: no range; write DISTRIBUTION in A..B with A < B"));
        }
        if range.contains(" in ") {
            return Err(wrong("a law is cut once"));
        }
        let (low, high) = ends.ok_or_else(|| wrong("not a range of finite numbers"))?;
        if low >= high {
            return Err(wrong("the range is empty"));
        }
        let (Some(below), Some(upto)) = (self.share_below(low), self.share_below(high)) else {
            return Err(wrong("only a continuous law can be cut"));
        };
        if upto - below < MIN_WITHIN {
            return Err(wrong("the law has next to no numbers there"));
        }
        Ok(Distribution::Within { law: self.into(), low, high, shares: [below, upto] })
    }

    /// The values of the members, if each has its own.
    pub fn listed(&self) -> Option<&[f64]> {
        if let Distribution::Each(values) = self { Some(values) } else { None }
    }

    /// The share of all draws of a continuous law that lies below `x`.
    fn share_below(&self, x: f64) -> Option<f64> {
        let normal = |z: f64| 0.5 * libm::erfc(-z / SQRT_2);
        let share = match self {
            Distribution::Choice(_)
            | Distribution::Each(_)
            | Distribution::Empirical(_)
            | Distribution::Within { .. } => return None,
            Distribution::Uniform([low, high]) => ((x - low) / (high - low)).clamp(0.0, 1.0),
            Distribution::LogUniform([low, high]) => ((x / low).ln() / (high / low).ln()).clamp(0.0, 1.0),
            Distribution::Normal([mean, sd]) => normal((x - mean) / sd),
            _ if x <= 0.0 => 0.0,
            Distribution::LogNormal([median, sigma]) => normal((x / median).ln() / sigma),
            Distribution::HalfNormal(sd) => libm::erf(x / sd / SQRT_2),
            Distribution::Gamma([shape, scale]) => gamma::lower(*shape, x / scale),
            Distribution::Weibull([shape, scale]) => -(-(x / scale).powf(*shape)).exp_m1(),
        };
        Some(share)
    }

    /// The number below which a share `u` in (0, 1) of all draws lies.
    pub fn quantile(&self, u: f64) -> f64 {
        match self {
            Distribution::Uniform([low, high]) => (low * (1.0 - u) + high * u).clamp(*low, *high),
            Distribution::LogUniform([low, high]) => (low.ln() * (1.0 - u) + high.ln() * u).exp().clamp(*low, *high),
            Distribution::Normal([mean, sd]) => mean + sd * normal_quantile(u),
            Distribution::LogNormal([median, sigma]) => median * (sigma * normal_quantile(u)).exp(),
            // From the nearer end, where a tail may be thin.
            Distribution::HalfNormal(sd) => -sd * normal_quantile(0.5 * (1.0 - u)),
            Distribution::Gamma([shape, scale]) => scale * gamma::quantile(*shape, u),
            Distribution::Weibull([shape, scale]) => scale * (-(-u).ln_1p()).powf(1.0 / shape),
            Distribution::Choice(values) | Distribution::Each(values) => {
                values[((u * values.len() as f64) as usize).min(values.len() - 1)]
            }
            Distribution::Empirical(values) => {
                let rank = (u * values.len() as f64 - 0.5).clamp(0.0, (values.len() - 1) as f64);
                let first = (rank as usize).min(values.len() - 2);
                let share = rank - first as f64;
                values[first] * (1.0 - share) + values[first + 1] * share
            }
            Distribution::Within { law, low, high, shares: [below, upto] } => law
                .quantile((below * (1.0 - u) + upto * u).clamp(f64::MIN_POSITIVE, 1.0 - f64::EPSILON))
                .clamp(*low, *high),
        }
    }

    /// The values that can be drawn, if they are few; otherwise those at `u` near 0 and near 1.
    pub fn extremes(&self) -> Vec<f64> {
        match self {
            Distribution::Choice(values) | Distribution::Each(values) => values.clone(),
            other => [SMALLEST, 1.0 - SMALLEST].map(|u| other.quantile(u)).to_vec(),
        }
    }
}

/// The smallest share of a distribution that is drawn, and the distance of the largest one from 1: that of six standard
/// deviations. One member in 10⁹ has the number there instead of one beyond. So ordinary laws, such as `normal(1,0.15)`
/// for a radius, cannot give what is impossible.
pub const SMALLEST: f64 = 1.0 / (1_u64 << 30) as f64;

impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Distribution::Uniform([low, high]) => write!(f, "uniform({}..{})", number(*low), number(*high)),
            Distribution::LogUniform([low, high]) => write!(f, "loguniform({}..{})", number(*low), number(*high)),
            Distribution::Normal([mean, sd]) => write!(f, "normal({},{})", number(*mean), number(*sd)),
            Distribution::LogNormal([median, sigma]) => write!(f, "lognormal({},{})", number(*median), number(*sigma)),
            Distribution::HalfNormal(sd) => write!(f, "halfnormal({})", number(*sd)),
            Distribution::Gamma([shape, scale]) => write!(f, "gamma({},{})", number(*shape), number(*scale)),
            Distribution::Weibull([shape, scale]) => write!(f, "weibull({},{})", number(*shape), number(*scale)),
            Distribution::Choice(values) => write!(f, "choice({})", list(values)),
            Distribution::Each(values) => write!(f, "each({})", list(values)),
            Distribution::Empirical(values) => write!(f, "empirical({})", list(values)),
            Distribution::Within { law, low, high, .. } => write!(f, "{law} in {}..{}", number(*low), number(*high)),
        }
    }
}

impl FromStr for Distribution {
    type Err = String;

    fn from_str(text: &str) -> Result<Distribution, String> {
        if let Some((law, range)) = text.rsplit_once(" in ") {
            return law.parse::<Distribution>()?.within(range);
        }
        let parts = text.trim().strip_suffix(')').and_then(|text| text.split_once('('));
        let (name, arguments) =
            parts.ok_or_else(|| format!("`{}` is not a distribution such as uniform(1..2)", echo(text)))?;
        Distribution::of(name.trim(), arguments)
    }
}

/// The range of the shape of the gamma and the Weibull law.
const MIN_SHAPE: f64 = 0.1;
const MAX_SHAPE: f64 = 1e4;
/// The smallest share of a law between the ends of a range: below it, rounding would show.
const MIN_WITHIN: f64 = 1e-6;

fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().copied().map(number).collect();
    values.join(",")
}

/// The numbers in the column `name` of a table with a heading.
fn column_of(path: &Path, name: &str) -> Result<Vec<f64>, String> {
    let at = format!("table({},{})", path.display(), echo(name));
    let text = input::text(path, input::MAX_OUTLINE).map_err(|error| format!("{at}: {error}"))?;
    let mut table =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let heading = table.headers().map_err(|error| format!("{at}: {error}"))?.clone();
    let place = heading.iter().position(|own| own == name).ok_or_else(|| {
        let known: Vec<&str> = heading.iter().collect();
        let meant = did_you_mean(name, known.iter().copied());
        format!("{at}: no such column{meant}; the file has {}", echo(known.join(", ")))
    })?;
    let mut values = Vec::new();
    for (row, record) in table.records().enumerate() {
        let record = record.map_err(|error| format!("{at}: {error}"))?;
        let word = record.get(place).unwrap_or_default();
        let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
        values.push(value.ok_or_else(|| format!("{at}: row {}: `{}` is not a finite number", row + 2, echo(word)))?);
    }
    match values.len() {
        0 => Err(format!("{at}: the column is empty")),
        count if count > MAX_VALUES => Err(format!("{at}: {count} rows; at most {MAX_VALUES}")),
        _ => Ok(values),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const ALL: [&str; 13] = [
        "uniform(-1.5..3)",
        "loguniform(0.01..0.1)",
        "normal(-2,0.5)",
        "lognormal(0.5,0.2)",
        "choice(3,-1,0.25,7)",
        "lognormal(1e-12,1.5)",
        "halfnormal(0.5)",
        "gamma(0.3,2)",
        "gamma(7.5,0.1)",
        "weibull(1.7,3)",
        "empirical(-1,0.5,0.75,4)",
        "lognormal(0.05,0.4) in 0.01..0.06",
        "gamma(2,1) in 0.5..20",
    ];

    /// The exact mean, where it has a formula.
    fn mean(law: &Distribution) -> Option<f64> {
        Some(match law {
            Distribution::Uniform([low, high]) => 0.5 * low + 0.5 * high,
            Distribution::LogUniform([low, high]) => (high - low) / (high / low).ln(),
            Distribution::Normal([mean, _]) => *mean,
            Distribution::LogNormal([median, sigma]) => median * (0.5 * sigma * sigma).exp(),
            Distribution::HalfNormal(sd) => sd * (2.0 / std::f64::consts::PI).sqrt(),
            Distribution::Gamma([shape, scale]) => shape * scale,
            Distribution::Weibull([shape, scale]) => scale * libm::tgamma(1.0 + 1.0 / shape),
            // Half of the draws beyond the outer ranks are these values.
            Distribution::Choice(values) | Distribution::Each(values) | Distribution::Empirical(values) => {
                values.iter().sum::<f64>() / values.len() as f64
            }
            Distribution::Within { .. } => return None,
        })
    }

    fn distribution(text: &str) -> Distribution {
        text.parse().unwrap()
    }

    #[test]
    fn a_distribution_prints_as_it_is_parsed() {
        for text in ALL {
            assert_eq!(distribution(text).to_string(), text);
        }
        assert_eq!(distribution(" normal( 1 , 2 ) ").to_string(), "normal(1,2)");
    }

    #[test]
    fn means_and_quantiles_of_many_draws_agree_with_the_exact_ones() {
        let (seed, count) = (11, 100_000_u64);
        for text in ALL {
            let law = distribution(text);
            let draw = |j| law.quantile(Stream::new(seed, j, 0).uniforms(0)[0]);
            let mut draws: Vec<f64> = (0..count).map(draw).collect();
            draws.sort_by(f64::total_cmp);
            let n = count as f64;
            let mean = draws.iter().sum::<f64>() / n;
            let deviation = (draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
            if let Some(exact) = self::mean(&law) {
                let off = (mean - exact) / (deviation / n.sqrt());
                assert!(off.abs() < 4.0, "seed {seed}: the mean of {text} is off by {off} standard errors");
            }
            if let Distribution::Choice(values) = &law {
                let share = 1.0 / values.len() as f64;
                for value in values {
                    let found = draws.iter().filter(|draw| *draw == value).count() as f64 / n;
                    let bound = 4.0 * (share * (1.0 - share) / n).sqrt();
                    assert!((found - share).abs() < bound, "seed {seed}: {value} has {found} of the draws");
                }
                continue;
            }
            // The share of draws up to the exact quantile is binomial.
            // A share of half a rank lies on each outermost value.
            let shares = if matches!(law, Distribution::Empirical(_)) { 1..4 } else { 0..5 };
            for u in &[0.05, 0.25, 0.5, 0.75, 0.95][shares] {
                let exact = law.quantile(*u);
                let found = draws.partition_point(|x| *x <= exact) as f64 / n;
                let bound = 4.0 * (u * (1.0 - u) / n).sqrt();
                assert!((found - u).abs() < bound, "seed {seed}: {found} of {text} are below its quantile at {u}");
            }
        }
        // A law that is five per cent wider fails.
        let wide = Distribution::Normal([0.0, 1.05]);
        let share =
            (0..count).filter(|j| wide.quantile(Stream::new(seed, *j, 0).uniforms(0)[0]) < normal_quantile(0.05));
        let off = (share.count() as f64 / count as f64 - 0.05) / (0.05 * 0.95 / count as f64).sqrt();
        assert!(off > 4.0, "seed {seed}: {off}");
    }

    #[test]
    fn wrong_parameters_are_refused_with_the_form() {
        for (text, part) in [
            ("uniform(3..1)", "the range is empty; write uniform(A..B)"),
            ("uniform(1..1)", "the range is empty"),
            ("uniform(1,2)", "not a range"),
            ("uniform(1..inf)", "not a range of finite numbers"),
            ("loguniform(0..1)", "needs numbers above 0"),
            ("normal(1,-0.5)", "the standard deviation must be above 0; write normal(MEAN,SD)"),
            ("normal(1,0)", "must be above 0"),
            ("normal(1)", "not two finite numbers"),
            ("normal(1,2,3)", "not two finite numbers"),
            ("lognormal(-1,0.2)", "the median must be above 0"),
            ("lognormal(1,-0.2)", "the standard deviation of the logarithm must be above 0"),
            ("choice()", "value 1, ``, is not a finite number"),
            ("each(1,2,nan)", "value 3, `nan`, is not a finite number; write each(A,B,...)"),
            ("normal(uniform(0..1),2)", "a distribution inside another"),
            ("unifrom(1..2)", "did you mean `uniform`?"),
            ("cauchy(1,2)", "unknown distribution `cauchy`; one of uniform(A..B)"),
            ("gamma(0,2)", "the shape must be 0.1 to 10000; write gamma(SHAPE,SCALE)"),
            ("weibull(1,-2)", "the scale must be above 0; write weibull(SHAPE,SCALE)"),
            ("halfnormal(0)", "not a number above 0; write halfnormal(SD)"),
            ("empirical(1,1)", "fewer than two different numbers"),
            ("normal(0,1) in 2..1", "the range is empty; write DISTRIBUTION in A..B"),
            ("normal(0,1) in ", "normal(0,1) in: no range; write DISTRIBUTION in A..B"),
            ("normal(0,1) in 2", "not a range of finite numbers; write DISTRIBUTION in A..B"),
            ("normal(0,1) in 9..10", "next to no numbers there"),
            ("choice(1,2) in 0..3", "only a continuous law can be cut"),
            ("normal(0,1) in 0..3 in 0..2", "only a continuous law can be cut"),
            ("table(nofile.csv,a)", "nofile.csv"),
            ("table(a)", "not two names; write table(FILE,COLUMN)"),
            ("0.5", "is not a distribution"),
        ] {
            let message = text.parse::<Distribution>().unwrap_err();
            assert!(message.contains(part), "{text}: {message}");
        }
        let many = format!("choice({})", vec!["1"; 1001].join(","));
        assert!(many.parse::<Distribution>().unwrap_err().contains("choice of 1001 values"));
    }

    #[test]
    fn a_quantile_is_the_inverse_of_the_share_below() {
        for text in ALL {
            let law = distribution(text);
            for k in 1..200 {
                let u = f64::from(k) / 200.0;
                let Some(share) = law.share_below(law.quantile(u)) else { break };
                assert!((share - u).abs() < 1e-12, "{text} at {u}: {share}");
            }
        }
        // Values of SciPy 1.17.
        for (text, u, quantile) in [
            ("gamma(0.3,2)", 0.001, 1.3945398193566689e-10),
            ("gamma(7.5,0.1)", 0.999, 1.8848649109176916),
            ("weibull(1.7,3)", 0.25, 1.4415664481224755),
            ("halfnormal(0.5)", 0.9, 0.8224268134757361),
        ] {
            let found = distribution(text).quantile(u);
            assert!((found / quantile - 1.0).abs() < 1e-9, "{text} at {u}: {found}");
        }
    }

    #[test]
    fn a_law_within_a_range_has_the_draws_that_a_refusal_of_all_others_leaves() {
        let (law, free) = (distribution("normal(1,0.5) in 0.2..1.1"), distribution("normal(1,0.5)"));
        let kept: Vec<f64> = (0..400_000_u64)
            .map(|k| free.quantile((k as f64 + 0.5) / 4e5))
            .filter(|x| (0.2..=1.1).contains(x))
            .collect();
        for u in [0.01, 0.3, 0.5, 0.8, 0.99] {
            let wanted = kept[(u * kept.len() as f64) as usize];
            assert!((law.quantile(u) - wanted).abs() < 1e-4, "{u}: {} {wanted}", law.quantile(u));
        }
        assert_eq!([SMALLEST, 1.0 - SMALLEST].map(|u| (law.quantile(u) * 1e6).round() / 1e6), [0.2, 1.1]);
    }

    #[test]
    fn a_column_of_a_table_is_a_value_for_each_member() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sizes.csv");
        std::fs::write(&path, "\u{feff}label,\"radius\"\na,1.5\nb, 2\n\nc,\"0.25\"\n").unwrap();
        let read = |column: &str| format!("table({},{column})", path.display()).parse::<Distribution>();
        assert_eq!(read("radius").unwrap(), Distribution::Each(vec![1.5, 2.0, 0.25]));
        assert_eq!(read("radius").unwrap().to_string(), "each(1.5,2,0.25)");
        assert!(read("label").unwrap_err().contains("row 2: `a` is not a finite number"));
        assert!(read("radios").unwrap_err().contains("no such column (did you mean `radius`?)"));
    }

    #[test]
    fn a_quantile_is_monotonic_and_stays_in_the_support() {
        for text in ALL {
            let law = distribution(text);
            if let Distribution::Choice(values) = &law {
                assert!((1..100).all(|k| values.contains(&law.quantile(f64::from(k) / 100.0))));
                continue;
            }
            let all: Vec<f64> = (1..1000).map(|k| law.quantile(f64::from(k) / 1000.0)).collect();
            let ends_are_flat = matches!(law, Distribution::Empirical(_));
            assert!(all.windows(2).all(|pair| pair[0] < pair[1] || ends_are_flat && pair[0] == pair[1]), "{text}");
            let [low, high] = law.extremes()[..] else { panic!("{text}") };
            let within =
                if ends_are_flat { low <= all[0] && all[998] <= high } else { low < all[0] && all[998] < high };
            assert!(within && low.is_finite() && high.is_finite(), "{text}");
        }
        let [low, high] = distribution("loguniform(0.1..0.3)").extremes()[..] else { panic!() };
        assert!(low >= 0.1 && high <= 0.3);
    }
}
