//! Range checks of a [`Spec`]: each number alone, then the combinations that make no sense.
//!
//! The shape, the sampling and the perturbation are checked where they are built (`Family::new`), because that needs
//! the file of the shape. Only the resolution of the highest mode is checked here.

mod forces;
mod times;

use std::ops::RangeInclusive;

use crate::request::event::{Event, MAX_EVENTS};
use crate::request::spec::{
    BackendChoice, DEFAULT_RELAX_TO, DEFAULT_T_END, FinalTime, OrAuto, Order, Pace, PositionForm, Precision, ROUNDINGS,
    Spec, Store,
};
use curvelax_base::{
    error::{Error, Result},
    text::{count, number},
};
use curvelax_flow::solver::{Facts, ring::MIN_POINTS};

/// More members than this are a typing error.
const MAX_CURVES: u64 = 1_000_000_000;
const MAX_POINTS: u64 = 1_000_000;
/// A member with more steps than this would need more than a year.
pub(crate) const MAX_STEPS: f64 = 1e9;
/// Final times whose smallest part in a table, and whose sum over all members, can still be represented.
const TIMES: RangeInclusive<f64> = 1e-300..=1e300;
/// Mobilities with which times, fourth powers of lengths over them, stay finite.
const MOBILITIES: RangeInclusive<f64> = 1e-100..=1e100;
/// Keys that are chosen for an uncertainty.
const CHOSEN: [&str; 3] = ["points", "tau", "adaptive"];
/// Keys with which the force of the polygon moves the nodes.
const GEOMETRIC: [&str; 4] = ["energy", "diffusivity", "drive", "conserve"];
/// Uncertainties of a median that members by the million, at a thousand nodes, can reach.
const ACCURACIES: RangeInclusive<f64> = 1e-5..=0.5;
const MAX_SNAPSHOTS: usize = 10_000;
/// The rows of a resident member stay in memory until it ends, at four numbers each.
const MAX_SNAPSHOT_ROWS: usize = 100_000_000;
/// The lengths approach their mean explicitly, by a factor 1 - ωτ per step.
pub(crate) const MAX_OMEGA_TAU: f64 = 1.0;
/// A sweep residual above this no longer says that a system is solved.
const LOOSEST_TOLERANCE: f64 = 0.1;
const MAX_SWEEPS: u64 = 100_000_000;
const MAX_THREADS: u64 = 1024;

impl Spec {
    /// Checks all ranges and combinations, and returns the spec with its lists sorted and without duplicates.
    pub fn validate(mut self) -> Result<Spec> {
        self.sweep.check(&Spec::keys(), Spec::is_common)?;
        self.check_counts()?;
        self.check_accuracy()?;
        self.check_mobility()?;
        self.check_times()?;
        self.check_method()?;
        self.check_drawn()?;
        self.check_crystals()?;
        self.check_forcing()?;
        self.check_rounding()?;
        self.check_relaxation()?;
        self.check_combinations()?;
        self.check_events()?;
        self.fill_defaults();
        self.tidy_snapshots()?;
        self.tidy_only()?;
        self.check_shard()?;
        Ok(self)
    }

    /// Does the same with the spec of a cell whose members, an index in the cell each, were checked with those of all.
    pub(crate) fn validate_alone(mut self) -> Result<Spec> {
        let (only, shard) = (self.only.take(), self.shard.take());
        Ok(Spec { only, shard, ..self.validate()? })
    }

    /// Fills in the choices left open, so that a printed spec shows them.
    fn fill_defaults(&mut self) {
        if let Pace::Fixed(tau) = self.pace() {
            self.tau = Some(tau);
        }
        // Whether steps adapt may differ between cells, and with it the default.
        if !["tau", "adaptive"].into_iter().any(|key| self.sweep.has(key)) {
            self.omega = Some(self.omega());
        }
        self.t_end.get_or_insert(DEFAULT_T_END.into());
        if self.stops_when_relaxed() {
            self.stop_when_relaxed = Some(true);
        } else if self.t_end == Some(FinalTime::Auto) && self.sweep.has("conserve") {
            // Cells that keep both must not differ in it from others.
            self.stop_when_relaxed = Some(false);
        }
        if self.relax_at.is_none() {
            self.relax_to.get_or_insert(DEFAULT_RELAX_TO);
        }
        if self.has_crystals() || self.is_forced() {
            self.form = Some(PositionForm::Geometric);
        } else if self.form == Some(PositionForm::Paper) && !GEOMETRIC.into_iter().any(|key| self.sweep.has(key)) {
            self.form = None;
        }
    }

