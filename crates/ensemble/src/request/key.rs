//! The keys of a spec, each in one place: its name in spec files and as a flag, its type, its default, and its help.
//!
//! A new key is a line of the table below. Flags, their help, docs/flags.md, the keywords of Python and the swept keys
//! follow; [`Spec::validate`] checks its range, and whoever needs its value asks the [`Spec`].

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{
    choices::{
        BackendChoice, FinalTime, Omega, PositionForm, Pull, SolverChoice, Sor, Store, Tables, Tau, list, some_list,
        some_numbers,
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
    pub name: &'static str,
    /// What stands for its value in the help.
    pub value: &'static str,
    /// The heading of the help under which it stands.
    pub heading: HelpHeading,
    /// What it does, over several lines, with its default in brackets at the end.
    help: &'static str,
    /// What its flag takes.
    pub takes: Takes,
    /// What its flag means without a value, if that is allowed.
    pub missing: Option<&'static str>,
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

/// A heading of the help.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HelpHeading {
    /// Which curves.
    Ensemble,
    /// How they move, and when they count as relaxed.
    Evolution,
    /// How that is computed.
    Method,
    /// Where.
    Machine,
    /// What is written.
    Output,
}

impl HelpHeading {
    /// The heading.
    pub const fn name(self) -> &'static str {
        match self {
            HelpHeading::Ensemble => "Ensemble",
            HelpHeading::Evolution => "Evolution",
            HelpHeading::Method => "Method",
            HelpHeading::Machine => "Machine",
            HelpHeading::Output => "Output",
        }
    }
}

/// `group_by` as `group-by`.
const fn hyphenated<const N: usize>(name: &str) -> [u8; N] {
    let mut bytes = [0; N];
    let mut i = 0;
    while i < N {
        let byte = name.as_bytes()[i];
        bytes[i] = if byte == b'_' { b'-' } else { byte };
        i += 1;
    }
    bytes
}

