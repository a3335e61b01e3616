//! Lines of the [overview](super::overview): a run, a machine, and what is known of a cell, each in words.

use curvelax_base::{
    error::shortened,
    text::{count, number, p_value, plural, rounded},
};
use curvelax_curve::Perturbation;
use curvelax_ensemble::{
    Drawn, Event, Outcome, Spec,
    request::spec::{FinalTime, OrAuto, Pace, Units},
};
use curvelax_statistics::{GoodnessOfFit, LogRank, PairedDifferences, PowerLaw};
use curvelax_study::{
    placement::Platform,
    results::{
        cells::{CellStatistics, EventStatistics},
        comparison::{CellDifference, LeftOut},
        discretisation::DiscretisationError,
        scaling::Scaling,
        tally::{Tally, shown_time},
        times::TimeStatistics,
    },
};

/// Maximum characters of the name of a group.
pub(super) const MAX_GROUP: usize = 60;

/// The result of a log-rank test.
pub(super) fn chi(test: &LogRank) -> String {
    let LogRank { statistic, degrees_of_freedom, p_value: p, .. } = test;
    format!("{}, chi2 = {} with {}", p_value(*p), significant(*statistic), degrees(*degrees_of_freedom))
}

/// The degrees of freedom of a statistic.
fn degrees(count: usize) -> String {
    if count == 1 { "1 degree of freedom".into() } else { format!("{count} degrees of freedom") }
}

/// Describes the run in one line, without the swept keys.
pub fn describe(spec: &Spec) -> String {
    let time = time_unit(spec);
    let pace = match spec.pace() {
        Pace::Fixed(OrAuto::Number(tau)) => ("tau", format!("tau = {tau:?}{time}")),
        Pace::Fixed(OrAuto::Auto) => ("tau", "tau = auto".into()),
        Pace::Adaptive(tolerance) => ("adaptive", format!("adaptive {tolerance:?}")),
    };
    let drawn = |key: &str, value: &Drawn<f64>| if value.is_drawn() { format!("{key} {value}") } else { String::new() };
    let perturbation = if spec.perturbation == Perturbation::Gaussian { "gaussian perturbation" } else { "" };
    let design = if spec.design.is_random() { String::new() } else { format!("design {}", spec.design.name()) };
    let parts = [
        ("shape", spec.shape.to_string()),
        ("flow", spec.flow.to_string()),
        ("energy", spec.energy.as_ref().map_or(String::new(), |energy| format!("energy {energy}"))),
        ("diffusivity", spec.diffusivity.as_ref().map_or(String::new(), |of| format!("diffusivity {of}"))),
        ("drive", spec.drive.as_ref().map_or(String::new(), |drive| format!("drive {drive}"))),
        ("conserve", spec.conserve.map_or(String::new(), |what| format!("{what} kept"))),
        ("reduced-area", spec.reduced_area.as_ref().map_or(String::new(), |of| format!("reduced area {of}"))),
        ("amplitude", format!("amplitude {}", spec.amplitude)),
        ("decay", drawn("decay", &spec.decay)),
        ("perturbation", perturbation.into()),
        ("design", design),
        ("mobility", mobility(spec)),
        ("points", format!("n = {}", spec.points)),
        pace,
        ("t-end", final_time(spec, &time)),
        ("seed", format!("seed {}", spec.seed)),
    ];
    let swept = |key: &str| spec.sweep.has(key);
    // A swept tolerance replaces a fixed step, and the reverse.
    let has_one_value = |key: &str| match key {
        "tau" | "adaptive" => !swept("tau") && !swept("adaptive"),
        _ => !swept(key),
    };
    let parts = parts.into_iter().filter(|(key, part)| has_one_value(key) && !part.is_empty()).map(|(_, part)| part);
    parts.collect::<Vec<_>>().join(", ")
}

/// The final time with its unit, if it is a number; the latest one if members end when they are relaxed.
fn final_time(spec: &Spec, unit: &str) -> String {
    match spec.t_end.clone().unwrap_or(spec.final_time().into()) {
        t_end @ FinalTime::At(_) if spec.stops_when_relaxed() => format!("t-end ≤ {t_end}{unit}"),
        t_end @ FinalTime::At(_) => format!("t-end = {t_end}{unit}"),
        t_end @ FinalTime::OfCells(_) => format!("t-end from {t_end}{unit}, by cell"),
        FinalTime::Auto => "t-end = auto".into(),
    }
}

