//! The spec: everything that determines a run, under the names that flags and TOML keys share.
//!
//! A spec is read once ([`Spec::from_toml`]), overlaid with the flags by `cli`, and checked once ([`Spec::validate`],
//! in `validate.rs`). Everything after that relies on it.

use std::fmt;

use serde::Deserialize;

use crate::request::sweep::{self, Sweep, SweepAxis};
use curvelax_base::error::{Error, Result, echo, expected_of, shortened};
use curvelax_curve::Interpolation;

pub use crate::request::{
    choices::{BackendChoice, FinalTime, OrAuto, Pace, PositionForm, SolverChoice, Store, Tables},
    key::{OmittedKeys, Spec, SpecKey, heading},
    units::Units,
};
use curvelax_flow::forcing::Conserved;
pub use curvelax_flow::{
    number::Precision,
    solver::{Order, Solver},
};

/// The paper's time step.
pub const DEFAULT_TAU: f64 = 1e-3;
/// Keys that are times or rates.
const TIMED: [&str; 4] = ["tau", "t-end", "omega", "pull"];
/// The final time of the paper's first example.
pub const DEFAULT_T_END: f64 = 2.0;
/// The paper's ω.
pub const DEFAULT_OMEGA: f64 = 1.0;
/// Smallest radius of curvature of a corner, as a share of the length of its outline, if none is given. Nodes resolve
/// it from about 2/share on, 1000; a run adds up to 1600 by itself.
pub const DEFAULT_ROUNDING: f64 = 0.002;
/// Shares that can be asked for: below, nodes by the ten thousand would be needed; above, little would be left of an
/// outline.
pub const ROUNDINGS: std::ops::RangeInclusive<f64> = 1e-4..=0.02;
/// Tolerance of `--adaptive` without a value.
pub const DEFAULT_ADAPTIVE: f64 = 1e-3;
/// Fraction of the initial excess at which a member is relaxed.
pub const DEFAULT_RELAX_TO: f64 = 0.01;

/// [`Spec::turns`] of curves that keep their length (`docs/internals/method.md#limit`).
const LENGTH_TURNS: f64 = 2.0;

impl Spec {
    /// Sets what `--accurate` stands for, except the keys that are `given` beside it.
    pub fn make_accurate(&mut self, given: &[String]) {
        let is_free = |key: &str| !given.iter().any(|given| given == key);
        if is_free("tau") && is_free("adaptive") && self.adaptive.is_none() {
            (self.adaptive, self.tau) = (Some(DEFAULT_ADAPTIVE), None);
        }
        if is_free("pull") {
            self.pull = OrAuto::Auto;
        }
        if is_free("omega") {
            self.omega = Some(OrAuto::Auto);
        }
        if is_free("t-end") {
            self.t_end = Some(FinalTime::Auto);
        }
        // The end of a vesicle is known only when it is reached.
        if is_free("stop-when-relaxed") && !self.has_vesicles() {
            self.stop_when_relaxed = Some(true);
        }
        self.refine |= is_free("refine");
    }

    /// Returns the spec of cell `index` of the sweep, not yet validated.
    ///
    /// # Errors
    /// [`Error::Request`] for a value that the key does not allow.
    pub fn of_cell(&self, index: u64) -> Result<Spec> {
        let failed = |e: &dyn fmt::Display| Error::Failed(format!("cannot write the spec as TOML: {e}"));
        // Lists are long and cannot be swept: they are copied separately.
        let Spec { snapshots, only, sweep, .. } = self;
        let short = Spec { sweep: Sweep::default(), snapshots: Vec::new(), only: None, ..self.clone() };
        let mut table = toml::Table::try_from(short).map_err(|e| failed(&e))?;
        for (key, value) in sweep.of_cell(index) {
            if let Some(other) = sweep::replaced_by(key) {
                table.remove(other);
            }
            table.insert(key.to_owned(), value.clone());
            // One key at a time, so that the message names the wrong one.
            Spec::deserialize(table.clone()).map_err(|e| {
                let (value, expected) = (echo(sweep::label(value)), expected_of(e.message().trim_end()));
                Error::Request(format!("--sweep {key}={value}: {expected}"))
            })?;
        }
        let mut spec = Spec::deserialize(table).map_err(|e| failed(&e))?;
        if let Some(FinalTime::OfCells(times)) = &spec.t_end {
            let own = usize::try_from(index).ok().and_then(|index| times.get(index));
            spec.t_end = Some(FinalTime::At(*own.ok_or_else(|| final_times(times.len(), sweep.cells()))?));
        }
        Ok(Spec { snapshots: snapshots.clone(), only: only.clone(), ..spec })
    }

