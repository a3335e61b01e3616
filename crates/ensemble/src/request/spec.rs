//! The spec: everything that determines a run, under the names that flags and TOML keys share.
//!
//! A spec is read once ([`Spec::from_toml`]), overlaid with the flags by `cli`, and checked once ([`Spec::validate`],
//! in `validate.rs`). Everything after that relies on it.

use std::{fmt, io::ErrorKind, marker::PhantomData, path::Path, str::FromStr};

use serde::{
    Deserialize, Deserializer, Serialize, Serializer,
    de::{self, IgnoredAny},
};

use crate::{
    request::drawn::Drawn,
    request::event::Event,
    request::seed,
    request::shard::Shard,
    request::sweep::{self, Sweep},
};
use curvelax_backend::DeviceKind;
use curvelax_base::{
    error::{Error, Result, did_you_mean, echo, echo_path, expected_of, plainly, shortened},
    input,
    random::Design,
    text,
};
use curvelax_curve::{Interpolation, Modes, Perturbation, Sampling, Shape};
use curvelax_flow::{
    crystal::{Diffusivity, Energy},
    flow::Flow,
};

pub use crate::request::units::Units;
pub use curvelax_flow::{
    number::Precision,
    solver::{Order, Solver},
};

/// Where the members are advanced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackendChoice {
    /// A hardware GPU if there is one, else the CPU.
    Auto,
    /// A GPU, including software ones.
    Gpu,
    /// The CPU back end.
    Cpu,
}

impl From<DeviceKind> for BackendChoice {
    fn from(kind: DeviceKind) -> BackendChoice {
        match kind {
            DeviceKind::Cpu => BackendChoice::Cpu,
            DeviceKind::Gpu => BackendChoice::Gpu,
        }
    }
}

/// The requested solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SolverChoice {
    /// Gauss–Seidel with a fixed τ, as in the paper; the direct solver with adaptive steps, because sweeps get more
    /// numerous as steps grow.
    Auto,
    /// This one.
    Only(Solver),
}

impl SolverChoice {
    /// Names in flags and files: `auto`, then the solvers.
    pub const NAMES: [&str; 1 + Solver::NAMES.len()] = {
        let mut names = ["auto"; 1 + Solver::NAMES.len()];
        let mut i = 0;
        while i < Solver::NAMES.len() {
            names[1 + i] = Solver::NAMES[i];
            i += 1;
        }
        names
    };
}

impl From<Solver> for SolverChoice {
    fn from(solver: Solver) -> SolverChoice {
        SolverChoice::Only(solver)
    }
}

impl Serialize for SolverChoice {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            SolverChoice::Auto => serializer.serialize_str(SolverChoice::NAMES[0]),
            SolverChoice::Only(solver) => solver.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for SolverChoice {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        match name == SolverChoice::NAMES[0] {
            true => Ok(SolverChoice::Auto),
            false => Solver::named(&name, &SolverChoice::NAMES).map(SolverChoice::Only),
        }
    }
}

/// What moves the nodes: the right-hand side of the position equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PositionForm {
    /// The scheme's own curvatures and lengths, as in the paper.
    Paper,
    /// The force of the polygon itself; curvatures and lengths only make the matrix.
    Geometric,
    /// The one that is right for every curve: the paper's.
    Auto,
}

/// The fixed time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tau {
    /// τ itself.
    Step(f64),
    /// From each member's own relaxation time.
    Auto,
}

/// How time is cut into steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Steps of one length.
    Fixed(Tau),
    /// Extrapolated steps with this local error tolerance.
    Adaptive(f64),
}

/// ω of the redistribution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Omega {
    /// ω itself, in 1/time.
    Rate(f64),
    /// From each member's own relaxation time.
    Auto,
}

