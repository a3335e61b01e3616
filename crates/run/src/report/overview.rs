//! The table that a run prints at its end.

use std::{fmt, path::Path, time::Duration};

use curvelax_base::{
    error::shortened,
    text::{count, duration, number, p_value, plural, rounded, rounded_beside},
};
use curvelax_curve::Perturbation;
use curvelax_ensemble::{
    Drawn, Event, Spec,
    request::spec::{Pace, Tau, Units},
};
use curvelax_files::names::{ENSEMBLE, GROUPS};
use curvelax_statistics::{GoodnessOfFit, LogRank, PowerLaw};
use curvelax_study::{
    placement::Platform,
    results::{
        cells::{CellStatistics, EnsembleStatistics, EventStatistics, GroupStatistics, Rates},
        comparison::{CellDifference, LeftOut},
        discretisation::DiscretisationError,
        scaling::Scaling,
        shortfall::Shortfall,
        tally::{MemberTime, Tally},
        times::TimeStatistics,
    },
};

/// Maximum number of cells listed; the table has them all.
const MAX_CELLS: usize = 40;

/// Maximum characters of the name of a group.
const MAX_GROUP: usize = 60;

/// A completed run at a glance; its `Display` is the text for stdout.
pub struct Overview<'a> {
    /// The resolved spec.
    pub spec: &'a Spec,
    /// Where it was computed.
    pub platform: &'a Platform,
    /// The results.
    pub tally: &'a Tally,
    /// Statistics of the relaxation times.
    pub statistics: &'a EnsembleStatistics,
    /// How long it took.
    pub wall: Duration,
    /// The output folder.
    pub folder: &'a Path,
    /// The files written there.
    pub files: &'a [&'static str],
}

impl fmt::Display for Overview<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.statuses(f)?;
        writeln!(f)?;
        match self.spec.names_members() {
            true => self.members(f)?,
            false => self.cells(f)?,
        }
        self.groups(f)?;
        for (label, text) in [
            ("ensemble", shortened(&describe(self.spec), usize::MAX)),
            ("outlines", self.tally.mollified.outlines().unwrap_or_default()),
            ("corners", self.tally.mollified.told().unwrap_or_default()),
            (self.statistics.time(), self.relaxation()),
            ("t_relax", self.raw()),
            ("error", self.error()),
            ("nodes", self.tally.nodes.told().unwrap_or_default()),
            ("accuracy", self.accuracy()),
            ("rate", self.rate()),
        ]
        .into_iter()
        .chain(self.events().into_iter().map(|text| ("event", text)))
        .chain([
            ("work", self.work()),
            ("ran on", machine(self.platform)),
            ("wall time", duration(self.wall.as_secs_f64())),
            ("results", format!("{}: {}", self.folder.display(), self.files.join(", "))),
        ]) {
            if !text.is_empty() {
                writeln!(f, "{label:<11}{text}")?;
            }
        }
        Ok(())
    }
}