/// The mobility with its unit; nothing if there is neither.
fn mobility(spec: &Spec) -> String {
    match (&spec.units, spec.mobility) {
        (None, None) => String::new(),
        (None, Some(mobility)) => format!("B = {}", number(mobility)),
        (Some(units), _) => {
            let Units { length, time } = units.shown();
            format!("B = {} {length}⁴/{time}", number(spec.mobility()))
        }
    }
}

/// The machine in one line.
pub fn machine(platform: &Platform) -> String {
    let Platform { reason, threads, .. } = platform;
    let threads = threads.map_or(String::new(), |count| format!(", {count} {}", plural(count as u64, "thread")));
    format!("{}{threads} ({reason})", place(platform))
}

/// The machine, as far as results depend on it.
pub fn place(platform: &Platform) -> String {
    let Platform { backend, adapter, precision, .. } = platform;
    let adapter = adapter.as_ref().map_or(String::new(), |name| format!(" {name}"));
    let precision = format!("{precision:?}").to_lowercase();
    format!("{backend}{adapter}, {precision}")
}

/// When the members of a cell vanished, if any did.
pub(super) fn vanished(spec: &Spec, cell: &CellStatistics) -> Option<String> {
    let EventStatistics { times: of, limits, stopped, .. } = &cell.vanishing;
    match (of.sample.events(), *stopped) {
        (0, _) => None,
        (_, 0) => {
            let Some(limits) = limits else { return Some(unit(spec) + &times(of, None, "vanished")) };
            let (limits, raw) = (times(&limits.times, Some(of), "vanished and have a limit"), raw(of, spec));
            Some(format!("limit {}{limits}; {raw}", unit(spec)))
        }
        (known, stopped) => {
            let stopped = count(stopped, "member");
            Some(format!("reached by {known}; no statistics, as {stopped} stopped when relaxed"))
        }
    }
}

/// A line for each event of a cell.
pub(super) fn events<'a>(spec: &'a Spec, cell: &'a CellStatistics) -> impl Iterator<Item = String> + 'a {
    let line = |(event, of): (&Event, &EventStatistics)| {
        let error = of.discretisation.as_ref().filter(|error| error.converges()).map_or(String::new(), |error| {
            let [mean, half] = [error.mean, error.error].map(|value| rounded(100.0 * value, 2));
            format!("; discretisation about {mean} % (± {half} %)")
        });
        match (of.stopped, of.times.sample.events()) {
            (0, _) | (_, 0) => {
                let (limit, raw) = if of.limits.is_some() { ("limit ", Some(&of.times)) } else { ("", None) };
                let unit = unit(spec);
                format!("{}: {limit}{unit}{}{error}", event.name, times(of.judged(), raw, "reached it"))
            }
            (stopped, known) => {
                let stopped = count(stopped, "member");
                format!("{}: reached by {known}; no statistics, as {stopped} stopped when relaxed", event.name)
            }
        }
    };
    spec.event.iter().zip(&cell.events).map(line)
}

/// The unit behind a time; empty if it has no name.
pub fn time_unit(spec: &Spec) -> String {
    spec.units.as_ref().map_or(String::new(), |units| format!(" {}", units.shown().time))
}

/// The unit behind a length; empty if it has no name.
pub fn length_unit(spec: &Spec) -> String {
    spec.units.as_ref().map_or(String::new(), |units| format!(" {}", units.shown().length))
}

/// The unit of times in the title of a column; empty if it has no name.
pub(super) fn unit_in_title(spec: &Spec) -> String {
    spec.units.as_ref().map_or(String::new(), |units| format!(" ({})", units.shown().time))
}

/// The unit of times, in front of them; empty if none was named.
pub(super) fn unit(spec: &Spec) -> String {
    spec.units.as_ref().map_or(String::new(), |units| format!("in {}: ", units.shown().time))
}

/// What stands behind limits: the times at the nodes of the run.
pub(super) fn raw(of: &TimeStatistics, spec: &Spec) -> String {
    let Some(mean) = of.mean else { return String::new() };
    let median = of.median().map_or("no median".into(), |median| format!("median {}", significant(median)));
    format!("at n = {}: {median}, mean {}", spec.points, significant(mean.value))
}

/// The name of a member: that of its outline, and what distinguishes its cell.
pub fn member_name(spec: &Spec, member: &Outcome) -> String {
    let label = (!member.label.is_empty()).then(|| shortened(&member.label, MAX_GROUP));
    let cell = (!spec.sweep.is_empty()).then(|| spec.sweep.name(member.cell));
    let name = label.into_iter().chain(cell).collect::<Vec<_>>().join(", ");
    if name.is_empty() { format!("member {}", member.member) } else { name }
}

