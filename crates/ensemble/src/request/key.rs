//! The keys of a spec, each in one place: its name in spec files and as a flag, its type, its default, and its help.
//!
//! A new key is a line of the table below. Flags, their help, docs/flags.md, the keywords of Python and the swept keys
//! follow; [`Spec::validate`] checks its range, and whoever needs its value asks the [`Spec`].

use std::{fmt, sync::LazyLock};

use serde::{Deserialize, Serialize};

use super::{
    choices::{
        BackendChoice, FinalTime, OrAuto, PositionForm, SolverChoice, Store, Tables, list, some_list, some_numbers,
    },
    drawn::Drawn,
    event::Event,
    seed,
    shard::Shard,
    sweep::Sweep,
    units::Units,
    value::{Takes, Value},
};
use curvelax_base::random::Design;
use curvelax_curve::{Interpolation, Modes, Perturbation, Sampling, Shape};
use curvelax_flow::{
    crystal::{Diffusivity, Energy},
    flow::Flow,
    forcing::{Conserved, Drive},
    number::Precision,
    solver::Order,
};

/// A key, as far as a flag must know it.
#[derive(Debug)]
pub struct SpecKey {
    /// Its name in spec files, which is that of its flag.
    pub name: String,
    /// What stands for its value in the help.
    pub value: &'static str,
    /// The heading of the help under which it stands.
    pub heading: &'static str,
    /// What it does, over several lines, with its default in brackets at the end.
    help: &'static str,
    /// What its flag takes.
    pub takes: Takes,
    /// What its flag means without a value, if that is allowed.
    pub missing: Option<&'static str>,
    /// Whether it is the same in every cell: it cannot be swept.
    is_common: bool,
    /// Whether one word can be its value, or a part of it; else what is wrong with it.
    pub check: fn(&str) -> Result<(), String>,
    /// Replaces its value by that of the words of its flag.
    pub set: fn(&mut Spec, &[String]) -> Result<(), String>,
}

impl SpecKey {
    /// What it does, with its default in brackets at the end.
    pub fn help(&self) -> String {
        self.help.lines().map(str::trim).collect::<Vec<_>>().join(" ")
    }
}

/// The headings of the help.
pub mod heading {
    /// Which curves.
    pub const ENSEMBLE: &str = "Ensemble";
    /// How they move, and when they count as relaxed.
    pub const EVOLUTION: &str = "Evolution";
    /// How that is computed.
    pub const METHOD: &str = "Method";
    /// Where.
    pub const MACHINE: &str = "Machine";
    /// What is written.
    pub const OUTPUT: &str = "Output";
}

/// What the flag of a key takes, by the type of its field.
fn takes<T: Value>(_: fn(&Spec) -> &T) -> Takes {
    T::TAKES
}

/// Reads a word as the value of a key, or a part of it, by the type of its field.
fn check<T: Value>(word: &str, _: fn(&Spec) -> &T) -> Result<(), String> {
    T::read(word).map(drop)
}