/// When a member ends at the latest.
#[derive(Clone, Debug, PartialEq)]
pub enum FinalTime {
    /// At this time.
    At(f64),
    /// When it is relaxed, or at the time that its cell's curve gives as a cap.
    Auto,
    /// For each cell of a sweep at its own time.
    OfCells(Vec<f64>),
}

/// κ of the metric pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pull {
    /// κ itself, in 1/time; 0 is the paper's scheme.
    Rate(f64),
    /// κ from each member's own relaxation time.
    Auto,
}

/// ω_SOR of the sweeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sor {
    /// The factor itself; 1 is the paper's.
    Factor(f64),
    /// From the stiffness of each system.
    Auto,
}

/// How snapshots are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Store {
    /// The table `snapshots.csv`.
    Csv,
    /// The arrays of `snapshots.zarr`.
    Zarr,
}

/// How tables are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tables {
    /// As CSV, from which a run is resumed, merged and drawn again.
    Csv,
    /// At the end of the run as Parquet, too.
    Parquet,
}

impl Tables {
    fn is_csv(&self) -> bool {
        *self == Tables::Csv
    }
}

/// A complete description of an ensemble and of the method that relaxes it.
///
/// `Default` is the paper's first example as an ensemble: 256 perturbed 2:1 ellipses under surface diffusion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Spec {
    /// Number of members; of outlines, copies of each.
    pub curves: u64,
    /// Number of outlines of the shape, if they are an ensemble; a study fills it in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub outlines: Option<u64>,
    /// Property of the outlines whose values are groups.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub group_by: Option<String>,
    /// Nodes per member, n.
    pub points: usize,
    /// Seed of the ensemble.
    #[serde(with = "seed")]
    pub seed: u64,
    /// The curve that is perturbed.
    pub shape: Drawn<Shape>,
    /// How nodes are placed on it.
    pub sampling: Sampling,
    /// How the curve runs between the points of an outline; a study of outlines fills it in.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub interpolate: Option<Interpolation>,
    /// Smallest radius of curvature of an outline's corners, as a share of its length, 0 to leave them; likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rounding: Option<f64>,
    /// σ of the random perturbation; 0 for none.
    pub amplitude: Drawn<f64>,
    /// Modes of the random perturbation.
    pub modes: Modes,
    /// p: mode m has standard deviation σ·m^-p.
    pub decay: Drawn<f64>,
    /// How a mode of the perturbation is drawn.
    #[serde(skip_serializing_if = "Perturbation::is_default")]
    pub perturbation: Perturbation,
    /// How members are spread over the distributions of shape, flow, amplitude and decay.
    #[serde(skip_serializing_if = "Design::is_random")]
    pub design: Design,
    /// The law of motion.
    pub flow: Drawn<Flow>,
    /// γ of the surface energy, if it depends on the direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<Drawn<Energy>>,
    /// M of the mobility along the surface, if it depends on the direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub diffusivity: Option<Drawn<Diffusivity>>,
    /// B of the flow in the user's units of length and time, in length⁴/time; 1 if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mobility: Option<f64>,
    /// The user's units of length and time, for the report and the axes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units: Option<Units>,
    /// Fixed time step; [`DEFAULT_TAU`] if neither it nor `adaptive` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tau: Option<Tau>,
    /// Local error tolerance of adaptive steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<f64>,
    /// Highest order of adaptive steps; if absent, that of the precision. Not a key: only
    /// The study of work and precision sets it, to measure what every order costs.
    #[serde(skip)]
    pub most_order: Option<u32>,
    /// Final time; [`DEFAULT_T_END`] if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub t_end: Option<FinalTime>,
    /// ω, speed of the redistribution towards equal spacing, in 1/time; if absent, that of the [pace](Spec::omega).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub omega: Option<Omega>,
    /// No tangential redistribution (α = 0).
    pub no_redistribution: bool,
    /// κ of the metric pull.
    pub pull: Pull,
    /// What moves the nodes; if absent, the paper's form, and of crystals the geometric one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form: Option<PositionForm>,
    /// Solver of the pentadiagonal systems.
    pub solver: SolverChoice,
    /// Order in which a sweep visits the nodes.
    pub order: Order,
    /// Residual tolerance of the sweeps, relative to the increment; depends on the precision if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Over-relaxation; 1 is plain Gauss–Seidel.
    pub sor: Sor,
    /// Sweeps per system after which a member is `stalled`.
    pub max_sweeps: u32,
    /// Where to run.
    pub backend: BackendChoice,
    /// Part of the name of the GPU adapter to use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adapter: Option<String>,
    /// Number type; if absent, f64 where the device has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub precision: Option<Precision>,
    /// A member is relaxed when its excess is at most this fraction of its start; [`DEFAULT_RELAX_TO`] if neither it
    /// nor `relax_at` is given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relax_to: Option<f64>,
    /// A member is relaxed when its excess is at most this.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relax_at: Option<f64>,
    /// End a member when it is relaxed; if absent, only with a [final time](FinalTime::Auto) that means just that.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stop_when_relaxed: Option<bool>,
    /// Run every member at coarser resolutions, too, and extrapolate its relaxation time.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub refine: bool,
    /// Total relative uncertainty of the median relaxation time to reach, by the choice of n, tolerance and members.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// Events of which each member's first time is found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub event: Vec<Event>,
    /// Interval between rows of `series.csv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<f64>,
    /// Times of the snapshots.
    #[serde(deserialize_with = "list")]
    pub snapshots: Vec<f64>,
    /// How snapshots are stored.
    pub store: Store,
    /// How tables are written.
    #[serde(skip_serializing_if = "Tables::is_csv")]
    pub tables: Tables,
    /// Run only these members.
    #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "some_list")]
    pub only: Option<Vec<u64>>,
    /// Of these, run only the ones in this shard.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shard: Option<Shard>,
    /// Threads of the CPU back end; all cores if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threads: Option<usize>,
    /// Draw member j of every cell from the same random numbers.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub common_random_numbers: bool,
    /// Keys that vary from cell to cell.
    #[serde(skip_serializing_if = "Sweep::is_empty")]
    pub sweep: Sweep,
    /// Keys that the request leaves out. Not a key.
    #[serde(skip)]
    pub omitted: OmittedKeys,
}