    fn check_counts(&self) -> Result<()> {
        let members = self.all_members();
        if self.curves > 0 && self.curves <= MAX_CURVES && members > MAX_CURVES {
            let cells = count(self.sweep.cells(), "cell");
            let outlines = self.outlines.map_or(String::new(), |outlines| format!(" of {outlines} outlines"));
            let problem = format!("{cells}{outlines} make {members} members, too many");
            return Err(Error::value("curves", self.curves, &problem, &format!("at most {MAX_CURVES} in all")));
        }
        check_count("curves", self.curves, 1..=MAX_CURVES, ["an ensemble needs a member", "too many members"])?;
        let points = MIN_POINTS as u64..=MAX_POINTS;
        check_count("points", self.points as u64, points, ["the scheme needs 6 nodes", "too many nodes"])?;
        let threads = self.threads.map_or(1, |threads| threads as u64);
        check_count("threads", threads, 1..=MAX_THREADS, ["no thread to run on", "too many threads"])
    }

    fn check_accuracy(&self) -> Result<()> {
        let Some(goal) = self.accuracy else { return Ok(()) };
        let one = "leave out one of the two";
        let (problem, allowed) = match () {
            () if !self.refine => {
                ("the error of discretisation is known only with --refine", "add --accurate, or --refine".into())
            }
            () if CHOSEN.into_iter().any(|key| self.sweep.has(key)) => {
                ("it chooses n and the steps, and a sweep of points, tau or adaptive does, too", one.into())
            }
            () if self.only.is_some() => ("the members are chosen by it, and --only chooses them, too", one.into()),
            () if !ACCURACIES.contains(&goal) => {
                let (low, high) = (number(*ACCURACIES.start()), number(*ACCURACIES.end()));
                ("not a relative uncertainty that can be reached", format!("use a number from {low} to {high}"))
            }
            () => return Ok(()),
        };
        Err(Error::value("accuracy", number(goal), problem, &allowed))
    }

    fn check_mobility(&self) -> Result<()> {
        let Some(mobility) = self.mobility else { return Ok(()) };
        positive("mobility", mobility, "a mobility in length^4/time", "1")?;
        match MOBILITIES.contains(&mobility) {
            true => Ok(()),
            false => {
                let allowed = format!("use a number from {:e} to {:e}", MOBILITIES.start(), MOBILITIES.end());
                Err(Error::value("mobility", number(mobility), "times in this unit are not finite", &allowed))
            }
        }
    }

    fn check_omega(&self) -> Result<()> {
        let OrAuto::Number(omega) = self.omega() else { return Ok(()) };
        if !(omega.is_finite() && omega >= 0.0) {
            let allowed = "use 0, a positive number such as 1, or auto";
            return Err(Error::value("omega", number(omega), "not a redistribution speed", allowed));
        }
        if self.no_redistribution {
            return Ok(());
        }
        match self.pace() {
            Pace::Fixed(OrAuto::Number(tau)) if omega * tau > MAX_OMEGA_TAU => {
                let allowed = format!("it is a rate: use --omega {} or less", number(1.0 / tau));
                Err(Error::value("omega", number(omega), &overshooting(omega, tau), &allowed))
            }
            Pace::Adaptive(_) => match self.known_end() {
                Some(t_end) if omega * t_end > MAX_STEPS => {
                    let problem =
                        format!("adaptive steps are at most about 1/omega long, and --t-end is {}", number(t_end));
                    let allowed = format!("use --omega {} or less, or an earlier --t-end", number(MAX_STEPS / t_end));
                    Err(Error::value("omega", number(omega), &problem, &allowed))
                }
                _ => Ok(()),
            },
            Pace::Fixed(_) => Ok(()),
        }
    }

    fn check_pull(&self) -> Result<()> {
        let OrAuto::Number(rate) = self.pull else { return Ok(()) };
        if !(rate.is_finite() && rate >= 0.0) {
            let allowed = "use 0 for the paper's scheme, a positive number, or auto";
            return Err(Error::value("pull", number(rate), "not a rate", allowed));
        }
        Ok(())
    }