/// Defines the spec, its default, and [`Spec::KEYS`] from a table with lines `key: TYPE = DEFAULT, "VALUE", GROUP;`
/// whose comments are the help. `or "TEXT"` is the value of a flag without one. What is no key follows.
macro_rules! keys {
    (
        $(#[$of_spec:meta])*
        pub struct $spec:ident {
            $(
                $(#[doc = $help:literal])+ $(#[serde($($serde:tt)*)])?
                $key:ident: $type:ty = $default:expr, $value:literal, $group:ident $(, or $missing:literal)?;
            )*
        }
        besides {
            $($(#[doc = $about:literal])+ $other:ident: $other_type:ty = $other_default:expr;)*
        }
    ) => {
        $(#[$of_spec])*
        pub struct $spec {
            $($(#[doc = $help])+ $(#[serde($($serde)*)])? pub $key: $type,)*
            $($(#[doc = $about])+ #[serde(skip)] pub $other: $other_type,)*
        }

        impl Default for $spec {
            fn default() -> $spec {
                $spec { $($key: $default,)* $($other: $other_default,)* }
            }
        }

        impl $spec {
            /// The keys, in the order of the spec.
            pub const KEYS: &[SpecKey] = &[$(SpecKey {
                name: {
                    const NAME: [u8; stringify!($key).len()] = hyphenated(stringify!($key));
                    match std::str::from_utf8(&NAME) {
                        Ok(name) => name,
                        Err(_) => unreachable!(),
                    }
                },
                value: $value,
                heading: HelpHeading::$group,
                help: concat!($($help, "\n",)+),
                takes: <$type as Value>::TAKES,
                missing: (&[$($missing)?] as &[&'static str]).first().copied(),
                check: |word| <$type as Value>::read(word).map(drop),
                set: |spec, words| {
                    Value::put(&mut spec.$key, <$type as Value>::of(words)?);
                    Ok(())
                },
            }),*];
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
        /// Number of members: perturbed copies of the curve, or of each outline. Without the flag, several outlines, or
        /// those of files:PATTERN, are one unperturbed member each [default: 256]
        curves: u64 = 256, "COUNT", Ensemble;
        /// Fail unless exactly this many outlines are read. The spec of a run records it [default: any number]
        #[serde(skip_serializing_if = "Option::is_none")]
        outlines: Option<u64> = None, "COUNT", Ensemble;
        /// Compare the outlines by the values of this property of their features, column of their table, or `file`
        /// [default: no groups]
        #[serde(skip_serializing_if = "Option::is_none")]
        group_by: Option<String> = None, "PROPERTY", Ensemble;
        /// Nodes per member, n ≥ 6 [default: 100]
        points: usize = 100, "N", Ensemble;
        /// Seed of the random perturbations [default: 1]
        #[serde(with = "seed")]
        seed: u64 = 1, "SEED", Ensemble;
        /// Initial curve: ellipse:A,B, circle:R, nonconvex, astroid, lemniscate:A or flower:M:A[:PHASE],...; or the
        /// outlines in file:PATH or 'files:PATTERN' (CSV, GeoJSON, WKT, NumPy). A single outline of file: becomes
        /// --curves perturbed copies; several, or those of files:, are one unperturbed member each. Paths are relative
        /// to the current folder. Any number may be a distribution, such as uniform(1.2..3): see below
        /// [default: ellipse:2,1]
        shape: Drawn<Shape> = Shape::Ellipse { a: 2.0, b: 1.0 }.into(), "SHAPE", Ensemble;
        /// Placement of the nodes on the curve [default: arclength]
        sampling: Sampling = Sampling::Arclength, "HOW", Ensemble;
        /// How the curve of an outline runs between its data points: as a polygon, as a cubic spline, or (auto) as a
        /// spline with corners where the direction turns by more than half a radian [default: auto]
        #[serde(skip_serializing_if = "Option::is_none")]
        interpolate: Option<Interpolation> = None, "HOW", Ensemble;
        /// Smallest radius of curvature of an outline's corners, as a share of the outline's length, 0.0001 to 0.02; 0
        /// leaves them to the nodes [default: 0.002]
        #[serde(skip_serializing_if = "Option::is_none")]
        rounding: Option<f64> = None, "SHARE", Ensemble;
        /// Size σ of the random perturbation, 0 for none; or a distribution [default: 0.05]
        amplitude: Drawn<f64> = 0.05.into(), "SIGMA", Ensemble;
        /// Modes of the random perturbation [default: 2..=8]
        modes: Modes = Modes { low: 2, high: 8 }, "LO..=HI", Ensemble;
        /// Power p: mode m has standard deviation σ m^-p; or a distribution [default: 1]
        decay: Drawn<f64> = 1.0.into(), "P", Ensemble;
        /// Stretch the curve of each member along its principal axes, at the same area, to the reduced area V = 4 pi
        /// A/L^2, 0.05 to 1; or a distribution. Needs --conserve area,length [default: as it is]
        #[serde(skip_serializing_if = "Option::is_none")]
        reduced_area: Option<Drawn<f64>> = None, "V", Ensemble;
        /// Distribution of each mode: a normal amplitude and a uniform phase, or (gaussian) independent normal
        /// coefficients of cos and sin with the same power [default: amplitude-phase]
        #[serde(skip_serializing_if = "Perturbation::is_default")]
        perturbation: Perturbation = Perturbation::default(), "HOW", Ensemble;
        /// How the members of a cell are spread over the distributions of --shape, --flow, --energy, --diffusivity,
        /// --drive, --amplitude, --decay and --reduced-area: each on its own, as a scrambled Sobol sequence, or as a
        /// Latin hypercube. The modes of the perturbation stay random [default: random]
        #[serde(skip_serializing_if = "Design::is_random")]
        design: Design = Design::default(), "DESIGN", Ensemble;
        /// Flow: surface-diffusion, willmore, elastic:LAMBDA or poly:C1,C2,...; numbers may be distributions
        /// [default: surface-diffusion]
        flow: Drawn<Flow> = Flow::SurfaceDiffusion.into(), "FLOW", Evolution;
        /// Surface energy γ of a crystal (anisotropic) under surface diffusion, by the angle ψ of the outward normal:
        /// cos:M,EPS[,DEG] is 1 + EPS cos M(ψ - DEG); a sum of two is cos:...+cos:... . M is 2 to 12, and EPS (M^2 - 1)
        /// below 1. Any number may be a distribution. --energy 1 is isotropic, but in the geometric form [default: 1]
        #[serde(skip_serializing_if = "Option::is_none")]
        energy: Option<Drawn<Energy>> = None, "GAMMA", Evolution;
        /// Mobility of the atoms along the surface of a crystal: cos:M,EPS[,DEG] is 1 + EPS cos M(ψ - DEG), above 0 in
        /// all directions; a sum of two as for --energy. Any number may be a distribution [default: 1]
        #[serde(skip_serializing_if = "Option::is_none")]
        diffusivity: Option<Drawn<Diffusivity>> = None, "M", Evolution;
        /// Driving force along the normal, positive inwards, as a velocity in length/time: a circle under surface
        /// diffusion has R(t) = R(0) - F t. F, or feedback:C,A0 for C (A - A0), which brings the area A to A0. Any
        /// number may be a distribution [default: 0]
        #[serde(skip_serializing_if = "Option::is_none")]
        drive: Option<Drawn<Drive>> = None, "F", Evolution;
        /// Keep the area, the length, or area,length, of willmore, elastic and poly. With both a curve relaxes to a
        /// vesicle: it is relaxed from the time after which |E - E_end| stays below --relax-to times its maximum over
        /// the run [default: neither]
        #[serde(skip_serializing_if = "Option::is_none")]
        conserve: Option<Conserved> = None, "WHAT", Evolution;
        /// The area and the length that are kept; one number if one is. Starts that are off by more than 0.4 % are
        /// scaled to it, and for both first stretched as by --reduced-area [default: those of the polygon at the start]
        #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "some_numbers")]
        conserve_at: Option<Vec<f64>> = None, "A,L", Evolution;
        /// Mobility B in length^4/time; for surface diffusion, D_s gamma Omega^2 nu/(k_B T). All times, in flags and in
        /// results, are then in its unit of time [default: 1]
        #[serde(skip_serializing_if = "Option::is_none")]
        mobility: Option<f64> = None, "B", Evolution;
        /// Names of the units of length and time, such as um,h, for the report and the axes [default: none]
        #[serde(skip_serializing_if = "Option::is_none")]
        units: Option<Units> = None, "LENGTH,TIME", Evolution;
        /// Fixed time step τ. auto is R^4/4000 for each member [default: 0.001]
        #[serde(skip_serializing_if = "Option::is_none")]
        tau: Option<Tau> = None, "TAU", Evolution;
        /// Adapt the steps to this local error instead of using --tau. Without TOL it is 0.001; write --adaptive=TOL
        /// before SPEC.toml [default: off]
        #[serde(skip_serializing_if = "Option::is_none")]
        adaptive: Option<f64> = None, "TOL", Evolution, or "0.001";
        /// Final time. auto: when the member is relaxed, at the latest at six times the relaxation time that linear
        /// theory predicts for its cell; if --drive makes it vanish, when it has. T1,T2,...: one for each cell of a
        /// sweep [default: 2]
        #[serde(skip_serializing_if = "Option::is_none")]
        t_end: Option<FinalTime> = None, "T", Evolution;
        /// Rate ω, in 1/time, of the redistribution towards equal spacing. auto is 4/R^4 for each member
        /// [default: 1 with --tau, auto with --adaptive and --tau auto]
        #[serde(skip_serializing_if = "Option::is_none")]
        omega: Option<Omega> = None, "OMEGA", Evolution;
        /// Move nodes along the normal only [default: false]
        no_redistribution: bool = false, "BOOL", Evolution;
        /// Rate κ, in 1/time, at which the curvatures k and segment lengths r that the scheme evolves relax to those of
        /// the polygon. 0 is the paper's scheme; auto is 4 x 24/R^4 for each member [default: 0]
        pull: Pull = Pull::Rate(0.0), "KAPPA", Method;
        /// Which discretisation moves the nodes. paper: that of the curvatures and segment lengths that the scheme
        /// evolves; geometric: the force of the polygon itself, which halves the error of smooth, well resolved curves
        /// and fails for others; auto: the default [default: paper; geometric with --energy, --diffusivity, --drive and
        /// --conserve]
        #[serde(skip_serializing_if = "Option::is_none")]
        form: Option<PositionForm> = None, "FORM", Method;
        /// Solver of the pentadiagonal systems. auto is gauss-seidel with --tau and direct with --adaptive [default:
        /// auto]
        solver: SolverChoice = SolverChoice::Auto, "SOLVER", Method;
        /// Order in which a Gauss-Seidel sweep visits the nodes. coloured: all nodes of one colour at once, as a GPU
        /// needs it; lexicographic: one after another [default: coloured]
        order: Order = Order::Coloured, "ORDER", Method;
        /// Tolerance at which Gauss-Seidel sweeps stop: it bounds the residual, or in adaptive steps in f32 the change
        /// by a round of sweeps [default: 1e-5 in f64; in f32 1e-3, with --adaptive 1e-6]
        #[serde(skip_serializing_if = "Option::is_none")]
        tolerance: Option<f64> = None, "TOL", Method;
        /// Over-relaxation factor of Gauss-Seidel sweeps. 1 is the paper's; auto follows the stiffness of each system
        /// [default: 1; auto with --adaptive]
        #[serde(skip_serializing_if = "Option::is_none")]
        sor: Option<Sor> = None, "FACTOR", Method;
        /// Maximum Gauss-Seidel sweeps per system; a member that needs more ends as `stalled` [default: 200000]
        max_sweeps: u32 = 200_000, "COUNT", Method;
        /// Where to run; auto uses a hardware GPU if there is one, otherwise the CPU [default: auto]
        backend: BackendChoice = BackendChoice::Auto, "WHERE", Machine;
        /// GPU adapter to use: part of its name, or its number in `curvelax adapters` [default: the best]
        #[serde(skip_serializing_if = "Option::is_none")]
        adapter: Option<String> = None, "NAME", Machine;
        /// Number type [default: f64 where the device has it]
        #[serde(skip_serializing_if = "Option::is_none")]
        precision: Option<Precision> = None, "TYPE", Machine;
        /// Count a member as relaxed at this fraction of its initial excess, or of the energy of a vesicle (--conserve)
        /// [default: 0.01]
        #[serde(skip_serializing_if = "Option::is_none")]
        relax_to: Option<f64> = None, "FRACTION", Evolution;
        /// Count a member as relaxed at this excess, L^2/(4 pi A) minus that of the regular polygon, instead of
        /// --relax-to. Use it for rough outlines [default: off]
        #[serde(skip_serializing_if = "Option::is_none")]
        relax_at: Option<f64> = None, "EXCESS", Evolution;
        /// End a member as soon as it is relaxed; one that --drive shrinks to a point ends there. Vesicles (--conserve
        /// area,length) run to the final time [default: false; with --t-end auto true]
        #[serde(skip_serializing_if = "Option::is_none")]
        stop_when_relaxed: Option<bool> = None, "BOOL", Evolution;
        /// Run every member also with n/2, n/√2 and n nodes and a tenth of the step tolerance, and extrapolate t_relax
        /// to n → ∞: columns t_limit, t_error, order and points of summary.csv; with --drive t_vanish, too:
        /// t_vanish_limit and t_vanish_error. Members whose times do not converge there also run with √2 n, 2n, … up to
        /// 1600 nodes [default: false]
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        refine: bool = false, "BOOL", Evolution;
        /// With --refine or --accurate: choose n, the tolerance and the number of members so that the 95 % interval of
        /// the median t_limit, for sampling and discretisation together, is within X times the median. For outlines,
        /// whose number is given: n and the tolerance so that each t_error is within X times t_limit. It starts from
        /// --curves, --points and --adaptive. If X cannot be reached, the run keeps its best result and exits with code
        /// 3 [default: off]
        #[serde(skip_serializing_if = "Option::is_none")]
        accuracy: Option<f64> = None, "X", Evolution;
        /// Write events.csv: the first time at which each member meets a condition, NAME=OBSERVABLE<=THRESHOLD, or with
        /// >=. A threshold is a number, or FACTOR*start. Observables are length, area, excess, energy, k_min, k_max,
        /// mesh_ratio (longest over shortest segment) and metric_drift (largest relative difference between the lengths
        /// r that the scheme evolves and those of the segments). For several events give it several times: --event
        /// 'convex = k_min >= 0' --event 'slow = excess <= 0.5 * start' [default: none]
        #[serde(skip_serializing_if = "Vec::is_empty")]
        event: Vec<Event> = Vec::new(), "NAME=CONDITION", Output;
        /// Write series.csv: one row per member every DT [default: off]
        #[serde(skip_serializing_if = "Option::is_none")]
        series: Option<f64> = None, "DT", Output;
        /// Write snapshots.csv: all nodes at these times [default: off]
        #[serde(deserialize_with = "list")]
        snapshots: Vec<f64> = Vec::new(), "T1,T2,...", Output;
        /// Format of the snapshots: the table snapshots.csv, or the arrays of snapshots.zarr, for xarray
        /// [default: csv]
        store: Store = Store::Csv, "HOW", Output;
        /// Format of the tables: CSV, or Parquet next to the CSV files, which the other commands read [default: csv]
        #[serde(skip_serializing_if = "Tables::is_csv")]
        tables: Tables = Tables::Csv, "HOW", Output;
        /// Run only these members; each is bit-identical to its run in the whole ensemble [default: all]
        #[serde(skip_serializing_if = "Option::is_none", deserialize_with = "some_list")]
        only: Option<Vec<u64>> = None, "J1,J2,...", Ensemble;
        /// Run only the members j with j mod N = I, for `curvelax merge`; `slurm` reads I/N from the job array
        /// [default: all]
        #[serde(skip_serializing_if = "Option::is_none")]
        shard: Option<Shard> = None, "I/N", Ensemble;
        /// Threads that prepare and analyse members and, on the CPU, advance them [default: all cores]
        #[serde(skip_serializing_if = "Option::is_none")]
        threads: Option<usize> = None, "COUNT", Machine;
        /// Draw member j of every cell from the same random numbers [default: false]
        #[serde(skip_serializing_if = "std::ops::Not::not")]
        common_random_numbers: bool = false, "BOOL", Ensemble;
        /// Vary this key: a cell of members for each value, or for each combination of values if the flag is given for
        /// several keys. Separate values that contain commas by semicolons: --sweep 'shape=ellipse:2,1;circle:1'
        /// [default: none]
        #[serde(skip_serializing_if = "Sweep::is_empty")]
        sweep: Sweep = Sweep::default(), "KEY=V1,V2,...", Ensemble;
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
        Self::KEYS.iter().map(|key| key.name.to_owned()).collect()
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