/// Keys that a request leaves out, of those whose default is another one for outlines: one copy of each, not perturbed.
#[derive(Clone, Copy, Default)]
pub struct OmittedKeys {
    /// There is no `curves`.
    pub curves: bool,
    /// There is no `amplitude`.
    pub amplitude: bool,
}

/// The same keys in a spec file.
#[derive(Deserialize)]
struct Given {
    curves: Option<IgnoredAny>,
    amplitude: Option<IgnoredAny>,
}

/// Equal specs look equal, too.
impl fmt::Debug for OmittedKeys {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("OmittedKeys")
    }
}

/// Equal specs have equal values, wherever these come from.
impl PartialEq for OmittedKeys {
    fn eq(&self, _: &OmittedKeys) -> bool {
        true
    }
}

/// The paper's time step.
pub const DEFAULT_TAU: f64 = 1e-3;
/// Keys that are times or rates.
const TIMED: [&str; 4] = ["tau", "t-end", "omega", "pull"];
/// The final time of the paper's first example.
pub const DEFAULT_T_END: f64 = 2.0;
/// The paper's ω.
pub const DEFAULT_OMEGA: f64 = 1.0;
/// Smallest radius of curvature of a corner, as a share of the length of its outline, if none is given. Nodes resolve it from
/// about 2/share on, 1000; a run adds up to 1600 by itself.
pub const DEFAULT_ROUNDING: f64 = 0.002;
/// Shares that can be asked for: below, nodes by the ten thousand would be needed; above, little would be left of an outline.
pub const ROUNDINGS: std::ops::RangeInclusive<f64> = 1e-4..=0.02;
/// Tolerance of `--adaptive` without a value.
pub const DEFAULT_ADAPTIVE: f64 = 1e-3;
/// Fraction of the initial excess at which a member is relaxed.
pub const DEFAULT_RELAX_TO: f64 = 0.01;

