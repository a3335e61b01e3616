//! The median time as a power of the swept value, where that value is a scale.
//!
//! ln median is fitted as a line in ln value, each cell weighted by its own uncertainty: the width of the interval of
//! ln median over that of a normal number of deviation 1 with the same coverage, 2·1.96 for 95 %. χ² is the sum of the
//! squared distances in units of these uncertainties. If a power law holds it is about the number of cells less 2; if
//! it is so large that this has a probability below [`REJECTED`], no power law holds.
//!
//! A scale is a quantity that is doubled: the amplitude, the size of a shape, the coefficients of a flow. Numerical
//! settings such as n or the tolerance are none. There the median tends to a limit, not to 0 or infinity.

use curvelax_base::{interval::Interval, random::normal_quantile};
use curvelax_ensemble::request::sweep::{Sweep, SweepAxis};
use curvelax_statistics::PowerLaw;

/// Probability of χ² below which a power law is rejected.
pub const REJECTED: f64 = 0.05;
/// Arguments of shapes and flows are proportional up to this relative difference.
const ROUNDING: f64 = 1e-9;

/// The median of the times of one cell, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellMedian {
    /// Index of the cell.
    pub cell: u64,
    /// The median; `None` if fewer than half of the members relaxed.
    pub value: Option<f64>,
    /// Its interval.
    pub interval: Option<Interval>,
    /// Whether all members are copies, so that there is no sampling error.
    pub has_copies: bool,
}

/// The fitted law of a study that sweeps a scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Scaling {
    /// What the law is a power of: `amplitude`, `size of ellipse`.
    pub scale: String,
    /// The law; `None` if fewer than two cells have a median.
    pub law: Option<PowerLaw>,
    /// Cells that are not in the fit, with the reason.
    pub left_out: Vec<(u64, &'static str)>,
}

impl Scaling {
    /// Fits the medians of `cells`; `None` unless a single scale is swept.
    pub fn of(sweep: &Sweep, cells: &[CellMedian]) -> Option<Scaling> {
        let [axis] = sweep.axes() else { return None };
        let (scale, values) = scale(axis)?;
        let points: Vec<_> = cells.iter().zip(values).map(|(cell, value)| (cell.cell, point(cell, value))).collect();
        // Copies of one curve have no sampling error; then all cells count alike.
        let weighted = points.iter().any(|(_, point)| point.is_ok_and(|(.., error)| error > 0.0));
        let (mut kept, mut left_out) = (Vec::new(), Vec::new());
        for (cell, point) in points {
            match point {
                Ok((.., 0.0)) if weighted => left_out.push((cell, "the interval of its median has no width")),
                Ok(point) => kept.push(point),
                Err(reason) => left_out.push((cell, reason)),
            }
        }
        // All numbers are finite and positive.
        let law = match weighted {
            true => PowerLaw::weighted(&kept),
            false => PowerLaw::fit(&kept.iter().map(|(x, y, _)| (*x, *y)).collect::<Vec<_>>()),
        };
        Some(Scaling { scale, law: law.ok().flatten(), left_out })
    }

    /// Whether the cells are too far from any power law.
    pub fn is_rejected(&self) -> bool {
        let goodness = self.law.and_then(|law| law.goodness);
        goodness.is_some_and(|goodness| goodness.p_value < REJECTED)
    }

    /// The cells that are not in the fit in a few words, or nothing.
    pub fn in_words(&self) -> String {
        const NAMED: usize = 5;
        let named = self.left_out.iter().take(NAMED).map(|(cell, reason)| format!("cell {cell} ({reason})"));
        let more = self.left_out.len().saturating_sub(NAMED);
        let more = (more > 0).then(|| format!("{more} more"));
        named.chain(more).collect::<Vec<_>>().join(", ")
    }
}

/// Value, median and error of ln median of a cell, or why it has none.
fn point(cell: &CellMedian, value: f64) -> Result<(f64, f64, f64), &'static str> {
    if value <= 0.0 {
        return Err("its value is not positive");
    }
    let median = cell.value.ok_or("fewer than half of its members relaxed")?;
    if median <= 0.0 {
        return Err("its median is 0");
    }
    if cell.has_copies {
        return Ok((value, median, 0.0));
    }
    let interval = cell.interval.and_then(|interval| Some((interval.bounds()?, interval.coverage)));
    match interval.ok_or("its median has no closed interval")? {
        ((low, high), coverage) if low > 0.0 => {
            let deviations = 2.0 * normal_quantile(0.5 * (1.0 + coverage));
            Ok((value, median, (high / low).ln() / deviations))
        }
        _ => Err("the interval of its median begins at 0"),
    }
}