    /// The indices of the members to run, ascending.
    pub fn members(&self) -> Box<dyn Iterator<Item = u64> + '_> {
        let (first, count) = self.shard.map_or((0, 1), |shard| (shard.index(), shard.count()));
        match &self.only {
            Some(only) => Box::new(only.iter().copied().filter(move |member| member % count == first)),
            None => {
                let step = usize::try_from(count).unwrap_or(usize::MAX);
                Box::new((first..self.all_members()).step_by(step))
            }
        }
    }

    /// Number of [`Spec::members`].
    pub fn member_count(&self) -> u64 {
        match (&self.only, self.shard) {
            (Some(only), None) => only.len() as u64,
            (Some(_), Some(_)) => self.members().count() as u64,
            (None, None) => self.all_members(),
            (None, Some(shard)) => self.all_members().saturating_sub(shard.index()).div_ceil(shard.count()),
        }
    }

    /// The rank of `member` among those that would run without shards.
    pub fn place(&self, member: u64) -> u64 {
        self.only.as_ref().map_or(member, |only| only.partition_point(|own| *own < member) as u64)
    }

    /// The first `count` members that would run without shards.
    pub(crate) fn first_members(&self, count: u64) -> Vec<u64> {
        match &self.only {
            Some(only) => only.iter().copied().take(usize::try_from(count).unwrap_or(usize::MAX)).collect(),
            None => (0..count.min(self.all_members())).collect(),
        }
    }

    /// Members of a cell, whether or not they run.
    pub fn members_per_cell(&self) -> u64 {
        self.curves.saturating_mul(self.outlines.unwrap_or(1))
    }

    /// Members of all cells, whether or not they run.
    pub fn all_members(&self) -> u64 {
        self.members_per_cell().saturating_mul(self.sweep.cells())
    }

    /// The first key, not among `but`, whose value differs in `other`: its name, the value here and the value there.
    pub fn difference(&self, other: &Spec, but: &[&str]) -> Option<(String, String, String)> {
        let [here, there] = [self, other].map(|spec| toml::Table::try_from(spec).unwrap_or_default());
        let shown = |value: Option<&toml::Value>| {
            value.map_or("unset".into(), |value| shortened(&value.to_string().replace('\n', " "), 60))
        };
        let keys = here.keys().chain(there.keys().filter(|key| !here.contains_key(*key)));
        let mut keys = keys.filter(|key| !but.contains(&key.as_str()));
        keys.find(|key| here.get(*key) != there.get(*key))
            .map(|key| (key.clone(), shown(here.get(key)), shown(there.get(key))))
    }

    /// How time is cut into steps.
    pub fn pace(&self) -> Pace {
        self.adaptive.map_or(Pace::Fixed(self.tau.unwrap_or(DEFAULT_TAU.into())), Pace::Adaptive)
    }

    /// How the curve runs between the points of an outline.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolate.unwrap_or_default()
    }

    /// Smallest radius of curvature of an outline's corners, as a share of its length.
    pub fn rounding(&self) -> f64 {
        self.rounding.unwrap_or(DEFAULT_ROUNDING)
    }

    /// B in use: the motion takes a time of 1/B where that of unit mobility takes 1.
    pub fn mobility(&self) -> f64 {
        self.mobility.unwrap_or(1.0)
    }

    /// The final time, the latest one of all cells; infinite while it is still [`FinalTime::Auto`], which a
    /// [study](crate::Study) replaces by numbers.
    pub fn final_time(&self) -> f64 {
        match &self.t_end {
            None => DEFAULT_T_END,
            Some(FinalTime::At(t)) => *t,
            Some(FinalTime::Auto) => f64::INFINITY,
            Some(FinalTime::OfCells(times)) => times.iter().copied().fold(0.0, f64::max),
        }
    }

    /// Whether it gives no number as a time or a rate: all of them may then be chosen by the size of the curve.
    pub(crate) fn gives_no_times(&self) -> bool {
        let Spec { tau, t_end, omega, pull, series, snapshots, .. } = self;
        let times = matches!(tau, Some(OrAuto::Number(_))) || !matches!(t_end, None | Some(FinalTime::Auto));
        let rates = matches!(omega, Some(OrAuto::Number(_))) || matches!(pull, OrAuto::Number(rate) if *rate != 0.0);
        let swept = |key| self.sweep.has(key);
        let outputs = series.is_some() || !snapshots.is_empty();
        !(times || rates || outputs || TIMED.into_iter().any(swept))
    }

    /// Whether a member ends when it is relaxed; one that is driven to a point ends there.
    pub fn stops_when_relaxed(&self) -> bool {
        self.stop_when_relaxed.unwrap_or(self.t_end == Some(FinalTime::Auto) && !self.keeps_both())
    }

    /// Whether both area and length are kept, in any cell.
    pub fn has_vesicles(&self) -> bool {
        let both = Conserved::AreaAndLength;
        let mut swept = self.sweep.axis("conserve").into_iter().flat_map(SweepAxis::labels);
        self.conserve == Some(both) || swept.any(|value| value.parse() == Ok(both))
    }

    /// Whether both are kept in cell `index` of the sweep: when such a member is relaxed is known only at its end.
    pub fn has_vesicles_in(&self, index: u64) -> bool {
        let of_cell = self.sweep.of_cell(index).find(|(key, _)| *key == "conserve");
        of_cell.map_or(self.conserve, |(_, value)| sweep::label(value).parse().ok()) == Some(Conserved::AreaAndLength)
    }

    /// Whether both area and length are kept, so that the end is no circle, and known only when it is reached.
    pub fn keeps_both(&self) -> bool {
        self.conserve == Some(Conserved::AreaAndLength) || self.sweep.has("conserve")
    }

    /// ω in use: if none is given, the paper's where τ is a number, and otherwise each member's own.
    pub fn omega(&self) -> OrAuto {
        self.omega.unwrap_or(match self.pace() {
            Pace::Fixed(OrAuto::Number(_)) => OrAuto::Number(DEFAULT_OMEGA),
            Pace::Fixed(OrAuto::Auto) | Pace::Adaptive(_) => OrAuto::Auto,
        })
    }

    /// The solver in use.
    pub fn solver(&self) -> Solver {
        match (self.solver, self.pace()) {
            (SolverChoice::Only(solver), _) => solver,
            (SolverChoice::Auto, Pace::Fixed(_)) => Solver::GaussSeidel,
            (SolverChoice::Auto, Pace::Adaptive(_)) => Solver::Direct,
        }
    }

    /// The over-relaxation in use: with fixed steps that of the paper.
    pub fn sor(&self) -> OrAuto {
        match (self.sor, self.pace()) {
            (Some(sor), _) => sor,
            (None, Pace::Fixed(_)) => OrAuto::Number(1.0),
            (None, Pace::Adaptive(_)) => OrAuto::Auto,
        }
    }

    /// Whether the force of the polygon moves the nodes. `auto` is the paper's form: the other one fails where nodes do
    /// not resolve the curve, and intervals of limits were calibrated with this one. For crystals and forced curves
    /// there is no other.
    pub fn is_geometric(&self) -> bool {
        self.form == Some(PositionForm::Geometric) || self.has_crystals() || self.is_forced()
    }

    /// Whether a force acts besides the flow, or something is kept.
    pub fn is_forced(&self) -> bool {
        self.drive.is_some() || self.conserve.is_some()
    }

    /// Whether energy or mobility depend on the direction.
    pub fn has_crystals(&self) -> bool {
        self.energy.is_some() || self.diffusivity.is_some()
    }

    /// How many times smaller than elsewhere the turn at a node must be to resolve a curve. The phase of a wave of γ
    /// and M turns m times as fast as the tangent, and that of the highest one must be resolved, too; where the length
    /// is kept, it is measured.
    pub(crate) fn turns(&self) -> f64 {
        if self.conserve.is_some_and(Conserved::keeps_length) {
            return LENGTH_TURNS;
        }
        self.highest_wave().unwrap_or(1).max(1).into()
    }

    /// The highest wave of γ and M.
    pub(crate) fn highest_wave(&self) -> Option<u32> {
        let energy = self.energy.as_ref().and_then(|of| of.typical().waves().highest_mode());
        let diffusivity = self.diffusivity.as_ref().and_then(|of| of.typical().waves().highest_mode());
        energy.max(diffusivity)
    }

    /// The excess at which a member that starts with `excess` counts as relaxed.
    pub fn threshold(&self, excess: f64) -> f64 {
        self.relax_at.unwrap_or(self.relax_to.unwrap_or(DEFAULT_RELAX_TO) * excess)
    }

    /// The residual tolerance in use at `precision`.
    pub fn tolerance_at(&self, precision: Precision) -> f64 {
        self.tolerance.unwrap_or(precision.tolerance(matches!(self.pace(), Pace::Adaptive(_))))
    }
}