impl Default for Spec {
    fn default() -> Spec {
        Spec {
            curves: 256,
            outlines: None,
            group_by: None,
            points: 100,
            seed: 1,
            shape: Shape::Ellipse { a: 2.0, b: 1.0 }.into(),
            sampling: Sampling::Arclength,
            interpolate: None,
            rounding: None,
            amplitude: 0.05.into(),
            modes: Modes { low: 2, high: 8 },
            decay: 1.0.into(),
            perturbation: Perturbation::default(),
            design: Design::default(),
            flow: Flow::SurfaceDiffusion.into(),
            energy: None,
            diffusivity: None,
            mobility: None,
            units: None,
            tau: None,
            adaptive: None,
            most_order: None,
            t_end: None,
            omega: None,
            no_redistribution: false,
            pull: Pull::Rate(0.0),
            form: None,
            solver: SolverChoice::Auto,
            order: Order::Coloured,
            tolerance: None,
            sor: Sor::Factor(1.0),
            max_sweeps: 200_000,
            backend: BackendChoice::Auto,
            adapter: None,
            precision: None,
            relax_to: None,
            relax_at: None,
            stop_when_relaxed: None,
            refine: false,
            accuracy: None,
            event: Vec::new(),
            series: None,
            snapshots: Vec::new(),
            store: Store::Csv,
            tables: Tables::Csv,
            only: None,
            shard: None,
            threads: None,
            common_random_numbers: false,
            sweep: Sweep::default(),
            omitted: OmittedKeys::default(),
        }
    }
}

impl Spec {
    /// Reads a spec file; absent keys have their defaults.
    ///
    /// The result is not yet [validated](Spec::validate): flags may still replace wrong values.
    pub fn read(path: &Path) -> Result<Spec> {
        let text = input::text(path, input::MAX_SPEC).map_err(|e| {
            let problem = match e.kind() {
                ErrorKind::NotFound => "it does not exist; check its name and the folder".into(),
                _ => e.to_string(),
            };
            Error::Request(format!("cannot read the spec {}: {problem}", echo_path(path)))
        })?;
        Spec::from_toml(&text).map_err(|message| Error::Request(format!("in the spec {}: {message}", echo_path(path))))
    }

    /// Sets what `--accurate` stands for, except the keys that are `given` beside it.
    pub fn make_accurate(&mut self, given: &[String]) {
        let is_free = |key: &str| !given.iter().any(|given| given == key);
        if is_free("tau") && is_free("adaptive") && self.adaptive.is_none() {
            (self.adaptive, self.tau) = (Some(DEFAULT_ADAPTIVE), None);
        }
        if is_free("pull") {
            self.pull = Pull::Auto;
        }
        if is_free("omega") {
            self.omega = Some(Omega::Auto);
        }
        if is_free("t-end") {
            self.t_end = Some(FinalTime::Auto);
        }
        if is_free("stop-when-relaxed") {
            self.stop_when_relaxed = Some(true);
        }
        self.refine |= is_free("refine");
    }