impl Overview<'_> {
    /// Members by status; rarer ones only if there are any.
    fn statuses(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let members = self.tally.members();
        writeln!(f, "{:<11}{:>10}{:>10}", "status", "members", "share")?;
        for (rank, (status, count)) in self.tally.counts().enumerate() {
            if count > 0 || rank < 2 {
                let share = 100.0 * count as f64 / members.max(1) as f64;
                writeln!(f, "{:<11}{count:>10}{share:>8.1} %", status.name())?;
            }
        }
        writeln!(f, "{:<11}{members:>10}", "all")
    }

    /// The only cell, unless members are listed one by one.
    fn only_cell(&self) -> Option<&CellStatistics> {
        match &self.statistics.cells[..] {
            [cell] if !self.spec.names_members() => Some(cell),
            _ => None,
        }
    }

    fn relaxation(&self) -> String {
        let unit = unit(self.spec);
        self.only_cell()
            .map_or(String::new(), |cell| unit + &times(self.statistics.times(cell), self.statistics.of_limits))
    }

    /// What stands behind the limits of a single ensemble.
    fn raw(&self) -> String {
        let cell = self.only_cell().filter(|_| self.statistics.of_limits);
        cell.map_or(String::new(), |cell| raw(&cell.times, self.spec))
    }

    /// A line for each event of a single ensemble.
    fn events(&self) -> Vec<String> {
        self.only_cell().map_or(Vec::new(), |cell| events(self.spec, cell).collect())
    }

    /// Each member with its time, where they are few and known by name.
    fn members(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let names: Vec<String> = self.tally.named.iter().map(|member| member_name(self.spec, member)).collect();
        let times: Vec<String> = self.tally.named.iter().map(member_time).collect();
        let unit = self.spec.units.as_ref().map_or(String::new(), |units| format!(" ({})", units.shown().time));
        let (time, error) = (self.statistics.time(), if self.statistics.of_limits { " ± t_error" } else { "" });
        let title = format!("{time}{error}{unit}");
        let wide = |all: &[String], title: &str| {
            all.iter().map(|text| text.chars().count()).fold(title.chars().count(), usize::max)
        };
        let (label, columns) = (wide(&names, "label"), wide(&times, &title));
        writeln!(f, "{:<11}{:<label$}  {title:<columns$}  status", "member", "label")?;
        for ((member, name), time) in self.tally.named.iter().zip(&names).zip(&times) {
            write!(f, "{:<11}{name:<label$}  {time:<columns$}  {}", member.member, member.status.name())?;
            for (event, t) in self.spec.event.iter().zip(&member.events) {
                write!(f, "  {} {}", event.name, t.map_or("not seen".into(), significant))?;
            }
            writeln!(f)?;
        }
        self.pairs(f)?;
        writeln!(f)
    }

    /// The uncertainty of the median of a single ensemble, by its sources.
    fn error(&self) -> String {
        self.only_cell().map_or(String::new(), |cell| errors(cell, self.spec))
    }

    /// What `--accuracy` asked for, and what was reached in the cell that is farthest from it.
    fn accuracy(&self) -> String {
        // A shard has some of the members that it takes.
        let Some(goal) = self.spec.accuracy.filter(|_| self.spec.shard.is_none()) else { return String::new() };
        if let Some(lack) = Shortfall::of(self.spec, self.statistics) {
            return lack.told();
        }
        let of_each = if self.statistics.of_each { " for each member" } else { "" };
        let reached = rounded_beside(self.statistics.uncertainty(), goal);
        format!("{}{of_each} asked for, {reached} reached", number(goal))
    }

    /// The rates of a single ensemble; empty if no member has one.
    fn rate(&self) -> String {
        let Some(CellStatistics { rates: Rates { numbers, .. }, .. }) = self.only_cell() else { return String::new() };
        let Some(median) = numbers.get("median") else { return String::new() };
        let theory = numbers.get("ratio");
        let theory = theory.map_or(String::new(), |ratio| format!(", {} times that of theory", significant(ratio)));
        let members = plural(numbers.known as u64, "member");
        format!("median {}{theory}, fitted to {} {members}", significant(median), numbers.known)
    }

    /// One line per cell of a study, and how the cells compare.
    fn cells(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let EnsembleStatistics { cells, comparison, scaling, .. } = self.statistics;
        if cells.len() < 2 {
            return Ok(());
        }
        for cell in cells.iter().take(MAX_CELLS) {
            let (name, time) = (self.spec.sweep.name(cell.cell), self.statistics.time());
            let of_cell = times(self.statistics.times(cell), self.statistics.of_limits);
            writeln!(f, "{:<11}{name}: {time} {}{of_cell}", cell.cell, unit(self.spec))?;
            if self.statistics.of_limits {
                writeln!(f, "{:<11}t_relax {}", "", raw(&cell.times, self.spec))?;
            }
            let errors = errors(cell, self.spec);
            if !errors.is_empty() {
                writeln!(f, "{:<11}{errors}", "")?;
            }
            events(self.spec, cell).try_for_each(|event| writeln!(f, "{:<11}{event}", ""))?;
        }
        match cells.len().saturating_sub(MAX_CELLS) {
            0 => {}
            1 => writeln!(f, "{:<11}1 more cell is in {ENSEMBLE}", "...")?,
            more => writeln!(f, "{:<11}{more} more cells are in {ENSEMBLE}", "...")?,
        }
        if let Some(test) = comparison.log_rank() {
            writeln!(f, "{:<11}log-rank test that all cells have one distribution: {}", "cells", chi(test))?;
        }
        if let Some(why) = comparison.refusal() {
            writeln!(f, "{:<11}not compared: {why}", "cells")?;
        }
        self.pairs(f)?;
        for text in scaling.iter().flat_map(|of| law(of, self.statistics.time())) {
            writeln!(f, "{:<11}{text}", "law")?;
        }
        writeln!(f)
    }

    /// How each cell differs from the first, if members are paired.
    fn pairs(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let comparison = &self.statistics.comparison;
        for (i, difference) in comparison.paired_cells().unwrap_or_default().iter().take(MAX_CELLS).enumerate() {
            if i == 0 {
                let time = self.statistics.time();
                writeln!(f, "{:<11}{time} less that of the same member of cell 0 (Wilcoxon's signed ranks):", "pairs")?;
            }
            writeln!(f, "{:<11}{}", difference.cell, paired(difference))?;
        }
        Ok(())
    }

    /// One line per group of outlines, and how the groups of each cell compare.
    fn groups(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Some(property) = &self.spec.group_by else { return Ok(()) };
        let EnsembleStatistics { cells, groups, group_comparisons, .. } = self.statistics;
        let cell = |rank: u64| if cells.len() < 2 { String::new() } else { format!(", cell {rank}") };
        for GroupStatistics { group, times: of } in groups.iter().take(MAX_CELLS) {
            let name = shortened(group, MAX_GROUP);
            let (time, of_limits) = (self.statistics.time(), self.statistics.of_limits);
            let (cell, times) = (cell(of.cell), times(self.statistics.times(of), of_limits));
            writeln!(f, "{:<11}{property} {name}{cell}: {time} {}{times}", "group", unit(self.spec))?;
        }
        match groups.len().saturating_sub(MAX_CELLS) {
            0 => {}
            1 => writeln!(f, "{:<11}1 more group is in {GROUPS}", "...")?,
            more => writeln!(f, "{:<11}{more} more groups are in {GROUPS}", "...")?,
        }
        for (rank, comparison) in (0..).zip(group_comparisons).take(MAX_CELLS) {
            if let Some(test) = comparison.log_rank() {
                writeln!(
                    f,
                    "{:<11}log-rank test that all groups have one distribution{}: {}",
                    "groups",
                    cell(rank),
                    chi(test)
                )?;
            }
            if let Some(why) = comparison.refusal() {
                writeln!(f, "{:<11}not compared{}: {why}", "groups", cell(rank))?;
            }
        }
        writeln!(f)
    }

    fn work(&self) -> String {
        let Tally { steps, solves, sweeps_k, sweeps_x, .. } = self.tally;
        let members = self.tally.members().max(1);
        let each = |total: u64| match total % members {
            0 => (total / members).to_string(),
            _ => significant(total as f64 / members as f64),
        };
        let steps_each = match each(*steps) {
            one if one == "1" => "1 step".into(),
            several => format!("{several} steps"),
        };
        let solves_each = if solves == steps { String::new() } else { format!(" ({} solves)", each(*solves)) };
        match sweeps_k + sweeps_x {
            0 => format!("{steps_each} per member{solves_each}, no sweeps"),
            _ => format!(
                "{steps_each} per member{solves_each}, Gauss-Seidel sweeps {} for k and {} for x, y",
                each(*sweeps_k),
                each(*sweeps_x)
            ),
        }
    }
}