/// Defines the spec, its default, and [`Spec::table`] from a table with lines `key: TYPE = DEFAULT, "VALUE", HEADING;`
/// whose comments are the help. A `key?: TYPE` has no value unless it is given. A key for `every cell` has one value in
/// all of them: it cannot be swept. `or "TEXT"` is the value of a flag without one. What is no key follows.
macro_rules! keys {
    (
        $(#[$of_spec:meta])*
        pub struct $spec:ident {
            $(
                $(#[doc = $help:literal])+ $(#[serde($($serde:tt)*)])?
                $key:ident $(?: $some:ty)? $(: $type:ty = $default:expr)?,
                $value:literal, $heading:ident $(, every $cell:ident)? $(, or $missing:literal)?;
            )*
        }
        besides {
            $($(#[doc = $about:literal])+ $other:ident: $other_type:ty = $other_default:expr;)*
        }
    ) => {
        $(#[$of_spec])*
        pub struct $spec {
            $(
                $(#[doc = $help])+ $(#[serde($($serde)*)])?
                $(#[serde(skip_serializing_if = "Option::is_none")] pub $key: Option<$some>,)?
                $(pub $key: $type,)?
            )*
            $($(#[doc = $about])+ #[serde(skip)] pub $other: $other_type,)*
        }

        impl Default for $spec {
            fn default() -> $spec {
                $spec { $($key: $(None::<$some>)? $($default)?,)* $($other: $other_default,)* }
            }
        }

        impl $spec {
            /// The keys, in the order of the spec.
            pub fn table() -> &'static [SpecKey] {
                static TABLE: LazyLock<Vec<SpecKey>> = LazyLock::new(|| vec![$(SpecKey {
                name: stringify!($key).replace('_', "-"),
                value: $value,
                heading: heading::$heading,
                help: concat!($($help, "\n",)+),
                takes: takes(|spec| &spec.$key),
                missing: [$($missing)?].first().copied(),
                is_common: !<[&str]>::is_empty(&[$(stringify!($cell))?]),
                check: |word| check(word, |spec| &spec.$key),
                set: |spec, words| {
                    Value::put(&mut spec.$key, Value::of(words)?);
                    Ok(())
                },
            }),*]);
            &TABLE
        }
        }
    };
}

keys! {
    /// A complete description of an ensemble and of the method that relaxes it.
    ///
    /// `Default` is the paper's first example as an ensemble: 256 perturbed 2:1 ellipses under surface diffusion.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
    #[allow(rustdoc::broken_intra_doc_links)] // the brackets of a grammar
    pub struct Spec {
        /// Number of members: perturbed copies of the curve, or of each outline [default: 256; for several outlines, or
        /// those of files:PATTERN, one unperturbed member each]
        curves: u64 = 256, "COUNT", ENSEMBLE, every cell;
        /// Fail unless exactly this many outlines are read. The spec of a run records it [default: any number]
        outlines?: u64, "COUNT", ENSEMBLE, every cell;
        /// Compare the outlines by the values of this property of their features, column of their table, or `file`
        /// [default: no groups]
        group_by?: String, "PROPERTY", ENSEMBLE, every cell;
        /// Nodes per member, n ≥ 6 [default: 100]
        points: usize = 100, "N", ENSEMBLE;
        /// Seed of the random perturbations [default: 1]
        #[serde(with = "seed")]
        seed: u64 = 1, "SEED", ENSEMBLE;
        /// Initial curve: ellipse:A,B, circle:R, nonconvex, astroid, lemniscate:A or flower:M:A[:PHASE],...; or the
        /// outlines in file:PATH or 'files:PATTERN' (CSV, GeoJSON, WKT, NumPy). A single outline of file: becomes
        /// --curves perturbed copies; several, or those of files:, are one unperturbed member each. Paths are relative
        /// to the current folder. Any number may be a distribution, such as uniform(1.2..3): see below
        /// [default: ellipse:2,1]
        shape: Drawn<Shape> = Shape::Ellipse { a: 2.0, b: 1.0 }.into(), "SHAPE", ENSEMBLE;
        /// Placement of the nodes on the curve [default: arclength]
        sampling: Sampling = Sampling::Arclength, "HOW", ENSEMBLE;
        /// How the curve of an outline runs between its data points: as a polygon, as a cubic spline, or (auto) as a
        /// spline with corners where the direction turns by more than half a radian [default: auto]
        interpolate?: Interpolation, "HOW", ENSEMBLE;
        /// Smallest radius of curvature of an outline's corners, as a share of the outline's length, 0.0001 to 0.02; 0
        /// leaves them to the nodes [default: 0.002]
        rounding?: f64, "SHARE", ENSEMBLE;
        /// Size σ of the random perturbation, 0 for none; or a distribution [default: 0.05]
        amplitude: Drawn<f64> = 0.05.into(), "SIGMA", ENSEMBLE;
        /// Modes of the random perturbation [default: 2..=8]
        modes: Modes = Modes { low: 2, high: 8 }, "LO..=HI", ENSEMBLE;
        /// Power p: mode m has standard deviation σ m^-p; or a distribution [default: 1]
        decay: Drawn<f64> = 1.0.into(), "P", ENSEMBLE;
        /// Stretch the curve of each member along its principal axes, at the same area, to the reduced area V = 4 pi
        /// A/L^2, 0.05 to 1; or a distribution. Needs --conserve area,length [default: as it is]
        reduced_area?: Drawn<f64>, "V", ENSEMBLE;
        /// Distribution of each mode: a normal amplitude and a uniform phase, or (gaussian) independent normal
        /// coefficients of cos and sin with the same power [default: amplitude-phase]
        #[serde(skip_serializing_if = "Perturbation::is_default")]
        perturbation: Perturbation = Perturbation::default(), "HOW", ENSEMBLE;
        /// How the members of a cell are spread over the distributions of --shape, --flow, --energy, --diffusivity,
        /// --drive, --amplitude, --decay and --reduced-area: each on its own, as a scrambled Sobol sequence, or as a
        /// Latin hypercube. The modes of the perturbation stay random [default: random]
        #[serde(skip_serializing_if = "Design::is_random")]
        design: Design = Design::default(), "DESIGN", ENSEMBLE;
        /// Flow: surface-diffusion, willmore, elastic:LAMBDA or poly:C1,C2,...; numbers may be distributions
        /// [default: surface-diffusion]
        flow: Drawn<Flow> = Flow::SurfaceDiffusion.into(), "FLOW", EVOLUTION;
        /// Surface energy γ of a crystal (anisotropic) under surface diffusion, by the angle ψ of the outward normal:
        /// cos:FOLD,EPS[,DEG] is 1 + EPS cos FOLD(ψ - DEG); a sum of two is cos:...+cos:... . FOLD is 2 to 12, and
        /// EPS (FOLD^2 - 1) below 1. Any number may be a distribution. --energy 1 is isotropic, but in the geometric
        /// form [default: 1]
        energy?: Drawn<Energy>, "GAMMA", EVOLUTION;
        /// Relative diffusivity along the surface of a crystal, by the same angle: cos:FOLD,EPS[,DEG] is
        /// 1 + EPS cos FOLD(ψ - DEG), above 0 in all directions; a sum of two as for --energy. Any number may be a
        /// distribution [default: 1]
        diffusivity?: Drawn<Diffusivity>, "D", EVOLUTION;
        /// Driving force along the normal, positive inwards, as a velocity in length/time: a circle under surface
        /// diffusion has R(t) = R(0) - F t. F, or feedback:C,A0 for C (A - A0), which brings the area A to A0. Any
        /// number may be a distribution [default: 0]
        drive?: Drawn<Drive>, "F", EVOLUTION;
        /// Keep the area, the length, or area,length, of willmore, elastic and poly. With both a curve relaxes to a
        /// vesicle, and its bending energy E = ½∮k² ds says when: from the time on after which |E - E_end| stays below
        /// --relax-to times its maximum over the run [default: neither]
        conserve?: Conserved, "WHAT", EVOLUTION;
        /// The area and the length that are kept; one number if one is. Starts that are off by more than 0.4 % are
        /// scaled to it, and for both first stretched as by --reduced-area [default: those of the polygon at the start]
        #[serde(deserialize_with = "some_numbers")]
        conserve_at?: Vec<f64>, "A,L", EVOLUTION;
        /// Mobility B in length^4/time; for surface diffusion, D_s gamma Omega^2 nu/(k_B T). All times, in flags and in
        /// results, are then in its unit of time [default: 1]
        mobility?: f64, "B", EVOLUTION;
        /// Names of the units of length and time, such as um,h, for the report and the axes [default: none]
        units?: Units, "LENGTH,TIME", EVOLUTION, every cell;
        /// Fixed time step τ. auto is R^4/4000 for each member [default: 0.001]
        tau?: OrAuto, "TAU", EVOLUTION;
        /// Adapt the steps to this local error instead of using --tau. Without TOL it is 0.001; write --adaptive=TOL
        /// before SPEC.toml [default: off]
        adaptive?: f64, "TOL", EVOLUTION, or "0.001";
        /// Final time. auto: each member ends when it is relaxed, at the latest at six times the relaxation time that
        /// linear theory predicts for its cell; a member that --drive shrinks to a point runs until it vanishes.
        /// T1,T2,...: one for each cell of a sweep [default: 2]
        t_end?: FinalTime, "T", EVOLUTION;
        /// Rate ω, in 1/time, of the redistribution towards equal spacing. auto is 4/R^4 for each member
        /// [default: 1 with --tau, auto with --adaptive and --tau auto]
        omega?: OrAuto, "OMEGA", EVOLUTION;
        /// Move nodes along the normal only [default: false]
        no_redistribution: bool = false, "BOOL", EVOLUTION;
        /// Rate κ, in 1/time, at which the curvatures k and segment lengths r that the scheme evolves relax to those of
        /// the polygon. 0 is the paper's scheme; auto is 4 x 24/R^4 for each member [default: 0]
        pull: OrAuto = OrAuto::Number(0.0), "KAPPA", METHOD;
        /// Which discretisation moves the nodes. paper: that of the curvatures and segment lengths that the scheme
        /// evolves; geometric: the force of the polygon itself, which halves the error of smooth, well resolved curves
        /// and fails for others; auto: the default [default: paper; geometric with --energy, --diffusivity, --drive and
        /// --conserve]
        form?: PositionForm, "FORM", METHOD;
        /// Solver of the pentadiagonal systems. auto is gauss-seidel with --tau and direct with --adaptive [default:
        /// auto]
        solver: SolverChoice = SolverChoice::Auto, "SOLVER", METHOD;
        /// Order in which a Gauss-Seidel sweep visits the nodes. coloured: all nodes of one colour at once, as a GPU
        /// needs it; lexicographic: one after another [default: coloured]
        order: Order = Order::Coloured, "ORDER", METHOD;
        /// Tolerance at which Gauss-Seidel sweeps stop: it bounds the residual, or in adaptive steps in f32 the change
        /// by a round of sweeps [default: 1e-5 in f64; in f32 1e-3, with --adaptive 1e-6]
        tolerance?: f64, "TOL", METHOD;
        /// Over-relaxation factor of Gauss-Seidel sweeps. 1 is the paper's; auto follows the stiffness of each system
        /// [default: 1; auto with --adaptive]
        sor?: OrAuto, "FACTOR", METHOD;
        /// Maximum Gauss-Seidel sweeps per system; a member that needs more ends as `stalled` [default: 200000]
        max_sweeps: u32 = 200_000, "COUNT", METHOD, every cell;
        /// Where to run; auto uses a hardware GPU if there is one, otherwise the CPU [default: auto]
        backend: BackendChoice = BackendChoice::Auto, "WHERE", MACHINE, every cell;
        /// GPU adapter to use: part of its name, or its number in `curvelax adapters` [default: the best]
        adapter?: String, "NAME", MACHINE, every cell;
        /// Number type [default: f64 where the device has it]
        precision?: Precision, "TYPE", MACHINE, every cell;
        /// Count a member as relaxed when its excess, L^2/(4 pi A) minus that of the regular polygon, has fallen to
        /// this fraction of its start; for vesicles see --conserve [default: 0.01]
        relax_to?: f64, "FRACTION", EVOLUTION;
        /// Count a member as relaxed when its excess has fallen to this value, instead of --relax-to. Use it for rough
        /// outlines, whose initial excess is that of their details [default: off]
        relax_at?: f64, "EXCESS", EVOLUTION;
        /// End a member as soon as it is relaxed; one that --drive shrinks to a point runs until it vanishes, and
        /// vesicles (--conserve area,length) run to the final time [default: false; with --t-end auto true]
        stop_when_relaxed?: bool, "BOOL", EVOLUTION, every cell;
        /// Run every member also with n/2, n/√2 and n nodes and a tenth of the step tolerance, and extrapolate t_relax
        /// to n → ∞: columns t_limit, t_error, order and points of summary.csv; with --drive t_vanish, too:
        /// t_vanish_limit and t_vanish_error. Members whose times do not converge there also run with √2 n, 2n, … up to
        /// 1600 nodes [default: false]
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        refine: bool = false, "BOOL", EVOLUTION, every cell;
        /// With --refine or --accurate: choose n, the tolerance and the number of members so that the 95 % interval of
        /// the median t_limit, for sampling and discretisation together, is within X times the median. For outlines,
        /// whose number is given: n and the tolerance so that each t_error is within X times t_limit. It starts from
        /// --curves, --points and --adaptive. If X cannot be reached, the run keeps its best result and exits with code
        /// 3 [default: off]
        accuracy?: f64, "X", EVOLUTION, every cell;
        /// Write events.csv: the first time at which each member meets a condition, NAME=OBSERVABLE<=THRESHOLD, or with
        /// >=. A threshold is a number, or FACTOR*start. Observables are length, area, excess, energy, k_min, k_max,
        /// mesh_ratio (longest over shortest segment) and metric_drift (largest relative difference between the lengths
        /// r that the scheme evolves and those of the segments). For several events give it several times: --event
        /// 'convex = k_min >= 0' --event 'slow = excess <= 0.5 * start' [default: none]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        event: Vec<Event> = Vec::new(), "NAME=CONDITION", OUTPUT, every cell;
        /// Write series.csv: one row per member every DT [default: off]
        series?: f64, "DT", OUTPUT, every cell;
        /// Write snapshots.csv: all nodes at these times [default: off]
        #[serde(deserialize_with = "list")]
        snapshots: Vec<f64> = Vec::new(), "T1,T2,...", OUTPUT, every cell;
        /// Format of the snapshots: the table snapshots.csv, or the arrays of snapshots.zarr, for xarray
        /// [default: csv]
        store: Store = Store::Csv, "HOW", OUTPUT, every cell;
        /// Format of the tables: CSV, or Parquet next to the CSV files, which the other commands read [default: csv]
        #[serde(skip_serializing_if = "Tables::is_csv")]
        tables: Tables = Tables::Csv, "HOW", OUTPUT, every cell;
        /// Run only these members; each is bit-identical to its run in the whole ensemble [default: all]
        #[serde(deserialize_with = "some_list")]
        only?: Vec<u64>, "J1,J2,...", ENSEMBLE, every cell;
        /// Run only the members j with j mod N = I, for `curvelax merge`; `slurm` reads I/N from the job array
        /// [default: all]
        shard?: Shard, "I/N", ENSEMBLE, every cell;
        /// Threads that prepare and analyse members and, on the CPU, advance them [default: all cores]
        threads?: usize, "COUNT", MACHINE, every cell;
        /// Draw member j of every cell from the same random numbers [default: false]
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        common_random_numbers: bool = false, "BOOL", ENSEMBLE, every cell;
        /// Vary this key: a cell of members for each value, or for each combination of values if the flag is given for
        /// several keys. Separate values that contain commas by semicolons: --sweep 'shape=ellipse:2,1;circle:1'
        /// [default: none]
        #[serde(skip_serializing_if = "Sweep::is_empty")]
        sweep: Sweep = Sweep::default(), "KEY=V1,V2,...", ENSEMBLE, every cell;
    }
    besides {
        /// Highest order of adaptive steps; if absent, that of the precision. Only the study of work and precision sets
        /// it, to measure what every order costs.
        most_order: Option<u32> = None;
        /// Keys that the request leaves out.
        omitted: OmittedKeys = OmittedKeys::default();
    }
}

impl Spec {
    /// Names of all keys, in order.
    pub fn keys() -> Vec<String> {
        Self::table().iter().map(|key| key.name.clone()).collect()
    }

    /// Whether `key` is the same in every cell: it cannot be swept.
    pub(super) fn is_common(key: &str) -> bool {
        Self::table().iter().any(|known| known.name == key && known.is_common)
    }
}

/// Keys that a request leaves out, of those whose default is another one for outlines: one copy of each, not perturbed.
#[derive(Clone, Copy, Default)]
pub struct OmittedKeys {
    /// There is no `curves`.
    pub curves: bool,
    /// There is no `amplitude`.
    pub amplitude: bool,
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