    fn check_method(&self) -> Result<()> {
        self.check_omega()?;
        self.check_pull()?;
        if let Some(tolerance) = self.tolerance
            && !(tolerance > 0.0 && tolerance <= LOOSEST_TOLERANCE)
        {
            let allowed = format!("use a number above 0, up to {LOOSEST_TOLERANCE}, for example 1e-5");
            return Err(Error::value("tolerance", number(tolerance), "not a residual tolerance", &allowed));
        }
        if let Some(OrAuto::Number(factor)) = self.sor
            && !(factor > 0.0 && factor < 2.0)
        {
            let problem = "sweeps do not converge with this over-relaxation";
            let allowed = "use a number between 0 and 2, both excluded, or auto; 1 is plain Gauss-Seidel";
            return Err(Error::value("sor", number(factor), problem, allowed));
        }
        let sweeps = self.max_sweeps.into();
        check_count("max-sweeps", sweeps, 1..=MAX_SWEEPS, ["no sweep to solve with", "too many sweeps"])?;
        let resolved = self.points / 4;
        if let Some(mode) = self.highest_mode()
            && mode as usize > resolved
        {
            let problem = format!("{} nodes resolve no mode above {resolved}", self.points);
            let allowed = format!("use --points {} or more, or lower modes", 4 * u64::from(mode));
            return Err(Error::value("shape", &self.shape, &problem, &allowed));
        }
        if self.amplitude != 0.0.into() && self.modes.high as usize > resolved {
            let modes = String::from(self.modes);
            let problem = format!("{} nodes resolve no mode above {resolved}", self.points);
            let allowed = format!("use --points {} or more, or lower modes", 4 * u64::from(self.modes.high));
            return Err(Error::value("modes", modes, &problem, &allowed));
        }
        Ok(())
    }

    fn check_rounding(&self) -> Result<()> {
        match self.rounding {
            Some(share) if share != 0.0 && !ROUNDINGS.contains(&share) => {
                let (low, high) = (number(*ROUNDINGS.start()), number(*ROUNDINGS.end()));
                let allowed = format!("use a share from {low} to {high}, or 0 to leave corners");
                Err(Error::value("rounding", number(share), "not a radius as a share of the length", &allowed))
            }
            _ => Ok(()),
        }
    }

    fn check_relaxation(&self) -> Result<()> {
        match (self.relax_to, self.relax_at) {
            (Some(_), Some(excess)) => {
                let problem = "a member is relaxed at a fraction of its excess or at an excess";
                Err(Error::value("relax-at", number(excess), problem, "leave out --relax-to or --relax-at"))
            }
            (Some(fraction), None) if !(fraction > 0.0 && fraction < 1.0) => {
                let allowed = "use a number between 0 and 1, both excluded, for example 0.01";
                Err(Error::value("relax-to", number(fraction), "not a fraction of the initial excess", allowed))
            }
            (None, Some(excess)) => positive("relax-at", excess, "an excess", "0.01"),
            _ => Ok(()),
        }
    }

    fn check_combinations(&self) -> Result<()> {
        let lexicographic = self.order == Order::Lexicographic;
        self.check_sweeps()?;
        if self.store == Store::Zarr && self.snapshots.is_empty() {
            let allowed = "add --snapshots T1,T2,..., or leave out --store";
            return Err(Error::value("store", "zarr", "there are no snapshots to store", allowed));
        }
        if self.backend == BackendChoice::Gpu {
            let cpu = "use --backend cpu";
            if lexicographic {
                let problem = "a GPU sweeps colour by colour only";
                return Err(Error::value("order", "lexicographic", problem, cpu));
            }
        }
        match &self.adapter {
            Some(name) if self.backend == BackendChoice::Cpu => {
                let allowed = "leave out --adapter, or use --backend gpu";
                Err(Error::value("adapter", name, "the CPU back end uses no adapter", allowed))
            }
            Some(name) if name.trim().is_empty() => {
                Err(Error::value("adapter", "''", "an empty name", "see `curvelax adapters` for the names"))
            }
            _ => Ok(()),
        }
    }

    /// Refuses options that the solver does not have: the direct one makes no sweeps.
    fn check_sweeps(&self) -> Result<()> {
        let default = Spec::default();
        let asked = [
            (self.order != default.order).then(|| ("order", "lexicographic".to_string())),
            self.tolerance.map(|tolerance| ("tolerance", number(tolerance))),
            // Folders of earlier versions name the paper's factor whatever the solver.
            self.sor.filter(|sor| *sor != OrAuto::Number(1.0)).map(|sor| ("sor", sor.to_string())),
            (self.max_sweeps != default.max_sweeps).then(|| ("max-sweeps", self.max_sweeps.to_string())),
        ];
        let Facts { refuses, refuses_because: problem, .. } = *self.solver().facts();
        match asked.into_iter().flatten().find(|(key, _)| refuses.contains(key)) {
            None => Ok(()),
            Some((key, value)) => {
                let allowed = format!("leave out --{key}, or use --solver gauss-seidel");
                Err(Error::value(key, value, problem, &allowed))
            }
        }
    }