/// The result of a log-rank test.
fn chi(test: &LogRank) -> String {
    let LogRank { statistic, degrees_of_freedom, p_value: p, .. } = test;
    format!("{}, chi2 = {} ({degrees_of_freedom})", p_value(*p), significant(*statistic))
}

/// Describes the run in one line, without the swept keys.
pub fn describe(spec: &Spec) -> String {
    let pace = match spec.pace() {
        Pace::Fixed(Tau::Step(tau)) => ("tau", format!("tau = {tau:?}")),
        Pace::Fixed(Tau::Auto) => ("tau", "tau = auto".into()),
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
        ("amplitude", drawn("amplitude", &spec.amplitude)),
        ("decay", drawn("decay", &spec.decay)),
        ("perturbation", perturbation.into()),
        ("design", design),
        ("mobility", mobility(spec)),
        ("points", format!("n = {}", spec.points)),
        pace,
        ("t-end", format!("t-end = {}", spec.t_end.clone().unwrap_or(spec.final_time().into()))),
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

/// A line for each event of a cell.
fn events<'a>(spec: &'a Spec, cell: &'a CellStatistics) -> impl Iterator<Item = String> + 'a {
    let line = |(event, of): (&Event, &EventStatistics)| {
        let error = of.discretisation.as_ref().filter(|error| error.converges()).map_or(String::new(), |error| {
            let [mean, half] = [error.mean, error.error].map(|value| rounded(100.0 * value, 2));
            format!("; discretisation about {mean} % (± {half} %)")
        });
        match (of.stopped, of.times.sample.events()) {
            (0, _) | (_, 0) => {
                let limit = if of.limits.is_some() { "limit " } else { "" };
                let unit = unit(spec);
                format!("{}: {limit}{unit}{}{error}", event.name, times(of.judged(), of.limits.is_some()))
            }
            (stopped, known) => {
                let stopped = count(stopped, "member");
                format!("{}: reached by {known}; no statistics, as {stopped} stopped when relaxed", event.name)
            }
        }
    };
    spec.event.iter().zip(&cell.events).map(line)
}

/// The unit of times, in front of them; empty if none was named.
fn unit(spec: &Spec) -> String {
    spec.units.as_ref().map_or(String::new(), |units| format!("in {}: ", units.shown().time))
}

/// What stands behind limits: the times at the nodes of the run.
fn raw(of: &TimeStatistics, spec: &Spec) -> String {
    let Some(mean) = of.mean else { return String::new() };
    let median = of.median().map_or("not reached by half of the members".into(), significant);
    format!("raw, at n = {}: median {median}, mean {}", spec.points, significant(mean.value))
}

/// The name of a member: that of its outline, and what distinguishes its cell.
pub fn member_name(spec: &Spec, member: &MemberTime) -> String {
    let label = (!member.label.is_empty()).then(|| shortened(&member.label, MAX_GROUP));
    let cell = (!spec.sweep.is_empty()).then(|| spec.sweep.name(member.cell));
    let name = label.into_iter().chain(cell).collect::<Vec<_>>().join(", ");
    if name.is_empty() { format!("member {}", member.member) } else { name }
}

/// The time of a member with its error, or until when it had not relaxed.
pub fn member_time(member: &MemberTime) -> String {
    match member.shown() {
        Some((t, Some(error))) => {
            let (t, error) = beside(t, error);
            format!("{t} ± {error}")
        }
        Some((t, None)) => significant(t),
        None => format!("> {}", significant(member.t_end)),
    }
}

/// A number and its error: the error to two digits, the number to its last one, if that is possible without a power of ten.
fn beside(t: f64, error: f64) -> (String, String) {
    let digits = 1 - error.log10().floor() as i32;
    match error > 0.0 && (1e-4..1e6).contains(&t.abs()) && (0..=12).contains(&digits) {
        true => {
            let digits = digits as usize;
            (format!("{t:.digits$}"), format!("{error:.digits$}"))
        }
        false => (significant(t), rounded(error, 2)),
    }
}

/// Median and mean of the times of a cell, and how reliable they are; limits have intervals for more than sampling.
fn times(of: &TimeStatistics, of_limits: bool) -> String {
    let (members, known) = (of.sample.len() as u64, of.sample.events() as u64);
    let Some(mean) = of.mean else { return format!("none of {members} {} reached it", plural(members, "member")) };
    let median = of.median().map_or("not reached by half of the members".into(), significant);
    let both = if of_limits { ", for sampling and discretisation" } else { "" };
    let interval = of.interval().map_or(String::new(), |interval| format!(" ({}{both})", interval.told(significant)));
    let error = mean.standard_error.map_or(String::new(), |error| format!(" (standard error {})", significant(error)));
    let least = if mean.restricted_to.is_some() { "at least " } else { "" };
    let censored = match members - known {
        0 => String::new(),
        censored => format!("; {censored} censored"),
    };
    format!(
        "median {median}{interval}, mean {least}{}{error} over {known} {} that reached it{censored}",
        significant(mean.value),
        plural(known, "member")
    )
}

/// What sampling and discretisation do to the median of a cell, and what to do about the larger one.
fn errors(cell: &CellStatistics, spec: &Spec) -> String {
    if cell.times.sample.events() == 0 {
        return String::new();
    }
    let bounds = cell.interval().and_then(|interval| interval.bounds());
    // The interval of the limits says it already, together with what follows.
    let sampling = bounds.filter(|_| cell.limits.is_none());
    let half = bounds.zip(cell.median()).map(|((low, high), median)| 0.5 * (high - low) / median);
    let sampling =
        sampling.and(half).map_or(String::new(), |half| format!("sampling ±{} %; ", rounded(100.0 * half, 2)));
    let Some(discretisation) = &cell.discretisation else {
        if cell.limits.is_some() {
            return String::new();
        }
        return format!("{sampling}discretisation not known: no member has times at n, n/√2 and n/2 nodes");
    };
    let DiscretisationError { members, mean, error, not_asymptotic } = *discretisation;
    let known = plural(members as u64, "member");
    let remedy = if spec.refine { "t_error bounds them" } else { "use --refine, or more --points" };
    let bound = cell.limits.as_ref().and_then(|limits| limits.error);
    if let (false, Some(bound)) = (discretisation.converges(), bound) {
        return format!(
            "{sampling}t_error {} (median), a bound: times of {not_asymptotic} of {members} {known} do not converge yet in n",
            significant(bound)
        );
    }
    if !discretisation.converges() {
        return format!(
            "{sampling}discretisation not known: times of {not_asymptotic} of {members} {known} do not converge yet in n; \
             {remedy}"
        );
    }
    let percent = |value: f64| rounded(100.0 * value, 2);
    let [mean_told, error] = [mean, error].map(percent);
    let about = format!("{sampling}discretisation {mean_told} % ± {error} % (estimated from {members} {known})");
    let larger = half.is_none_or(|half| mean.abs() > half);
    let advice = match () {
        () if not_asymptotic > 0 => {
            format!("; times of {not_asymptotic} of them do not converge yet in n: {remedy}")
        }
        () if spec.refine => ": t_limit is free of it".into(),
        () if larger && matches!(spec.pace(), Pace::Adaptive(_)) => " dominates; add --refine to remove it".into(),
        () if larger => " dominates; add --accurate to remove it".into(),
        () => String::new(),
    };
    format!("{about}{advice}")
}

/// The power law of the medians, how well it fits, and the cells that are not in the fit.
fn law(of: &Scaling, time: &str) -> Vec<String> {
    let scale = &of.scale;
    let fitted = of.law.map(|PowerLaw { exponent, exponent_error, count, goodness, .. }| {
        let error = exponent_error.map_or(String::new(), |error| format!(", standard error {}", significant(error)));
        let exponent = format!("{}{error}", significant(exponent));
        let fit = goodness.map(|GoodnessOfFit { statistic, degrees_of_freedom, p_value: p }| {
            format!("chi2 = {} ({degrees_of_freedom}), {}", significant(statistic), p_value(p))
        });
        match fit {
            Some(fit) if of.is_rejected() => {
                format!("median {time} is no power of {scale}: {fit}; the nearest power is {exponent}")
            }
            Some(fit) => format!("median {time} scales as {scale} to the power {exponent}; {fit}"),
            None => {
                let why =
                    if count < 3 { "two cells do not test it" } else { "without sampling errors it is not tested" };
                format!("median {time} scales as {scale} to the power {exponent}; {why}")
            }
        }
    });
    let fitted = fitted.unwrap_or_else(|| format!("no power of {scale} is fitted: too few cells have a median"));
    let left_out = (!of.left_out.is_empty()).then(|| format!("not in the fit: {}", of.told()));
    [fitted].into_iter().chain(left_out).collect()
}

/// The differences of a cell from the first.
fn paired(of: &CellDifference) -> String {
    let CellDifference { pairs, equal, median, interval, test, left_out, .. } = of;
    let which = plural(*pairs as u64, "pair");
    let difference = match (median, interval, test) {
        (None, ..) => "in no pair both relaxed".into(),
        (Some(0.0), _, None) => format!("equal in {pairs} {which}"),
        (Some(median), _, None) => format!("{} in {pairs} {which}, not tested", significant(*median)),
        (Some(median), interval, Some(test)) => {
            let bounds = interval.map_or(String::new(), |(low, high)| {
                format!(" (95 % interval {} to {})", significant(low), significant(high))
            });
            let equal = if *equal > 0 { format!(", {equal} of them equal") } else { String::new() };
            format!("median {}{bounds}, {} over {pairs} {which}{equal}", significant(*median), p_value(test.p_value))
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
fn significant(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if size == 0.0 => "0".into(),
        _ if !(1e-4..1e15).contains(&size) => format!("{value:.3e}"),
        _ => {
            let digits = (3 - size.log10().floor() as i32).max(0) as usize;
            format!("{value:.digits$}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_ensemble::{Outcome, Status};
    use curvelax_files::names;
    use curvelax_statistics::{Limit, SignedRank};
    use curvelax_study::samples::{outcome, platform};

    fn overview(tally: &Tally) -> String {
        let (spec, platform, mut tally) = (Spec::default(), platform(), tally.clone());
        let wall = Duration::from_millis(12_345);
        let files = &[names::SUMMARY, names::RUN];
        let statistics = &EnsembleStatistics::new(&spec, &mut tally).unwrap();
        Overview { spec: &spec, platform: &platform, tally: &tally, statistics, wall, folder: Path::new("out"), files }
            .to_string()
    }

    #[test]
    fn an_overview_looks_like_this() {
        let mut tally = Tally::default();
        tally.add(&outcome(0, Status::Relaxed, Some(0.3))).unwrap();
        tally.add(&outcome(1, Status::Relaxed, Some(0.5))).unwrap();
        tally.add(&outcome(2, Status::Unfinished, None)).unwrap();
        tally.add(&outcome(3, Status::Stalled, None)).unwrap();
        let expected = "\
status        members     share
relaxed             2    50.0 %
unfinished          1    25.0 %
stalled             1    25.0 %
all                 4

ensemble   ellipse:2,1, surface-diffusion, n = 100, tau = 0.001, t-end = 2, seed 1
t_relax    median 0.5000 (range of 4, 0.3000 or more, covers 93.8 %), mean at least 1.200 (standard error 0.4016) over 2 members that reached it; 2 censored
error      discretisation not known: no member has times at n, n/√2 and n/2 nodes
work       10 steps per member, Gauss-Seidel sweeps 20 for k and 5 for x, y
ran on     cpu, f64, 2 threads (no hardware GPU)
wall time  12.3 s
results    out: summary.csv, run.json
";
        assert_eq!(overview(&tally), expected);
    }

    #[test]
    fn errors_look_like_this() {
        let mut tally = Tally::default();
        for (member, t) in (0..40_u32).map(|member| (u64::from(member), 0.5 + 0.01 * f64::from(member))) {
            let judged = Limit {
                t: 1.02 * t,
                error: 1e-4 * t,
                fixed: 0.0,
                order: Some(2.0),
                asymptotic: member > 0,
                relative: -0.02,
            };
            let judged = (member < 4).then_some(judged);
            tally.add(&Outcome { judged, ..outcome(member, Status::Relaxed, Some(t)) }).unwrap();
        }
        let told = |tally: &Tally| {
            let text = overview(tally);
            text.lines().find(|line| line.starts_with("error")).unwrap().to_string()
        };
        let about = "; discretisation -2 % ± 0.0098 % (estimated from 4 members)";
        let some = told(&tally);
        assert!(
            some.ends_with(&format!(
                "{about}; times of 1 of them do not converge yet in n: use --refine, or more --points"
            )),
            "{some}"
        );
        tally.cells[0].judged.iter_mut().for_each(|limit| limit.asymptotic = true);
        // Sampling is the larger one here.
        assert!(told(&tally).ends_with(about), "{}", told(&tally));
        tally.cells[0].judged.iter_mut().for_each(|limit| limit.relative = -0.2);
        assert!(told(&tally).ends_with(" dominates; add --accurate to remove it"), "{}", told(&tally));
    }

    #[test]
    fn members_that_needed_more_nodes_are_counted() {
        let mut tally = Tally::default();
        tally.refined = true;
        let nodes = |tally: &Tally| {
            let text = overview(tally);
            text.lines().find_map(|line| line.strip_prefix("nodes      ").map(String::from))
        };
        let mut add = |member: u64, points: u64, asymptotic: bool| {
            let judged = Some(Limit { t: 0.5, error: 1e-4, fixed: 0.0, order: None, asymptotic, relative: 0.0 });
            let outcome = outcome(member, Status::Relaxed, Some(0.5));
            tally.add(&Outcome { judged, points, is_finer: points > 100, ..outcome }).unwrap();
            nodes(&tally)
        };
        assert_eq!(add(0, 100, true), None);
        assert_eq!(add(1, 100, false).as_deref(), Some("the errors of 1 of 2 members are bounds"));
        assert_eq!(add(2, 283, true).as_deref(), Some("1 of 3 members at up to n = 283; the errors of 1 are bounds"));
        assert_eq!(add(3, 141, true).as_deref(), Some("2 of 4 members at up to n = 283; the errors of 1 are bounds"));
    }

    #[test]
    fn nobody_relaxed_is_said_so() {
        let text = overview(&Tally::default());
        assert!(text.contains("t_relax    none of 0 members reached it\n"), "{text}");
    }

    #[test]
    fn one_is_not_many() {
        let mut tally = Tally::default();
        tally.add(&outcome(0, Status::Relaxed, Some(0.3))).unwrap();
        assert!(overview(&tally).contains("over 1 member that reached it\n"), "{}", overview(&tally));
        tally.cells[0] = Default::default();
        tally.add(&outcome(0, Status::Unfinished, None)).unwrap();
        assert!(overview(&tally).contains("none of 1 member reached it\n"), "{}", overview(&tally));
        let one_thread = Platform { threads: Some(1), ..platform() };
        assert!(machine(&one_thread).contains(", 1 thread ("), "{}", machine(&one_thread));
        assert!(machine(&platform()).contains(", 2 threads ("), "{}", machine(&platform()));
    }

    #[test]
    fn differences_of_pairs_look_like_this() {
        let test = SignedRank { ranked: 510, statistic: 1e5, p_value: 1e-85, exact: false };
        let some = CellDifference {
            cell: 1,
            pairs: 512,
            equal: 2,
            median: Some(-1.25e-3),
            interval: Some((-1.5e-3, -1e-3)),
            test: Some(test),
            left_out: LeftOut { later: 0, earlier: 2, unknown: 1 },
        };
        let median =
            "median -0.001250 (95 % interval -0.001500 to -0.001000), p = 1.0e-85 over 512 pairs, 2 of them equal";
        let left_out = "; 3 left out, since a member did not relax (2 earlier, 1 of unknown order)";
        assert_eq!(paired(&some), format!("{median}{left_out}"));
        let equal = CellDifference { median: Some(0.0), test: None, left_out: LeftOut::default(), ..some.clone() };
        assert_eq!(paired(&equal), "equal in 512 pairs");
        let copies = CellDifference { pairs: 1, median: Some(0.5), ..equal.clone() };
        assert_eq!(paired(&copies), "0.5000 in 1 pair, not tested");
        assert_eq!(paired(&CellDifference { median: None, ..equal }), "in no pair both relaxed");
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
        assert_eq!(law(&of(Some(0.25), 5), "t_relax"), [format!("{holds}; chi2 = 12.50 (3), p = 0.25")]);
        let rejected = "median t_relax is no power of amplitude: chi2 = 12.50 (3), p = 1.0e-7; the nearest power is -0.2500, \
                        standard error 0.01000";
        assert_eq!(law(&of(Some(1e-7), 5), "t_relax"), [rejected]);
        assert_eq!(law(&of(None, 2), "t_relax"), [format!("{holds}; two cells do not test it")]);
        assert_eq!(law(&of(None, 4), "t_relax"), [format!("{holds}; without sampling errors it is not tested")]);
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