    /// Parses the text of a spec file; absent keys have their defaults.
    ///
    /// ```
    /// use curvelax_ensemble::Spec;
    /// use curvelax_flow::flow::Flow;
    ///
    /// let spec = Spec::from_toml("flow = 'willmore'\ncurves = 8").unwrap();
    /// assert_eq!((spec.flow, spec.curves, spec.points), (Flow::Willmore.into(), 8, 100));
    /// assert!(Spec::from_toml("curvs = 8").unwrap_err().contains("did you mean `curves`?"));
    /// ```
    ///
    /// # Errors
    /// The message has toml's line and caret, and suggests the nearest valid spelling.
    pub fn from_toml(text: &str) -> Result<Spec, String> {
        // First, so that a large spec is in memory once. What is wrong is said below.
        let given = toml::from_str::<Given>(text).ok();
        let omitted = given.map_or(OmittedKeys::default(), |given| OmittedKeys {
            curves: given.curves.is_none(),
            amplitude: given.amplitude.is_none(),
        });
        let spec: Spec = toml::from_str(text).map_err(|e| format!("{}{}", told(&e), suggestion(e.message())))?;
        Ok(Spec { omitted, ..spec })
    }

    /// Returns the spec as TOML that [`Spec::from_toml`] reads back to the same spec.
    pub fn to_toml(&self) -> Result<String> {
        toml::to_string(self).map_err(|e| Error::Failed(format!("cannot write the spec as TOML: {e}")))
    }