    fn check_events(&self) -> Result<()> {
        let (events, count) = (&self.event, self.event.len());
        if count > MAX_EVENTS {
            let value = format!("({count} events)");
            return Err(Error::value("event", value, "too many events", &format!("at most {MAX_EVENTS}")));
        }
        let twice = |(i, event): (usize, &Event)| events[..i].iter().any(|other| other.name == event.name);
        match events.iter().enumerate().find(|at| twice(*at)) {
            Some((_, event)) => Err(Error::value("event", event, "another event has this name", "use another name")),
            None => Ok(()),
        }
    }

    fn tidy_snapshots(&mut self) -> Result<()> {
        let t_end = self.known_end().unwrap_or(*TIMES.end());
        if let Some(&t) = self.snapshots.iter().find(|t| !(**t >= 0.0 && **t <= t_end)) {
            let allowed = match self.known_end() {
                Some(t_end) => format!("use times from 0 to --t-end {}", number(t_end)),
                None => "use times from 0 on".into(),
            };
            return Err(Error::value("snapshots", number(t), "not a time of the run", &allowed));
        }
        self.snapshots.iter_mut().for_each(|t| *t += 0.0); // -0 becomes 0
        self.snapshots.sort_by(f64::total_cmp);
        self.snapshots.dedup();
        let (times, rows) = (self.snapshots.len(), self.snapshots.len().saturating_mul(self.points));
        let refused =
            |problem: &str, allowed: &str| Err(Error::value("snapshots", format!("({times} times)"), problem, allowed));
        if times > MAX_SNAPSHOTS {
            return refused("too many times", &format!("at most {MAX_SNAPSHOTS}"));
        }
        if rows > MAX_SNAPSHOT_ROWS {
            let allowed = format!("at most {MAX_SNAPSHOT_ROWS}: use fewer times, or fewer --points");
            return refused(&format!("{rows} rows per member"), &allowed);
        }
        Ok(())
    }

    fn tidy_only(&mut self) -> Result<()> {
        let members = self.all_members();
        let Some(only) = &mut self.only else { return Ok(()) };
        if only.is_empty() {
            return Err(Error::value("only", "[]", "no member to run", "name at least one, or leave the key out"));
        }
        if let Some(member) = only.iter().find(|member| **member >= members) {
            let problem = format!("no such member among {members}");
            return Err(Error::value("only", member, &problem, &format!("use members from 0 to {}", members - 1)));
        }
        only.sort_unstable();
        only.dedup();
        Ok(())
    }

    fn check_shard(&self) -> Result<()> {
        match self.shard {
            Some(shard) if self.member_count() == 0 => {
                let members = self.only.as_ref().map_or(self.all_members(), |only| only.len() as u64);
                let problem = format!("none of the {members} members to run belongs to it");
                Err(Error::value("shard", shard, &problem, "use fewer shards, or leave this one out"))
            }
            _ => Ok(()),
        }
    }
}

/// The smallest tolerance of adaptive steps whose errors are not all rounding.
pub(crate) fn tightest_adaptive(precision: Precision) -> f64 {
    match precision {
        Precision::F32 => 1e-5,
        Precision::F64 => 1e-8,
    }
}

/// The problem of a redistribution that is too fast for fixed steps.
pub(crate) fn overshooting(omega: f64, tau: f64) -> String {
    format!("omega tau = {}, and the redistribution overshoots above {MAX_OMEGA_TAU}", number(omega * tau))
}

/// Checks a number of things, with what is said of too few and too many.
fn check_count(key: &str, count: u64, allowed: RangeInclusive<u64>, [few, many]: [&str; 2]) -> Result<()> {
    if allowed.contains(&count) {
        return Ok(());
    }
    let problem = if count < *allowed.start() { few } else { many };
    Err(Error::value(key, count, problem, &format!("use {} to {}", allowed.start(), allowed.end())))
}

fn positive(key: &str, value: f64, what: &str, example: &str) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    let allowed = format!("use a finite number above 0, for example {example}");
    Err(Error::value(key, number(value), &format!("not {what}"), &allowed))
}

#[cfg(test)]
mod tests;