/// The name and the values of the scale that is swept.
fn scale(axis: &SweepAxis) -> Option<(String, Vec<f64>)> {
    match &axis.key[..] {
        "amplitude" => Some(("amplitude".into(), axis.numbers()?)),
        "shape" => proportional(axis, &["circle", "ellipse", "lemniscate"])
            .map(|(name, values)| (format!("size of {name}"), values)),
        "flow" => {
            proportional(axis, &["elastic", "poly"]).map(|(name, values)| (format!("coefficient of {name}"), values))
        }
        _ => None,
    }
}

/// The common name of words like `ellipse:2,1`, and their first argument, if it is one of `names` and all arguments are
/// proportional.
fn proportional(axis: &SweepAxis, names: &[&str]) -> Option<(String, Vec<f64>)> {
    let labels = axis.labels();
    let parts: Option<Vec<(&str, Vec<f64>)>> = labels
        .iter()
        .map(|label| {
            let (name, arguments) = label.split_once(':')?;
            let numbers: Option<Vec<f64>> = arguments.split(',').map(|word| word.trim().parse().ok()).collect();
            numbers.map(|numbers| (name, numbers))
        })
        .collect();
    let parts = parts?;
    let (name, first) = parts.first().filter(|(name, _)| names.contains(name))?;
    let lead = first.iter().position(|number| *number != 0.0)?;
    let alike = |(own, numbers): &(&str, Vec<f64>)| {
        let factor = numbers.get(lead).map(|number| number / first[lead]);
        let near = |(a, b): (&f64, &f64)| factor.is_some_and(|factor| (a - factor * b).abs() <= ROUNDING * a.abs());
        own == name && numbers.len() == first.len() && numbers.iter().zip(first).all(near)
    };
    parts.iter().all(alike).then(|| (name.to_string(), parts.iter().map(|(_, numbers)| numbers[lead]).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        results::{cells::EnsembleStatistics, tally::Tally},
        samples::outcome,
    };
    use curvelax_base::random::Stream;
    use curvelax_ensemble::{Outcome, Spec, Status};

    /// Statistics of cells with these medians: 41 members each, spread over ± `spread`.
    fn of(sweep: &str, medians: &[f64], spread: f64) -> Option<Scaling> {
        let mut spec = Spec { curves: 41, ..Spec::default() };
        spec.sweep.set(sweep.parse().unwrap());
        let mut tally = Tally::default();
        for member in 0..41 * medians.len() as u64 {
            let (cell, rank) = (member / 41, member % 41);
            let time = medians[cell as usize] * (1.0 + spread * (rank as f64 / 20.0 - 1.0));
            let (status, time) = if time > 0.0 { (Status::Relaxed, Some(time)) } else { (Status::Unfinished, None) };
            tally.add(&Outcome { cell, ..outcome(member, status, time) }).unwrap();
        }
        EnsembleStatistics::new(&spec, &mut tally).unwrap().scaling
    }

    #[test]
    fn a_power_law_is_found_and_not_rejected() {
        let medians = [0.1, 0.2, 0.4, 0.8].map(|x: f64| 0.3 * x.powf(-0.5));
        let found = of("amplitude=0.1,0.2,0.4,0.8", &medians, 0.2).unwrap();
        let law = found.law.unwrap();
        assert!((law.exponent + 0.5).abs() < 1e-12 && law.exponent_error.unwrap() > 1e-3, "{law:?}");
        assert!(!found.is_rejected() && law.goodness.unwrap().p_value > 0.9, "{law:?}");
        assert_eq!((found.scale.as_str(), found.in_words().as_str()), ("amplitude", ""));
    }

    #[test]
    fn medians_far_from_a_power_law_reject_it() {
        let medians = [1.0, 1.3, 1.3, 1.0];
        let rejected = |spread| of("amplitude=0.1,0.2,0.4,0.8", &medians, spread).unwrap().is_rejected();
        assert!(rejected(0.1) && !rejected(0.9));
    }

    #[test]
    fn precise_cells_decide_the_exponent() {
        // Two points with small errors on a power of 1; a third, far off, with an error 50 times as large.
        let points = [(1.0, 1.0, 0.01), (2.0, 2.0, 0.01), (4.0, 40.0, 0.5)];
        let weighted = PowerLaw::weighted(&points).unwrap().unwrap();
        let even = PowerLaw::fit(&points.map(|(x, y, _)| (x, y))).unwrap().unwrap();
        assert!((weighted.exponent - 1.0).abs() < 0.02 && even.exponent > 2.0, "{weighted:?} {even:?}");
    }

    #[test]
    fn errors_of_the_exponent_cover_the_truth() {
        // Scattered by their own errors, 95 of 100 fits are within 1.96 of them, and χ² has the size of its degrees.
        let (mut inside, mut chi) = (0, 0.0);
        for trial in 0..400 {
            let noise = |i: u64| {
                let [u, v] = Stream::new(11, trial, 0).uniforms(i as u32);
                (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
            };
            let points: Vec<_> = (0..6_u64)
                .map(|i| {
                    let (x, error) = (1.5_f64.powi(i as i32), 0.01 * (1.0 + i as f64));
                    (x, x.powf(0.7) * (error * noise(i)).exp(), error)
                })
                .collect();
            let law = PowerLaw::weighted(&points).unwrap().unwrap();
            inside += u32::from((law.exponent - 0.7).abs() < 1.96 * law.exponent_error.unwrap());
            chi += law.goodness.unwrap().statistic / 400.0;
        }
        assert!((366..=392).contains(&inside) && (chi - 4.0).abs() < 0.5, "seed 11: {inside} {chi}");
    }

    #[test]
    fn cells_that_drop_out_are_named_with_the_reason() {
        let found = of("amplitude=0,0.1,0.2,0.4", &[1.0, 1.0, 1.1, -1.0], 0.1).unwrap();
        assert_eq!(
            found.in_words(),
            "cell 0 (its value is not positive), cell 3 (fewer than half of its members relaxed)"
        );
        assert_eq!(found.law.unwrap().count, 2);
        assert_eq!(found.law.unwrap().goodness, None, "a line through two points always fits");
        let none = of("amplitude=0.1,0.2,0.3,0.4,0.5,0.6,0.7", &[-1.0; 7], 0.1).unwrap();
        assert!(
            none.law.is_none() && none.in_words().ends_with("cell 4 (fewer than half of its members relaxed), 2 more")
        );
    }

    #[test]
    fn equal_times_are_fitted_without_weights() {
        let found = of("amplitude=0.1,0.2,0.4", &[3.0, 12.0, 48.0], 0.0).unwrap();
        let law = found.law.unwrap();
        assert!((law.exponent - 2.0).abs() < 1e-12 && (law.factor - 300.0).abs() < 1e-9 && law.goodness.is_none());
    }

    #[test]
    fn only_scales_have_a_law() {
        let scales = [
            ("amplitude=0.1,0.2", "amplitude"),
            ("shape=ellipse:2,1;ellipse:4,2", "size of ellipse"),
            ("shape=circle:1;circle:2.5", "size of circle"),
            ("flow=elastic:0.1,elastic:0.2", "coefficient of elastic"),
            ("flow=poly:0,0.1;poly:0,0.3", "coefficient of poly"),
        ];
        for (sweep, scale) in scales {
            assert_eq!(of(sweep, &[1.0, 2.0], 0.1).unwrap().scale, scale, "{sweep}");
        }
        for sweep in [
            "points=50,100",
            "adaptive=1e-3,1e-4",
            "tau=1e-3,1e-4",
            "tolerance=1e-3,1e-4",
            "omega=1,2",
            "seed=1,2",
            "decay=1,2",
            "shape=ellipse:2,1;ellipse:3,1",
            "shape=circle:1;lemniscate:2",
            "flow=elastic:0.1;poly:0.1",
            "flow=willmore,surface-diffusion",
        ] {
            assert_eq!(of(sweep, &[1.0, 2.0], 0.1), None, "{sweep}");
        }
    }
}
