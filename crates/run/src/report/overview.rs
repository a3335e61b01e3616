//! The table that a run prints at its end.

use std::{fmt, path::Path, time::Duration};

use super::words::{
    MAX_GROUP, chi, describe, errors, events, law, machine, member_name, member_time, paired, raw, significant, times,
    unit, unit_in_title, vanished, with_error,
};
use curvelax_base::{
    error::shortened,
    text::{count, duration, number, plural, rounded, rounded_beside},
};
use curvelax_ensemble::{Spec, Status};
use curvelax_files::names::{ENSEMBLE, GROUPS};
use curvelax_study::{
    placement::Platform,
    results::{
        cells::{CellStatistics, EnsembleStatistics, GroupStatistics, Rates},
        comparison::CellComparison,
        shortfall::Shortfall,
        tally::Tally,
        times::TimeStatistics,
    },
};

/// Maximum number of cells listed; the table has them all.
const MAX_CELLS: usize = 40;

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
        // The only cell, unless members are listed one by one.
        let only = match &self.statistics.cells[..] {
            [cell] if !self.spec.names_members() => Some(cell),
            _ => None,
        };
        let of_only = |text: &dyn Fn(&CellStatistics) -> String| only.map_or(String::new(), text);
        let [sampling, discretisation] = only.map_or_else(|| self.of_listed(), |cell| errors(cell, self.spec));
        self.statuses(f)?;
        writeln!(f)?;
        match self.spec.names_members() {
            true => self.members(f)?,
            false => self.cells(f)?,
        }
        self.groups(f)?;
        for (label, text) in [
            ("ensemble", shortened(&describe(self.spec), usize::MAX)),
            ("outlines", self.tally.supplement.mollified.outlines().unwrap_or_default()),
            ("rounding", self.tally.supplement.mollified.smoothing().unwrap_or_default()),
            (self.statistics.time(), of_only(&|cell| unit(self.spec) + &self.relaxed(cell))),
            ("t_relax", of_only(&|cell| self.limits_of(cell).map_or(String::new(), |times| raw(times, self.spec)))),
            ("sampling", sampling),
            ("resolution", discretisation),
            ("nodes", self.tally.nodes.in_words().unwrap_or_default()),
            ("t_error", self.tally.nodes.bounds_in_words().unwrap_or_default()),
            ("accuracy", self.accuracy()),
            ("rate", of_only(&rate)),
            ("t_vanish", of_only(&|cell| vanished(self.spec, cell).unwrap_or_default())),
        ]
        .into_iter()
        .chain(only.into_iter().flat_map(|cell| events(self.spec, cell)).map(|text| ("event", text)))
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
        let before = self.tally.relaxed_before_vanishing();
        for (rank, (status, count)) in self.tally.counts().enumerate() {
            if count > 0 || rank < 2 {
                let share = 100.0 * count as f64 / members.max(1) as f64;
                let before = match status {
                    Status::Vanished if before > 0 => format!("  {before} after relaxing"),
                    _ => String::new(),
                };
                writeln!(f, "{:<11}{count:>10}{share:>8.1} %{before}", status.name())?;
            }
        }
        writeln!(f, "{:<11}{members:>10}", "all")
    }

    /// When the members of a cell relaxed, and which of them the table of statuses counts as vanished.
    fn relaxed(&self, cell: &CellStatistics) -> String {
        let later = cell.relaxed_before_vanishing();
        let later = match later {
            0 => String::new(),
            _ if later == cell.members() => "; all of them vanished later".into(),
            _ => format!("; {later} of them vanished later"),
        };
        times(self.statistics.times(cell), self.limits_of(cell), "relaxed") + &later
    }

    /// The times of a cell of which limits are shown, if they are.
    fn limits_of<'b>(&self, cell: &'b CellStatistics) -> Option<&'b TimeStatistics> {
        Some(&cell.relaxing.times).filter(|_| self.statistics.of_limits)
    }

    /// What discretisation does to times of listed members that have no limits, in the cell where it does most.
    fn of_listed(&self) -> [String; 2] {
        let size = |cell: &&CellStatistics| cell.relaxing.discretisation.as_ref().map_or(0.0, |of| of.mean.abs());
        let cells = self.statistics.cells.iter().filter(|_| self.spec.names_members() && !self.statistics.of_limits);
        let Some(worst) = cells.max_by(|a, b| size(a).total_cmp(&size(b))) else { return Default::default() };
        let [_, text] = errors(worst, self.spec);
        let several = self.statistics.cells.len() > 1 && !text.is_empty();
        let name = if several { format!("{}: ", self.spec.sweep.name(worst.cell)) } else { String::new() };
        [String::new(), name + &text]
    }

    /// Each member with its time, where they are few and known by name.
    fn members(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let names: Vec<String> = self.tally.named.iter().map(|member| member_name(self.spec, member)).collect();
        let times: Vec<String> = self.tally.named.iter().map(|member| member_time(self.tally, member)).collect();
        let unit = unit_in_title(self.spec);
        let (time, error) = (self.statistics.time(), if self.statistics.of_limits { " ± t_error" } else { "" });
        let title = format!("{time}{error}{unit}");
        let by_points = self.tally.named.iter().any(|member| member.t_data_error.is_some());
        let of_points = |text: &str| if by_points { format!("{text:<12}  ") } else { String::new() };
        let wide = |all: &[String], title: &str| {
            all.iter().map(|text| text.chars().count()).fold(title.chars().count(), usize::max)
        };
        let (label, columns) = (wide(&names, "label"), wide(&times, &title));
        writeln!(f, "{:<11}{:<label$}  {title:<columns$}  {}status", "member", "label", of_points("t_data_error"))?;
        for ((member, name), time) in self.tally.named.iter().zip(&names).zip(&times) {
            let data = of_points(&member.t_data_error.map_or(String::new(), |error| rounded(error, 2)));
            write!(f, "{:<11}{name:<label$}  {time:<columns$}  {data}{}", member.member, member.status.name())?;
            match (member.t_vanish_limit.zip(member.t_vanish_error), member.t_vanish) {
                (Some((limit, error)), _) => write!(f, " at the limit {}", with_error(limit, error))?,
                (None, Some(t)) => write!(f, " at {}", significant(t))?,
                (None, None) => {}
            }
            for (event, t) in self.spec.event.iter().zip(&member.events) {
                write!(f, "  {} {}", event.name, t.map_or("not seen".into(), significant))?;
            }
            writeln!(f)?;
        }
        if self.statistics.of_limits {
            let what = "; t_data_error is how much the time changes if every second point of the outline is left out";
            let what = if by_points { what } else { "" };
            writeln!(f, "{:<11}± t_error is the half-width of the 95 % interval of t_limit{what}", "")?;
        }
        self.pairs(f)?;
        writeln!(f)
    }

    /// What `--accuracy` asked for, and what was reached in the cell that is farthest from it.
    fn accuracy(&self) -> String {
        // A shard has some of the members that it takes.
        let Some(goal) = self.spec.accuracy.filter(|_| self.spec.shard.is_none()) else { return String::new() };
        if let Some(lack) = Shortfall::of(self.spec, self.statistics) {
            return lack.in_words();
        }
        let what = if self.statistics.of_each { "each t_limit" } else { "the median" };
        let reached = rounded_beside(self.statistics.uncertainty(), goal);
        format!("the relative uncertainty of {what} is {reached} ({} requested)", number(goal))
    }

    /// One line per cell of a study, and how the cells compare.
    fn cells(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let EnsembleStatistics { cells, comparison, scaling, .. } = self.statistics;
        if cells.len() < 2 {
            return Ok(());
        }
        for cell in cells.iter().take(MAX_CELLS) {
            let (name, time) = (self.spec.sweep.name(cell.cell), self.statistics.time());
            let of_cell = self.relaxed(cell);
            writeln!(f, "{:<11}{name}: {time} {}{of_cell}", format!("cell {}", cell.cell), unit(self.spec))?;
            if self.statistics.of_limits && cell.relaxing.times.mean.is_some() {
                writeln!(f, "{:<11}t_relax {}", "", raw(&cell.relaxing.times, self.spec))?;
            }
            let errors: Vec<String> = errors(cell, self.spec).into_iter().filter(|text| !text.is_empty()).collect();
            if !errors.is_empty() {
                writeln!(f, "{:<11}{}", "", errors.join("; "))?;
            }
            if let Some(vanished) = vanished(self.spec, cell) {
                writeln!(f, "{:<11}t_vanish {vanished}", "")?;
            }
            events(self.spec, cell).try_for_each(|event| writeln!(f, "{:<11}{event}", ""))?;
        }
        more(f, cells.len(), "cell", ENSEMBLE)?;
        compared(f, comparison, "cells", "")?;
        self.pairs(f)?;
        for text in scaling.iter().flat_map(|of| law(of, self.statistics.time())) {
            writeln!(f, "{:<11}{text}", "power law")?;
        }
        writeln!(f)
    }

    /// How each cell differs from the first, if members are paired.
    fn pairs(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let comparison = &self.statistics.comparison;
        for (i, difference) in comparison.paired_cells().unwrap_or_default().iter().take(MAX_CELLS).enumerate() {
            if i == 0 {
                let time = self.statistics.time();
                writeln!(
                    f,
                    "{:<11}{time} compared with that of the same member of cell 0 (Wilcoxon signed-rank test):",
                    "pairs"
                )?;
            }
            writeln!(f, "{:<11}{}", format!("cell {}", difference.cell), paired(difference))?;
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
            let time = self.statistics.time();
            let (cell, times) = (cell(of.cell), times(self.statistics.times(of), self.limits_of(of), "relaxed"));
            writeln!(f, "{:<11}{property} {name}{cell}: {time} {}{times}", "group", unit(self.spec))?;
        }
        more(f, groups.len(), "group", GROUPS)?;
        for (rank, comparison) in (0..).zip(group_comparisons).take(MAX_CELLS) {
            compared(f, comparison, "groups", &cell(rank))?;
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
        let of = |total: u64, one: &str| {
            let each = each(total);
            format!("{each} {}", plural(if each == "1" { 1 } else { 2 }, one))
        };
        let solves_each = if solves == steps { String::new() } else { format!(" ({})", of(*solves, "solve")) };
        let sweeps = match sweeps_k + sweeps_x {
            0 => "without Gauss-Seidel sweeps".into(),
            _ => format!("with {} Gauss-Seidel sweeps for k and {} for x, y", each(*sweeps_k), each(*sweeps_x)),
        };
        let without = if self.spec.refine { "; runs at other resolutions are not counted" } else { "" };
        format!("each member took {}{solves_each} on average, {sweeps}{without}", of(*steps, "step"))
    }
}