/// The error for a list of final times that does not fit the sweep.
pub(crate) fn final_times(times: usize, cells: u64) -> Error {
    let problem =
        format!("a list has one time for each cell, and there {} {cells}", if cells == 1 { "is" } else { "are" });
    Error::value("t-end", format!("({times} times)"), &problem, "give one time, auto, or one for each cell")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Shard;
    use curvelax_base::random::Design;
    use curvelax_curve::Perturbation;
    use curvelax_flow::flow::Flow;

    #[test]
    fn a_spec_reads_back_from_its_toml() {
        let spec = Spec {
            seed: u64::MAX,
            tau: Some(1e-300.into()),
            relax_at: Some(0.01),
            pull: OrAuto::Number(0.1),
            omega: Some(OrAuto::Number(0.1 + 0.2)),
            flow: Flow::Polynomial(vec![0.5, 0.0, -0.25]).into(),
            precision: Some(Precision::F32),
            tolerance: Some(3e-4),
            event: vec!["convex = k_min >= 0".parse().unwrap(), "slow = excess <= 0.5 * start".parse().unwrap()],
            series: Some(0.01),
            snapshots: vec![0.0, 1.0 / 3.0],
            store: Store::Zarr,
            tables: Tables::Parquet,
            only: Some(vec![0, 200]),
            shard: Some(Shard::new(1, 3).unwrap()),
            ..Spec::default()
        };
        let adaptive = Spec {
            adaptive: Some(1e-3),
            omega: Some(OrAuto::Auto),
            pull: OrAuto::Auto,
            sor: Some(OrAuto::Auto),
            relax_to: Some(0.1),
            ..Spec::default()
        };
        let own = Spec { tau: Some(OrAuto::Auto), t_end: Some(FinalTime::Auto), ..Spec::default() };
        let drawn = Spec {
            shape: "ellipse:uniform(1.2..3),1".parse().unwrap(),
            flow: "elastic:lognormal(0.5,0.2)".parse().unwrap(),
            amplitude: "uniform(0.01..0.1)".parse().unwrap(),
            perturbation: Perturbation::Gaussian,
            design: Design::Sobol,
            ..Spec::default()
        };
        let driven = Spec { drive: Some("0.5".parse().unwrap()), ..Spec::default() };
        let fed_back = Spec { drive: Some("feedback:uniform(1..2),3".parse().unwrap()), ..Spec::default() };
        let kept = Spec {
            flow: Flow::Willmore.into(),
            conserve: Some(Conserved::AreaAndLength),
            conserve_at: Some(vec![3.0, 9.5]),
            reduced_area: Some("uniform(0.5..0.9)".parse().unwrap()),
            ..Spec::default()
        };
        for spec in [spec, adaptive, own, drawn, driven, fed_back, kept, Spec::default()] {
            let text = spec.to_toml().unwrap();
            assert_eq!(Spec::from_toml(&text).unwrap(), spec, "{text}");
        }
    }

    #[test]
    fn the_redistribution_is_the_papers_where_tau_is_a_number_and_otherwise_each_members_own() {
        let omega = |text: &str| Spec::from_toml(text).unwrap().validate().unwrap().omega;
        assert_eq!(omega(""), Some(OrAuto::Number(1.0)));
        assert_eq!(omega("adaptive = 0.01"), Some(OrAuto::Auto));
        assert_eq!(omega("tau = 'auto'"), Some(OrAuto::Auto));
        assert_eq!(omega("tau = 0.01"), Some(OrAuto::Number(1.0)));
        assert_eq!(omega("adaptive = 0.01\nomega = 1"), Some(OrAuto::Number(1.0)));
        // Cells of a sweep choose for themselves.
        let swept = Spec::from_toml("[sweep]\nadaptive = [0.01]").unwrap().validate().unwrap();
        assert_eq!(swept.omega, None);
        assert_eq!(swept.of_cell(0).unwrap().validate().unwrap().omega, Some(OrAuto::Auto));
        let given = Spec::from_toml("omega = 2\n[sweep]\nadaptive = [0.01]").unwrap().validate().unwrap();
        assert_eq!(given.of_cell(0).unwrap().validate().unwrap().omega, Some(OrAuto::Number(2.0)));
    }

    #[test]
    fn the_keys_are_those_of_the_default_spec_and_the_optional_ones() {
        let keys = Spec::keys();
        let written: toml::Table = toml::from_str(&Spec::default().to_toml().unwrap()).unwrap();
        assert!(written.keys().all(|key| keys.contains(key)));
        let optional = [
            "energy",
            "diffusivity",
            "drive",
            "conserve",
            "conserve-at",
            "reduced-area",
            "outlines",
            "group-by",
            "interpolate",
            "rounding",
            "mobility",
            "units",
            "tau",
            "adaptive",
            "t-end",
            "omega",
            "stop-when-relaxed",
            "relax-to",
            "relax-at",
            "tolerance",
            "sor",
            "adapter",
            "precision",
            "series",
            "tables",
            "event",
            "refine",
            "accuracy",
        ];
        let optional = [
            &optional[..],
            &["perturbation", "design", "form", "only", "shard", "threads", "common-random-numbers", "sweep"],
        ]
        .concat();
        for key in &optional {
            assert!(keys.iter().any(|known| known == key), "{key}");
        }
        assert_eq!(keys.len(), written.len() + optional.len());
    }
}