/// What the clock of moving members shows if their relaxation times are limits.
pub const RAW_CLOCK: &str = "t is that of the run, not the limit";

/// The limit of a member behind its status.
pub fn in_the_limit(t_limit: f64, unit: &str) -> String {
    format!(", t_limit = {}{unit}", curvelax_base::text::significant(t_limit, 4))
}

/// The time of a member with its error, or until when it had not relaxed, if that is known.
pub fn member_time(tally: &Tally, member: &Outcome) -> String {
    match shown_time(member) {
        Some((t, Some(error))) => with_error(t, error),
        Some((t, None)) => significant(t),
        None => tally.later_than(member).map_or("not known".into(), |t| format!("> {}", significant(t))),
    }
}

/// A number and its error: the error to two digits, the number to its last one, if that is possible without a power of
/// ten.
pub(super) fn with_error(t: f64, error: f64) -> String {
    let digits = || usize::try_from(1 - error.log10().floor() as i32).ok().filter(|digits| *digits <= 12);
    match Some(()).filter(|()| error > 0.0 && (1e-4..1e6).contains(&t.abs())).and_then(|()| digits()) {
        Some(digits) => format!("{t:.digits$} ± {error:.digits$}"),
        None => format!("{} ± {}", significant(t), rounded(error, 2)),
    }
}

/// Median and mean of the times at which members `did` something, and how reliable they are. Limits, those of the times
/// `raw`, have intervals for more than sampling.
pub(super) fn times(of: &TimeStatistics, raw: Option<&TimeStatistics>, did: &str) -> String {
    let (members, known) = (of.sample.len() as u64, of.sample.events() as u64);
    let Some(mean) = of.mean else { return format!("none of {members} {} {did}", plural(members, "member")) };
    let half = || format!("no median, as fewer than half of the members {did}");
    let median = of.median().map_or_else(half, |median| format!("median {}", significant(median)));
    let both = if raw.is_some() { ", for sampling and discretisation" } else { "" };
    // If all are equal, there is none.
    let interval = of.interval().filter(|interval| interval.lower != interval.upper);
    let interval = interval.map_or(String::new(), |interval| format!(" ({}{both})", interval.in_words(significant)));
    let alone = if raw.is_some() { ", sampling alone" } else { "" };
    let error = mean.standard_error.map(|error| format!(" (standard error {}{alone})", significant(error)));
    let error = error.unwrap_or_default();
    let least = if mean.restricted_to.is_some() { "at least " } else { "" };
    let without = raw.map_or(0, |raw| raw.sample.events() as u64).saturating_sub(known);
    let others = [(without, "without a limit"), (members - known - without.min(members - known), "censored")];
    let others = others.into_iter().filter(|(count, _)| *count > 0).map(|(count, how)| format!("; {count} {how}"));
    let others: String = others.collect();
    format!(
        "{median}{interval}, mean {least}{}{error} over {known} {} that {did}{others}",
        significant(mean.value),
        plural(known, "member")
    )
}

/// The sides of an interval are named each if one is longer than the other by this factor.
const UNEVEN: f64 = 1.5;

/// What sampling and discretisation do to the times of a cell, a sentence each, and what to do if discretisation does
/// more.
pub(super) fn errors(cell: &CellStatistics, spec: &Spec) -> [String; 2] {
    let EventStatistics { times, limits, .. } = &cell.relaxing;
    if times.sample.events() == 0 {
        return Default::default();
    }
    let interval = times.interval();
    let is_range = interval.is_some_and(|interval| interval.range_of.is_some());
    let bounds = interval.and_then(|interval| interval.bounds());
    let sides = bounds.zip(times.median()).map(|((low, high), median)| [1.0 - low / median, high / median - 1.0]);
    // Members that start at rest have none.
    let sides = sides.filter(|sides| sides.iter().all(|side| side.is_finite()));
    let half = |[below, above]: [f64; 2]| 0.5 * (below + above);
    let sampling = match sides {
        // Their interval is for both, and says so; the range of a few says what it is.
        _ if limits.is_some() || (sides.is_some() && is_range) => String::new(),
        Some([below, above]) => {
            let [half, low, high] = [half([below, above]), below, above].map(|share| rounded(100.0 * share, 2));
            let is_even = (UNEVEN.recip()..=UNEVEN).contains(&(above / below));
            let width = if is_even { format!("±{half} %") } else { format!("-{low} % to +{high} %") };
            format!("the interval of the median, {width}, covers sampling alone")
        }
        None if bounds.is_none() && times.sample.len() > 1 => {
            "the interval of the median is open: too few members relaxed".into()
        }
        None => String::new(),
    };
    [sampling, discretisation(cell, spec, sides.map(half))]
}