    /// Names of all keys, in order.
    pub fn keys() -> Vec<String> {
        let refused = toml::from_str::<Spec>("\"\" = 0").expect_err("the empty key is unknown");
        quoted(refused.message()).skip(1).map(str::to_owned).collect()
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
        for (axis, value) in sweep.axes().iter().zip(sweep.values(index)) {
            // Keys that replace each other.
            match axis.key.as_str() {
                "tau" => drop(table.remove("adaptive")),
                "adaptive" => drop(table.remove("tau")),
                "relax-to" => drop(table.remove("relax-at")),
                "relax-at" => drop(table.remove("relax-to")),
                _ => {}
            }
            table.insert(axis.key.clone(), value.clone());
            // One key at a time, so that the message names the wrong one.
            Spec::deserialize(table.clone()).map_err(|e| {
                let (key, value) = (&axis.key, echo(sweep::label(value)));
                Error::Request(format!("--sweep {key}={value}: {}", expected_of(e.message().trim_end())))
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
        let times = matches!(tau, Some(Tau::Step(_))) || !matches!(t_end, None | Some(FinalTime::Auto));
        let rates = matches!(omega, Some(Omega::Rate(_))) || matches!(pull, Pull::Rate(rate) if *rate != 0.0);
        let swept = |key| self.sweep.has(key);
        let outputs = series.is_some() || !snapshots.is_empty();
        !(times || rates || outputs || TIMED.into_iter().any(swept))
    }

    /// Whether a member ends when it is relaxed.
    pub fn stops_when_relaxed(&self) -> bool {
        self.stop_when_relaxed.unwrap_or(self.t_end == Some(FinalTime::Auto))
    }

    /// ω in use: if none is given, the paper's where τ is a number, and otherwise each member's own.
    pub fn omega(&self) -> Omega {
        self.omega.unwrap_or(match self.pace() {
            Pace::Fixed(Tau::Step(_)) => Omega::Rate(DEFAULT_OMEGA),
            Pace::Fixed(Tau::Auto) | Pace::Adaptive(_) => Omega::Auto,
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

    /// Whether the force of the polygon moves the nodes. `auto` is the paper's form: the other one fails where nodes do not
    /// resolve the curve, and intervals of limits were calibrated with this one. For crystals there is no other.
    pub fn is_geometric(&self) -> bool {
        self.form == Some(PositionForm::Geometric) || self.has_crystals()
    }

    /// Whether energy or mobility depend on the direction.
    pub fn has_crystals(&self) -> bool {
        self.energy.is_some() || self.diffusivity.is_some()
    }

    /// The excess at which a member that starts with `excess` counts as relaxed.
    pub fn threshold(&self, excess: f64) -> f64 {
        self.relax_at.unwrap_or(self.relax_to.unwrap_or(DEFAULT_RELAX_TO) * excess)
    }

    /// The residual tolerance in use at `precision`.
    pub fn tolerance_at(&self, precision: Precision) -> f64 {
        self.tolerance.unwrap_or(precision.tolerance())
    }
}

/// The error for a list of final times that does not fit the sweep.
pub(crate) fn final_times(times: usize, cells: u64) -> Error {
    let problem =
        format!("a list has one time for each cell, and there {} {cells}", if cells == 1 { "is" } else { "are" });
    Error::value("t-end", format!("({times} times)"), &problem, "give one time, auto, or one for each cell")
}

/// Lines longer than this are not shown with a caret.
const MAX_LINE: usize = 300;
/// Maximum characters of a message; the list of all keys is half as long.
const MAX_SHOWN: usize = 1000;

/// What is wrong, with the line and a caret; for an overlong line, only where.
fn told(error: &toml::de::Error) -> String {
    let whole = error.to_string();
    let (whole, message) = (whole.trim_end(), error.message().trim_end());
    let problem = shortened(&plainly(message), MAX_SHOWN);
    match whole.strip_suffix(message) {
        Some(shown) if shown.lines().all(|line| line.len() <= MAX_LINE) => format!("{shown}{problem}"),
        _ => format!("{}: {problem}", shortened(whole.lines().next().unwrap_or_default(), MAX_LINE)),
    }
}

/// Suggests the nearest of the names that serde lists after "unknown field `x`, expected one of `a`, `b`".
fn suggestion(message: &str) -> String {
    let mut names = quoted(message);
    match names.next() {
        Some(word) if message.starts_with("unknown ") => did_you_mean(word, names),
        _ => String::new(),
    }
}

/// The parts of `text` between backticks.
fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// Reads and writes `$kind` as a number, `$kind::$number`, or as the word `auto`.
macro_rules! number_or_auto {
    ($kind:ident, $number:ident) => {
        impl FromStr for $kind {
            type Err = String;

            fn from_str(text: &str) -> Result<$kind, String> {
                match text.trim() {
                    "auto" => Ok($kind::Auto),
                    text => text
                        .parse()
                        .map($kind::$number)
                        .map_err(|_| format!("`{}` is neither a number nor `auto`", echo(text))),
                }
            }
        }

        impl fmt::Display for $kind {
            fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
                match self {
                    $kind::$number(number) => write!(f, "{}", text::number(*number)),
                    $kind::Auto => write!(f, "auto"),
                }
            }
        }

        impl FromNumbers for $kind {
            fn from_numbers(_: Vec<f64>) -> Option<$kind> {
                None
            }
        }

        impl From<f64> for $kind {
            fn from(number: f64) -> $kind {
                $kind::$number(number)
            }
        }

        impl Serialize for $kind {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self {
                    $kind::$number(number) => serializer.serialize_f64(*number),
                    $kind::Auto => serializer.serialize_str("auto"),
                }
            }
        }

        impl<'de> Deserialize<'de> for $kind {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<$kind, D::Error> {
                deserializer.deserialize_any(OrAuto(PhantomData))
            }
        }
    };
}

number_or_auto!(Tau, Step);
number_or_auto!(Omega, Rate);
number_or_auto!(Pull, Rate);
number_or_auto!(Sor, Factor);

impl fmt::Display for FinalTime {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            FinalTime::At(t) => write!(f, "{}", text::number(*t)),
            FinalTime::Auto => write!(f, "auto"),
            FinalTime::OfCells(times) => {
                let (low, high) =
                    times.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), t| (low.min(*t), high.max(*t)));
                write!(f, "{} to {}", text::number(low), text::number(high))
            }
        }
    }
}

impl FromStr for FinalTime {
    type Err = String;

    /// Parses a time, `auto`, or a list of times with commas between them.
    fn from_str(text: &str) -> Result<FinalTime, String> {
        let number = |word: &str| {
            let number = word.trim().parse::<f64>();
            number.map_err(|_| format!("`{}` is neither a number nor `auto`", echo(word.trim())))
        };
        match text.trim() {
            "auto" => Ok(FinalTime::Auto),
            list if list.contains(',') => list.split(',').map(number).collect::<Result<_, _>>().map(FinalTime::OfCells),
            word => number(word).map(FinalTime::At),
        }
    }
}