/// The rates of a cell; empty if no member has one, or none relaxed.
fn rate(CellStatistics { rates: Rates { numbers, .. }, relaxing, .. }: &CellStatistics) -> String {
    let relaxed = relaxing.times.sample.events() > 0;
    let Some(median) = numbers.get("median").filter(|_| relaxed) else { return String::new() };
    let theory = numbers.get("ratio");
    let theory = theory.map_or(String::new(), |ratio| format!(", {} times that of linear theory", significant(ratio)));
    let fits = count(numbers.known as u64, "fit");
    format!("the median decay rate of the excess is {}{theory} ({fits})", significant(median))
}

/// Where those of `all` rows are that are not listed, if there are any.
fn more(f: &mut fmt::Formatter, all: usize, one: &str, table: &str) -> fmt::Result {
    match all.saturating_sub(MAX_CELLS) {
        0 => Ok(()),
        1 => writeln!(f, "{:<11}1 more {one} is in {table}", "..."),
        more => writeln!(f, "{:<11}{more} more {one}s are in {table}", "..."),
    }
}

/// Whether all of `what` could have one distribution, or why that is not known.
fn compared(f: &mut fmt::Formatter, of: &CellComparison, what: &str, of_cell: &str) -> fmt::Result {
    if let Some(test) = of.log_rank() {
        writeln!(f, "{what:<11}log-rank test that all {what} have the same distribution{of_cell}: {}", chi(test))?;
    }
    of.refusal().map_or(Ok(()), |why| writeln!(f, "{what:<11}not compared{of_cell}: {why}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use curvelax_ensemble::{Outcome, Status};
    use curvelax_files::names;
    use curvelax_statistics::Limit;
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

ensemble   ellipse:2,1, surface-diffusion, amplitude 0.05, n = 100, tau = 0.001, t-end = 2, seed 1
t_relax    median 0.5000 (range of all 4, 0.3000 or more, which contains the median with probability 93.8 %), mean at least 1.200 (standard error 0.4016) over 2 members that relaxed; 2 censored
sampling   the interval of the median is open: too few members relaxed
resolution the error of discretisation is unknown: no member relaxed with each of n, n/√2 and n/2 nodes
work       each member took 10 steps on average, with 20 Gauss-Seidel sweeps for k and 5 for x, y
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
            text.lines().find(|line| line.starts_with("resolution")).unwrap().to_string()
        };
        let about = "discretisation makes t_relax 2 % ± 0.0098 % too short (estimated from 4 members)";
        let some = told(&tally);
        assert!(
            some.ends_with(&format!(
                "{about}; the order of convergence of 1 of 4 members is not steady yet: use --refine, or more --points"
            )),
            "{some}"
        );
        tally.cells[0].relaxing.judged.iter_mut().for_each(|limit| limit.asymptotic = true);
        // Sampling is the larger one here.
        assert!(told(&tally).ends_with(about), "{}", told(&tally));
        tally.cells[0].relaxing.judged.iter_mut().for_each(|limit| limit.relative = -0.2);
        assert!(told(&tally).ends_with("; --accurate removes this error"), "{}", told(&tally));
    }

    #[test]
    fn a_median_of_zero_has_no_relative_error() {
        let mut tally = Tally::default();
        (0..4).for_each(|member| tally.add(&outcome(member, Status::Relaxed, Some(0.0))).unwrap());
        let text = overview(&tally);
        assert!(
            text.contains("\nresolution the error of discretisation is unknown") && !text.contains("\nsampling"),
            "{text}"
        );
    }

    #[test]
    fn members_that_needed_more_nodes_are_counted() {
        let spec = Spec { refine: true, ..Spec::default() };
        let mut tally = Tally::of(&spec, &curvelax_ensemble::LevelTimes::default());
        let nodes = |tally: &Tally| {
            let text = overview(tally);
            ["nodes      ", "t_error    "]
                .map(|label| text.lines().find_map(|line| Some(line.strip_prefix(label)?.into())))
        };
        let mut add = |member: u64, points: u64, asymptotic: bool| {
            let judged = Some(Limit { t: 0.5, error: 1e-4, fixed: 0.0, order: None, asymptotic, relative: 0.0 });
            let outcome = outcome(member, Status::Relaxed, Some(0.5));
            tally.add(&Outcome { judged, points, is_finer: points > 100, ..outcome }).unwrap();
            nodes(&tally)
        };
        let bound = |all: u64| {
            Some(format!("is a cautious bound for 1 of {all} members: their order of convergence is not steady yet"))
        };
        let more =
            |finer: u64, all: u64| Some(format!("{finer} of {all} members needed more nodes for t_limit, up to 283"));
        assert_eq!(add(0, 100, true), [None, None]);
        assert_eq!(add(1, 100, false), [None, bound(2)]);
        assert_eq!(add(2, 283, true), [more(1, 3), bound(3)]);
        assert_eq!(add(3, 141, true), [more(2, 4), bound(4)]);
    }

    #[test]
    fn an_overview_says_that_no_member_relaxed() {
        let text = overview(&Tally::default());
        assert!(text.contains("t_relax    none of 0 members relaxed\n"), "{text}");
    }

    #[test]
    fn one_is_not_many() {
        let mut tally = Tally::default();
        tally.add(&outcome(0, Status::Relaxed, Some(0.3))).unwrap();
        assert!(overview(&tally).contains("over 1 member that relaxed\n"), "{}", overview(&tally));
        tally.cells[0] = Default::default();
        tally.add(&outcome(0, Status::Unfinished, None)).unwrap();
        assert!(overview(&tally).contains("none of 1 member relaxed\n"), "{}", overview(&tally));
        let one_thread = Platform { threads: Some(1), ..platform() };
        assert!(machine(&one_thread).contains(", 1 thread ("), "{}", machine(&one_thread));
        assert!(machine(&platform()).contains(", 2 threads ("), "{}", machine(&platform()));
    }
}