/// What helps where orders of convergence are not steady.
const REMEDY: &str = "use --refine, or more --points";

/// What discretisation does to the times of a cell, beside `half` the relative interval of their median.
fn discretisation(cell: &CellStatistics, spec: &Spec, half: Option<f64>) -> String {
    let EventStatistics { discretisation, limits, .. } = &cell.relaxing;
    let Some(discretisation) = discretisation else {
        if limits.is_some() {
            return String::new();
        }
        return "the error of discretisation is unknown: no member relaxed with each of n, n/√2 and n/2 nodes".into();
    };
    let DiscretisationError { members, mean, error, not_asymptotic } = *discretisation;
    let known = plural(members as u64, "member");
    let unsteady = format!("the order of convergence of {not_asymptotic} of {members} {known} is not steady yet");
    if !discretisation.converges() {
        return match limits.as_ref().and_then(|limits| limits.error) {
            Some(bound) => format!("the median t_error is {}", significant(bound)),
            None => format!("the error of discretisation is unknown: {unsteady}; {REMEDY}"),
        };
    }
    let [size, error] = [mean.abs(), error].map(|value| rounded(100.0 * value, 2));
    // The bar of one member is not the spread of all.
    let spread = if members == 1 { String::new() } else { format!(" ± {error} %") };
    let side = if mean < 0.0 { "short" } else { "long" };
    let larger = half.is_none_or(|half| mean.abs() > half);
    let advice = match () {
        () if spec.refine => "; t_limit is corrected for it, to within t_error".into(),
        () if not_asymptotic > 0 => format!("; {unsteady}: {REMEDY}"),
        () if larger && matches!(spec.pace(), Pace::Adaptive(_)) => "; --refine removes this error".into(),
        () if larger => "; --accurate removes this error".into(),
        () => String::new(),
    };
    format!("discretisation makes t_relax {size} %{spread} too {side} (estimated from {members} {known}){advice}")
}

/// The power law of the medians, how well it fits, and the cells that are not in the fit.
pub(super) fn law(of: &Scaling, time: &str) -> Vec<String> {
    let scale = &of.scale;
    let fitted = of.law.map(|PowerLaw { exponent, exponent_error, count, goodness, .. }| {
        let error = exponent_error.map_or(String::new(), |error| format!(", standard error {}", significant(error)));
        let none = exponent_error.is_some_and(|error| exponent.abs() < 2.0 * error);
        let exponent = format!("{}{error}{}", significant(exponent), if none { ", consistent with 0" } else { "" });
        let fit = goodness.map(|GoodnessOfFit { statistic, degrees_of_freedom, p_value: p }| {
            format!("chi2 = {} with {}, {}", significant(statistic), degrees(degrees_of_freedom), p_value(p))
        });
        match fit {
            Some(fit) if of.is_rejected() => {
                format!(
                    "median {time} does not follow a power law in {scale} ({fit}); the nearest exponent is {exponent}"
                )
            }
            Some(fit) => format!("median {time} scales as {scale} to the power {exponent}; {fit}"),
            None => {
                let why = if count < 3 { "with two cells" } else { "without sampling errors" };
                format!(
                    "median {time} scales as {scale} to the power {exponent}; {why} the power law itself cannot be tested"
                )
            }
        }
    });
    let fitted = fitted.unwrap_or_else(|| format!("no power of {scale} is fitted: too few cells have a median"));
    let left_out = (!of.left_out.is_empty()).then(|| format!("not in the fit: {}", of.in_words()));
    [fitted].into_iter().chain(left_out).collect()
}

/// The differences of a cell from the first.
pub(super) fn paired(of: &CellDifference) -> String {
    let CellDifference { found, left_out, .. } = of;
    let PairedDifferences { pairs, equal, median, interval, test } = *found;
    let which = plural(pairs as u64, "pair");
    let difference = match (median, interval, test) {
        (None, ..) => "has no pair in which both relaxed".into(),
        (Some(0.0), _, None) => format!("is equal in {pairs} {which}"),
        (Some(median), _, None) => format!("differs by {} in {pairs} {which}, not tested", significant(median)),
        (Some(median), interval, Some(test)) => {
            let bounds = interval.map_or(String::new(), |(low, high)| {
                format!(" (95 % interval {} to {})", significant(low), significant(high))
            });
            let equal = if equal > 0 { format!(", {equal} of them equal") } else { String::new() };
            let (median, p) = (significant(median), p_value(test.p_value));
            format!("differs by a median of {median}{bounds}, {p} over {pairs} {which}{equal}")
        }
    };
    let LeftOut { later, earlier, unknown } = left_out;
    match left_out.count() {
        0 => difference,
        count => {
            let parts = [(later, "later"), (earlier, "earlier"), (unknown, "of unknown order")];
            let parts = parts.into_iter().filter(|(count, _)| **count > 0);
            let parts: Vec<String> = parts.map(|(count, what)| format!("{count} {what}")).collect();
            format!("{difference}; {count} left out, since a member did not relax ({})", parts.join(", "))
        }
    }
}