impl From<f64> for FinalTime {
    fn from(t: f64) -> FinalTime {
        FinalTime::At(t)
    }
}

impl Serialize for FinalTime {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            FinalTime::At(t) => serializer.serialize_f64(*t),
            FinalTime::Auto => serializer.serialize_str("auto"),
            FinalTime::OfCells(times) => times.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for FinalTime {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FinalTime, D::Error> {
        deserializer.deserialize_any(OrAuto(PhantomData))
    }
}

/// Kinds that may also be read from a list of numbers.
trait FromNumbers: Sized {
    /// The kind with these numbers, if it can have several.
    fn from_numbers(numbers: Vec<f64>) -> Option<Self>;
}

impl FromNumbers for FinalTime {
    fn from_numbers(numbers: Vec<f64>) -> Option<FinalTime> {
        Some(FinalTime::OfCells(numbers))
    }
}

struct OrAuto<T>(PhantomData<T>);

impl<'de, T: From<f64> + FromStr<Err = String> + FromNumbers> de::Visitor<'de> for OrAuto<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "a number or \"auto\"")
    }

    fn visit_f64<E: de::Error>(self, number: f64) -> Result<T, E> {
        Ok(number.into())
    }

    fn visit_i64<E: de::Error>(self, number: i64) -> Result<T, E> {
        Ok((number as f64).into())
    }

    fn visit_u64<E: de::Error>(self, number: u64) -> Result<T, E> {
        Ok((number as f64).into())
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
        text.parse().map_err(E::custom)
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<T, A::Error> {
        let mut numbers = Vec::new();
        while let Some(number) = items.next_element()? {
            numbers.push(number);
        }
        T::from_numbers(numbers).ok_or_else(|| de::Error::invalid_type(de::Unexpected::Seq, &"a number or \"auto\""))
    }
}

/// Reads a list: a TOML array, or the comma-separated text of a flag.
fn list<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr,
{
    deserializer.deserialize_any(ListVisitor(PhantomData))
}

fn some_list<'de, D, T>(deserializer: D) -> Result<Option<Vec<T>>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + FromStr,
{
    list(deserializer).map(Some)
}