/// Four significant digits; whole numbers from 1000 in full.
pub(super) fn significant(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if size == 0.0 => "0".into(),
        _ if !(1e-4..1e7).contains(&size) => format!("{value:.3e}"),
        _ => {
            let digits = (3 - size.log10().floor() as i32).max(0) as usize;
            format!("{value:.digits$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_statistics::SignedRank;

    #[test]
    fn differences_of_pairs_look_like_this() {
        let test = SignedRank { ranked: 510, statistic: 1e5, p_value: 1e-85, exact: false };
        let found = PairedDifferences {
            pairs: 512,
            equal: 2,
            median: Some(-1.25e-3),
            interval: Some((-1.5e-3, -1e-3)),
            test: Some(test),
        };
        let some = CellDifference { cell: 1, found, left_out: LeftOut { later: 0, earlier: 2, unknown: 1 } };
        let median = "differs by a median of -0.001250 (95 % interval -0.001500 to -0.001000), p = 1.0e-85 over 512 pairs, 2 of them equal";
        let left_out = "; 3 left out, since a member did not relax (2 earlier, 1 of unknown order)";
        assert_eq!(paired(&some), format!("{median}{left_out}"));
        let found = PairedDifferences { median: Some(0.0), test: None, ..found };
        let equal = CellDifference { found, left_out: LeftOut::default(), ..some };
        assert_eq!(paired(&equal), "is equal in 512 pairs");
        let found = PairedDifferences { pairs: 1, median: Some(0.5), ..found };
        let copies = CellDifference { found, ..equal };
        assert_eq!(paired(&copies), "differs by 0.5000 in 1 pair, not tested");
        let found = PairedDifferences { median: None, ..found };
        assert_eq!(paired(&CellDifference { found, ..equal }), "has no pair in which both relaxed");
    }

    #[test]
    fn a_law_is_printed_with_its_test_and_the_cells_that_are_not_in_it() {
        let goodness = |p_value| GoodnessOfFit { statistic: 12.5, degrees_of_freedom: 3, p_value };
        let of = |p_value: Option<f64>, count| Scaling {
            scale: "amplitude".into(),
            law: Some(PowerLaw {
                factor: 1.0,
                exponent: -0.25,
                exponent_error: Some(0.01),
                r2: None,
                count,
                goodness: p_value.map(goodness),
            }),
            left_out: Vec::new(),
        };
        let holds = "median t_relax scales as amplitude to the power -0.2500, standard error 0.01000";
        assert_eq!(
            law(&of(Some(0.25), 5), "t_relax"),
            [format!("{holds}; chi2 = 12.50 with 3 degrees of freedom, p = 0.25")]
        );
        let rejected = "median t_relax does not follow a power law in amplitude (chi2 = 12.50 with 3 degrees of freedom, p = 1.0e-7); the nearest exponent is -0.2500, \
                        standard error 0.01000";
        assert_eq!(law(&of(Some(1e-7), 5), "t_relax"), [rejected]);
        assert_eq!(
            law(&of(None, 2), "t_relax"),
            [format!("{holds}; with two cells the power law itself cannot be tested")]
        );
        assert_eq!(
            law(&of(None, 4), "t_relax"),
            [format!("{holds}; without sampling errors the power law itself cannot be tested")]
        );
        let none = Scaling { law: None, left_out: vec![(3, "its median is 0")], ..of(None, 0) };
        let lines = [
            "no power of amplitude is fitted: too few cells have a median",
            "not in the fit: cell 3 (its median is 0)",
        ];
        assert_eq!(law(&none, "t_relax"), lines);
    }

    #[test]
    fn numbers_have_four_digits() {
        let shown = [0.0, 1.0, 12345.6, 0.001234567, 1e-7, 99.999].map(significant);
        assert_eq!(shown, ["0", "1.000", "12346", "0.001235", "1.000e-7", "100.00"]);
    }
}