struct ListVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de> + FromStr> de::Visitor<'de> for ListVisitor<T> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "an array of numbers, or numbers with commas between them in quotes")
    }

    fn visit_seq<A: de::SeqAccess<'de>>(self, mut items: A) -> Result<Vec<T>, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            list.push(item);
        }
        Ok(list)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Vec<T>, E> {
        let item = |word: &str| {
            word.trim()
                .parse()
                .map_err(|_| E::custom(format!("`{}` in `{}` is not a number of this list", echo(word), echo(text))))
        };
        text.split(',').map(item).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spec_reads_back_from_its_toml() {
        let spec = Spec {
            seed: u64::MAX,
            tau: Some(1e-300.into()),
            relax_at: Some(0.01),
            pull: Pull::Rate(0.1),
            omega: Some(Omega::Rate(0.1 + 0.2)),
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
            omega: Some(Omega::Auto),
            pull: Pull::Auto,
            sor: Sor::Auto,
            relax_to: Some(0.1),
            ..Spec::default()
        };
        let own = Spec { tau: Some(Tau::Auto), t_end: Some(FinalTime::Auto), ..Spec::default() };
        let drawn = Spec {
            shape: "ellipse:uniform(1.2..3),1".parse().unwrap(),
            flow: "elastic:lognormal(0.5,0.2)".parse().unwrap(),
            amplitude: "uniform(0.01..0.1)".parse().unwrap(),
            perturbation: Perturbation::Gaussian,
            design: Design::Sobol,
            ..Spec::default()
        };
        for spec in [spec, adaptive, own, drawn, Spec::default()] {
            let text = spec.to_toml().unwrap();
            assert_eq!(Spec::from_toml(&text).unwrap(), spec, "{text}");
        }
    }

    #[test]
    fn the_redistribution_is_the_papers_where_tau_is_a_number_and_otherwise_each_members_own() {
        let omega = |text: &str| Spec::from_toml(text).unwrap().validate().unwrap().omega;
        assert_eq!(omega(""), Some(Omega::Rate(1.0)));
        assert_eq!(omega("adaptive = 0.01"), Some(Omega::Auto));
        assert_eq!(omega("tau = 'auto'"), Some(Omega::Auto));
        assert_eq!(omega("tau = 0.01"), Some(Omega::Rate(1.0)));
        assert_eq!(omega("adaptive = 0.01\nomega = 1"), Some(Omega::Rate(1.0)));
        // Cells of a sweep choose for themselves.
        let swept = Spec::from_toml("[sweep]\nadaptive = [0.01]").unwrap().validate().unwrap();
        assert_eq!(swept.omega, None);
        assert_eq!(swept.of_cell(0).unwrap().validate().unwrap().omega, Some(Omega::Auto));
        let given = Spec::from_toml("omega = 2\n[sweep]\nadaptive = [0.01]").unwrap().validate().unwrap();
        assert_eq!(given.of_cell(0).unwrap().validate().unwrap().omega, Some(Omega::Rate(2.0)));
    }

    #[test]
    fn the_keys_are_those_of_the_default_spec_and_the_optional_ones() {
        let keys = Spec::keys();
        let written: toml::Table = toml::from_str(&Spec::default().to_toml().unwrap()).unwrap();
        assert!(written.keys().all(|key| keys.contains(key)));
        let optional = [
            "energy",
            "diffusivity",
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

    #[test]
    fn a_list_is_an_array_or_the_text_of_the_flag() {
        for text in ["snapshots = [0, 0.5]", "snapshots = '0,0.5'", "snapshots = '0, 0.5'"] {
            assert_eq!(Spec::from_toml(text).unwrap().snapshots, [0.0, 0.5], "{text}");
        }
        assert_eq!(Spec::from_toml("only = [3, 1]").unwrap().only, Some(vec![3, 1]));
        for text in ["snapshots = 1", "snapshots = '0,,1'", "snapshots = ['a']", "only = [1.5]", "only = [-1]"] {
            assert!(Spec::from_toml(text).is_err(), "{text}");
        }
    }

    #[test]
    fn of_a_line_without_end_only_the_place_is_told() {
        let long = "x".repeat(100_000);
        for (text, start) in [
            (format!("\nshape = '{long}'"), "TOML parse error at line 2, column 9: unknown shape `xxx"),
            (format!("{long} = 1"), "TOML parse error at line 1, column 1: unknown key `xxx"),
            (format!("a = {}", "[".repeat(100_000)), "TOML parse error at line 1, column 85: cannot recurse further"),
        ] {
            let message = Spec::from_toml(&text).unwrap_err();
            assert!(message.starts_with(start) && message.len() < 1200 && !message.contains('\n'), "{message}");
        }
    }

    #[test]
    fn a_wrong_key_or_word_is_shown_in_its_line_with_the_nearest_spelling() {
        let message = Spec::from_toml("curves = 3\nomga = 1\n").unwrap_err();
        for part in ["line 2, column 1", "2 | omga = 1", "^^^^", "unknown key `omga`", "did you mean `omega`?"] {
            assert!(message.contains(part), "no {part:?} in: {message}");
        }
        let message = Spec::from_toml("order = 'colored'").unwrap_err();
        assert!(message.contains("unknown value `colored`"), "{message}");
        assert!(message.contains("did you mean `coloured`?"), "{message}");
    }
}
