//! The flags for the keys of the spec: the same names, the same values; a flag overrides the file.
//!
//! Values are only parsed here. Ranges are checked once, on the resolved spec, so that numbers from the file and from
//! flags pass the same checks.

use super::parsers::{real, shard, solver, text_of, whole, word};
use crate::{
    crystal::{Diffusivity, Energy},
    curve::{Interpolation, Modes, Perturbation, Sampling, Shape},
    ensemble::{
        Drawn, Event, Shard, Spec,
        request::spec::{
            BackendChoice, FinalTime, Omega, Order, PositionForm, Precision, Pull, SolverChoice, Sor, Store, Tables,
            Tau, Units,
        },
        request::sweep::{self, SweepAxis},
    },
    error::{Error, Result, echo},
    flow::Flow,
    random::Design,
};

const SAMPLINGS: &[&str] = &["parameter", "arclength", "points"];
pub(super) const FORMS: &[&str] = &["paper", "geometric", "auto"];
pub(super) const PERTURBATIONS: &[&str] = &["amplitude-phase", "gaussian"];
const DESIGNS: &[&str] = &["random", "sobol", "lhs"];
const ORDERS: &[&str] = &["coloured", "lexicographic"];
pub(super) const BACKENDS: &[&str] = &["auto", "gpu", "cpu"];
pub(super) const PRECISIONS: &[&str] = &["f32", "f64"];
const STORES: &[&str] = &["csv", "zarr"];
const TABLES: &[&str] = &["csv", "parquet"];

/// One flag for each key of [`Spec`], none given unless the user gave it.
///
/// A value that begins with a hyphen is taken as a value, so that `--tau -1` is refused for its range.
#[derive(clap::Args)]
pub struct SpecFlags {
    /// Number of members. Of outlines, the number of copies of each; without the flag, each runs once, unperturbed
    /// [default: 256]
    #[arg(
        long, value_name = "COUNT", value_parser = whole::<u64>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    curves: Option<u64>,
    /// Nodes per member, n ≥ 6 [default: 100]
    #[arg(
        long, value_name = "N", value_parser = whole::<usize>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    points: Option<usize>,
    /// Seed of the random perturbations [default: 1]
    #[arg(
        long, value_name = "SEED", value_parser = whole::<u64>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    seed: Option<u64>,
    /// Initial curve: ellipse:A,B, circle:R, nonconvex, astroid, lemniscate:A or flower:M:A[:PHASE],...; or the outlines in
    /// file:PATH or 'files:PATTERN' (CSV, GeoJSON, WKT, NumPy), each of which is a member. Paths are relative to the current
    /// folder. Any number may be a distribution, such as uniform(1.2..3): see below [default: ellipse:2,1]
    #[arg(
        long, value_name = "SHAPE", value_parser = text_of::<Drawn<Shape>>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    shape: Option<Drawn<Shape>>,
    /// Expected number of outlines: another number is refused. The spec of a run records it [default: any number]
    #[arg(
        long, value_name = "COUNT", value_parser = whole::<u64>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    outlines: Option<u64>,
    /// Compare the outlines by the values of this property of their features, column of their table, or `file`
    /// [default: no groups]
    #[arg(long, value_name = "PROPERTY", help_heading = ENSEMBLE)]
    group_by: Option<String>,
    /// Placement of the nodes on the curve [default: arclength]
    #[arg(long, value_name = "HOW", value_parser = word::<Sampling>(SAMPLINGS), help_heading = ENSEMBLE)]
    sampling: Option<Sampling>,
    /// How the curve of an outline runs between its points: as a polygon, as a cubic spline, or (auto) as a spline with corners
    /// where the direction turns by more than half a radian [default: auto]
    #[arg(
        long, value_name = "HOW", value_parser = word::<Interpolation>(&Interpolation::NAMES), help_heading = ENSEMBLE
    )]
    interpolate: Option<Interpolation>,
    /// Smallest radius of curvature of an outline's corners, as a share of the outline's length, 0.0001 to 0.02; 0 leaves them
    /// to the nodes [default: 0.002]
    #[arg(long, value_name = "SHARE", value_parser = real, allow_hyphen_values = true, help_heading = ENSEMBLE)]
    rounding: Option<f64>,
    /// Size σ of the random perturbation, 0 for none; or a distribution [default: 0.05]
    #[arg(
        long, value_name = "SIGMA", value_parser = text_of::<Drawn<f64>>, allow_hyphen_values = true, help_heading = ENSEMBLE
    )]
    amplitude: Option<Drawn<f64>>,
    /// Modes of the random perturbation [default: 2..=8]
    #[arg(
        long, value_name = "LO..=HI", value_parser = text_of::<Modes>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    modes: Option<Modes>,
    /// Power p: mode m has standard deviation σ m^-p; or a distribution [default: 1]
    #[arg(
        long, value_name = "P", value_parser = text_of::<Drawn<f64>>, allow_hyphen_values = true,
        help_heading = ENSEMBLE
    )]
    decay: Option<Drawn<f64>>,
    /// Law of each mode: a normal amplitude and a uniform phase, or (gaussian) independent normal coefficients of cos and
    /// sin with the same power [default: amplitude-phase]
    #[arg(long, value_name = "LAW", value_parser = word::<Perturbation>(PERTURBATIONS), help_heading = ENSEMBLE)]
    perturbation: Option<Perturbation>,
    /// How the members of a cell are spread over the distributions of --shape, --flow, --energy, --diffusivity,
    /// --amplitude and --decay: each on its own, as a scrambled Sobol sequence, or as a Latin hypercube. The modes of the perturbation stay random
    /// [default: random]
    #[arg(long, value_name = "DESIGN", value_parser = word::<Design>(DESIGNS), help_heading = ENSEMBLE)]
    design: Option<Design>,
    /// Vary this key: a cell of members for each value, and for each combination if the flag is given for several keys.
    /// Separate values that contain commas by semicolons: --sweep 'shape=ellipse:2,1;circle:1' [default: none]
    #[arg(long, value_name = "KEY=V1,V2,...", value_parser = text_of::<SweepAxis>, help_heading = ENSEMBLE)]
    sweep: Vec<SweepAxis>,
    /// Draw member j of every cell from the same random numbers [default: false]
    #[arg(
        long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true",
        hide_possible_values = true, help_heading = ENSEMBLE
    )]
    common_random_numbers: Option<bool>,
    /// Run only these members; each is bit-identical to its run in the whole ensemble [default: all]
    #[arg(
        long, value_name = "J1,J2,...", value_delimiter = ',', value_parser = whole::<u64>,
        allow_hyphen_values = true, help_heading = ENSEMBLE
    )]
    only: Option<Vec<u64>>,
    /// Run only the members j with j mod N = I, for `curvelax merge`; `slurm` reads I/N from the job array [default: all]
    #[arg(long, value_name = "I/N", value_parser = shard, allow_hyphen_values = true, help_heading = ENSEMBLE)]
    shard: Option<Shard>,

    /// Flow: surface-diffusion, willmore, elastic:LAMBDA or poly:C1,C2,...; numbers may be distributions
    /// [default: surface-diffusion]
    #[arg(
        long, value_name = "FLOW", value_parser = text_of::<Drawn<Flow>>, allow_hyphen_values = true,
        help_heading = EVOLUTION
    )]
    flow: Option<Drawn<Flow>>,
    /// Surface energy γ of a crystal under surface diffusion, by the angle ψ of the outward normal: cos:M,EPS[,DEG] is 1 +
    /// EPS cos M(ψ - DEG); a sum of two is cos:...+cos:... . M is 2 to 12, and EPS (M^2 - 1) below 1. Any number may be a
    /// distribution [default: 1]
    #[arg(
        long, value_name = "GAMMA", value_parser = text_of::<Drawn<Energy>>, allow_hyphen_values = true, help_heading = EVOLUTION
    )]
    energy: Option<Drawn<Energy>>,
    /// Mobility of the atoms along the surface of a crystal, by the same angle: cos:M,MU[,DEG] is 1 + MU cos M(ψ - DEG), above
    /// 0 in all directions; a sum of two as for --energy [default: 1]
    #[arg(
        long, value_name = "M", value_parser = text_of::<Drawn<Diffusivity>>, allow_hyphen_values = true,
        help_heading = EVOLUTION
    )]
    diffusivity: Option<Drawn<Diffusivity>>,
    /// Mobility B in length^4/time; for surface diffusion, D_s gamma Omega^2 nu/(k_B T). All times, in flags and in results,
    /// are then in its unit of time [default: 1]
    #[arg(long, value_name = "B", value_parser = real, allow_hyphen_values = true, help_heading = EVOLUTION)]
    mobility: Option<f64>,
    /// Names of the units of length and time, such as um,h, for the report and the axes [default: none]
    #[arg(long, value_name = "LENGTH,TIME", value_parser = text_of::<Units>, help_heading = EVOLUTION)]
    units: Option<Units>,
    /// Fixed time step τ. auto is R^4/4000 for each member [default: 0.001]
    #[arg(
        long, value_name = "TAU", value_parser = text_of::<Tau>, allow_hyphen_values = true, help_heading = EVOLUTION
    )]
    tau: Option<Tau>,
    /// Adapt the steps to this local error instead of using --tau. Without TOL it is 0.001; write --adaptive=TOL before
    /// SPEC.toml [default: off]
    #[arg(
        long, value_name = "TOL", value_parser = real, allow_negative_numbers = true, num_args = 0..=1,
        default_missing_value = "0.001", help_heading = EVOLUTION
    )]
    adaptive: Option<f64>,
    /// Final time. auto: when the member is relaxed, at the latest at six times the relaxation time that linear theory
    /// predicts for its cell. T1,T2,...: one for each cell of a sweep [default: 2]
    #[arg(long, value_name = "T", value_parser = text_of::<FinalTime>, allow_hyphen_values = true, help_heading = EVOLUTION)]
    t_end: Option<FinalTime>,
    /// Rate ω, in 1/time, of the redistribution towards equal spacing. auto is 4/R^4 for each member
    /// [default: 1 with --tau, auto with --adaptive and --tau auto]
    #[arg(
        long, value_name = "OMEGA", value_parser = text_of::<Omega>, allow_hyphen_values = true,
        help_heading = EVOLUTION
    )]
    omega: Option<Omega>,
    /// Move nodes along the normal only [default: false]
    #[arg(
        long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true",
        hide_possible_values = true, help_heading = EVOLUTION
    )]
    no_redistribution: Option<bool>,
    /// Count a member as relaxed at this fraction of its initial excess [default: 0.01]
    #[arg(
        long, value_name = "FRACTION", value_parser = real, allow_hyphen_values = true,
        help_heading = EVOLUTION
    )]
    relax_to: Option<f64>,
    /// Count a member as relaxed at this excess, L^2/(4 pi A) minus that of the regular polygon, instead of --relax-to.
    /// Use it for rough outlines [default: off]
    #[arg(
        long, value_name = "EXCESS", value_parser = real, allow_hyphen_values = true, help_heading = EVOLUTION
    )]
    relax_at: Option<f64>,
    /// End a member as soon as it is relaxed [default: false, true with --t-end auto]
    #[arg(
        long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true",
        hide_possible_values = true, help_heading = EVOLUTION
    )]
    stop_when_relaxed: Option<bool>,

    /// What we recommend for numbers to publish: --adaptive --pull auto --omega auto --t-end auto --stop-when-relaxed
    /// --refine. Each can still be set on its own [default: off]
    #[arg(long, help_heading = EVOLUTION)]
    accurate: bool,
    /// Run every member also with n/2, n/√2 and n nodes and steps ten times as exact, and extrapolate t_relax to n → ∞:
    /// columns t_limit, t_error, order and points of summary.csv. Members whose times do not converge there also run with
    /// √2 n, 2n, … up to 1600 nodes [default: false]
    #[arg(
        long, value_name = "BOOL", num_args = 0..=1, require_equals = true, default_missing_value = "true",
        hide_possible_values = true, help_heading = EVOLUTION
    )]
    refine: Option<bool>,
    /// Choose n, the tolerance and the number of members so that the 95 % interval of the median limit, for sampling and
    /// discretisation together, is within X times the median. For outlines, whose number is given: n and the tolerance so
    /// that each t_error is within X times t_limit. It starts from --curves, --points and --adaptive. If X cannot be reached,
    /// the run keeps its best result and exits with code 3. Needs --refine [default: off]
    #[arg(long, value_name = "X", value_parser = real, allow_hyphen_values = true, help_heading = EVOLUTION)]
    accuracy: Option<f64>,

    /// Rate κ, in 1/time, at which the curvatures k and segment lengths r that the scheme evolves relax to those of the
    /// polygon. 0 is the paper's scheme; auto is 4 x 24/R^4 for each member [default: 0]
    #[arg(
        long, value_name = "KAPPA", value_parser = text_of::<Pull>, allow_hyphen_values = true, help_heading = METHOD
    )]
    pull: Option<Pull>,
    /// What moves the nodes. paper: the curvatures and segment lengths that the scheme evolves; geometric: the force of the
    /// polygon itself, which halves the error of smooth, well resolved curves and fails for others; auto: paper [default: paper; of crystals geometric]
    #[arg(long, value_name = "FORM", value_parser = word::<PositionForm>(FORMS), help_heading = METHOD)]
    form: Option<PositionForm>,
    /// Solver of the pentadiagonal systems. auto is gauss-seidel with --tau and direct with --adaptive [default: auto]
    #[arg(long, value_name = "SOLVER", value_parser = solver::<SolverChoice>(&SolverChoice::NAMES), help_heading = METHOD)]
    solver: Option<SolverChoice>,
    /// Order in which a Gauss-Seidel sweep visits the nodes. coloured: all nodes of one colour at once, as a GPU needs it;
    /// lexicographic: one after another [default: coloured]
    #[arg(long, value_name = "ORDER", value_parser = word::<Order>(ORDERS), help_heading = METHOD)]
    order: Option<Order>,
    /// Residual tolerance at which Gauss-Seidel sweeps stop [default: 1e-3 in f32, 1e-5 in f64]
    #[arg(long, value_name = "TOL", value_parser = real, allow_hyphen_values = true, help_heading = METHOD)]
    tolerance: Option<f64>,
    /// Over-relaxation factor of Gauss-Seidel sweeps. 1 is the paper's; auto follows the stiffness of each system
    /// [default: 1]
    #[arg(
        long, value_name = "FACTOR", value_parser = text_of::<Sor>, allow_hyphen_values = true, help_heading = METHOD
    )]
    sor: Option<Sor>,
    /// Maximum Gauss-Seidel sweeps per system; a member that needs more ends as `stalled` [default: 200000]
    #[arg(
        long, value_name = "COUNT", value_parser = whole::<u32>, allow_hyphen_values = true,
        help_heading = METHOD
    )]
    max_sweeps: Option<u32>,

    /// Where to run; auto uses a hardware GPU if there is one, otherwise the CPU [default: auto]
    #[arg(long, value_name = "WHERE", value_parser = word::<BackendChoice>(BACKENDS), help_heading = MACHINE)]
    backend: Option<BackendChoice>,
    /// GPU adapter to use: part of its name, or its number in `curvelax adapters` [default: the best]
    #[arg(long, value_name = "NAME", help_heading = MACHINE)]
    adapter: Option<String>,
    /// Number type [default: f64 where the device has it]
    #[arg(long, value_name = "TYPE", value_parser = word::<Precision>(PRECISIONS), help_heading = MACHINE)]
    precision: Option<Precision>,
    /// Threads of the CPU back end [default: all cores]
    #[arg(
        long, value_name = "COUNT", value_parser = whole::<usize>, allow_hyphen_values = true,
        help_heading = MACHINE
    )]
    threads: Option<usize>,

    /// Write events.csv: the first time at which each member meets a condition, NAME=OBSERVABLE<=LEVEL or >=LEVEL. A level
    /// is a number, or FACTOR*start. Observables are length, area, excess, energy, k_min, k_max, mesh_ratio (longest over
    /// shortest segment) and metric_drift (how far r has drifted from the lengths of the segments). For several events give it several times: --event 'convex = k_min >= 0' --event
    /// 'slow = excess <= 0.5 * start' [default: none]
    #[arg(
        long, value_name = "NAME=CONDITION", value_parser = text_of::<Event>, allow_hyphen_values = true,
        help_heading = OUTPUT
    )]
    event: Option<Vec<Event>>,
    /// Write series.csv: one row per member every DT [default: off]
    #[arg(long, value_name = "DT", value_parser = real, allow_hyphen_values = true, help_heading = OUTPUT)]
    series: Option<f64>,
    /// Write snapshots.csv: all nodes at these times [default: off]
    #[arg(
        long, value_name = "T1,T2,...", value_delimiter = ',', value_parser = real,
        allow_hyphen_values = true, help_heading = OUTPUT
    )]
    snapshots: Option<Vec<f64>>,
    /// Format of the snapshots: the table snapshots.csv, or the arrays of snapshots.zarr, for xarray
    /// [default: csv]
    #[arg(long, value_name = "HOW", value_parser = word::<Store>(STORES), help_heading = OUTPUT)]
    store: Option<Store>,
    /// Format of the tables: CSV, or Parquet next to the CSV files, which the other commands read [default: csv]
    #[arg(long, value_name = "HOW", value_parser = word::<Tables>(TABLES), help_heading = OUTPUT)]
    tables: Option<Tables>,
}

const ENSEMBLE: &str = "Ensemble";
const EVOLUTION: &str = "Evolution";
pub(super) const METHOD: &str = "Method";
pub(super) const MACHINE: &str = "Machine";
/// Heading of the flags for output.
pub const OUTPUT: &str = "Output";

/// Gives the fields of [`SpecFlags`] but the sweep to a macro: those of a key that always has a value, then the others.
/// They are matched against the whole type there, so that none is forgotten here.
macro_rules! every_flag {
    ($to:ident) => {
        $to! {
            curves points seed shape sampling amplitude modes decay perturbation design flow no_redistribution pull solver
            order sor max_sweeps backend snapshots store tables common_random_numbers refine event;
            energy diffusivity form outlines group_by interpolate rounding accuracy mobility units tau adaptive t_end omega stop_when_relaxed relax_to relax_at only shard tolerance adapter precision series threads
        }
    };
}

impl SpecFlags {
    /// Checks that no key is given by two flags. A sweep may replace a single value of the spec file.
    ///
    /// # Errors
    /// [`Error::Request`] for a key that is swept twice, or swept and given: the values of one flag would be lost.
    pub fn check_sweeps(&self) -> Result<()> {
        let twice = |(i, axis): (usize, &SweepAxis)| self.sweep[..i].iter().any(|other| other.key == axis.key);
        if let Some((_, SweepAxis { key, .. })) = self.sweep.iter().enumerate().find(|at| twice(*at)) {
            let key = echo(key);
            return Err(Error::Request(format!(
                "--sweep {key}: given twice; give all values at once, --sweep {key}=V1,V2"
            )));
        }
        let given = self.given();
        self.sweep.iter().try_for_each(|axis| sweep::check_not_given(&axis.key, &given))
    }

    /// The keys given as flags, without those that are swept.
    fn given(&self) -> Vec<String> {
        macro_rules! given {
            ($($key:ident)*; $($optional:ident)*) => {{
                let SpecFlags { sweep: _, accurate: _, $($key,)* $($optional,)* } = self;
                let all = [$((stringify!($key), $key.is_some()),)* $((stringify!($optional), $optional.is_some()),)*];
                all.into_iter().filter(|(_, given)| *given).map(|(key, _)| key.replace('_', "-")).collect()
            }};
        }
        every_flag!(given)
    }

    /// Replaces in `spec` the values given as flags.
    pub fn overlay(mut self, spec: &mut Spec) {
        std::mem::take(&mut self.sweep).into_iter().for_each(|axis| spec.sweep.set(axis));
        // A flag overrides the file, including the key that it excludes.
        if self.tau.is_some() || self.adaptive.is_some() {
            (spec.tau, spec.adaptive) = (None, None);
        }
        if self.relax_to.is_some() || self.relax_at.is_some() {
            (spec.relax_to, spec.relax_at) = (None, None);
        }
        if self.accurate {
            spec.make_accurate(&self.given());
        }
        spec.omitted.curves &= self.curves.is_none();
        spec.omitted.amplitude &= self.amplitude.is_none();
        macro_rules! replace {
            ($($key:ident)*; $($optional:ident)*) => {{
                let SpecFlags { sweep: _, accurate: _, $($key,)* $($optional,)* } = self;
                $(if let Some(value) = $key { spec.$key = value; })*
                $(if $optional.is_some() { spec.$optional = $optional; })*
            }};
        }
        every_flag!(replace)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::{backend::DeviceKind, solver::Solver};
    use clap::{Args, FromArgMatches};
    use serde::{Deserialize, de::value::StrDeserializer};

    fn command() -> clap::Command {
        SpecFlags::augment_args(clap::Command::new("test"))
    }

    fn parse(arguments: &[&str]) -> Spec {
        let matches = command().no_binary_name(true).try_get_matches_from(arguments).unwrap();
        let mut spec = Spec::default();
        SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec);
        spec
    }

    #[test]
    fn the_flags_are_the_keys_of_the_spec() {
        let flags: BTreeSet<String> = command().get_arguments().map(|a| a.get_long().unwrap().to_owned()).collect();
        // One flag stands for several keys.
        assert_eq!(flags, Spec::keys().into_iter().chain(["accurate".into()]).collect());
    }

    #[test]
    fn the_help_states_the_defaults_of_the_spec() {
        let filled = Spec::default().validate().unwrap();
        let defaults: toml::Table = toml::from_str(&filled.to_toml().unwrap()).unwrap();
        for argument in command().get_arguments() {
            let help = argument.get_help().unwrap().to_string();
            let stated = help.rsplit_once("[default: ").expect("a default").1.trim_end_matches(']');
            let Some(value) = defaults.get(argument.get_long().unwrap()) else { continue };
            let expected = match value {
                toml::Value::String(text) => text.clone(),
                toml::Value::Float(number) => number.to_string(),
                toml::Value::Array(list) if list.is_empty() => "off".into(),
                other => other.to_string(),
            };
            let stated = stated.split_once(" with --").map_or(stated, |(stated, _)| stated);
            assert_eq!(stated, expected, "{argument}");
        }
    }

    #[test]
    fn every_flag_replaces_its_key() {
        let spec = parse(
            "--curves 3 --outlines 4 --group-by kind --points 7 --seed 9 --sampling points --amplitude 0.5 --modes 1..=2 --decay 2 --perturbation gaussian --design lhs --flow willmore --mobility 2 --units um,h \
             --tau 1e-6 --t-end 1 --interpolate spline --rounding 0.01 --omega 0 --no-redistribution --pull 3 --form auto --solver direct --order lexicographic \
             --tolerance 1e-4 \
             --sor 1.5 --max-sweeps 10 --backend cpu --adapter a --precision f32 --relax-to 0.1 --stop-when-relaxed \
             --refine --accuracy 0.01 --event convex=k_min>=0 --series 0.1 --snapshots 0,1 --store zarr --tables parquet --only 1,2 --shard 0/2 --threads 2 --common-random-numbers \
             --sweep phase=1,2"
                .split_whitespace()
                .collect::<Vec<_>>()
                .as_slice(),
        );
        let (given, default) = (spec.to_toml().unwrap(), Spec::default().to_toml().unwrap());
        let default: BTreeSet<&str> = default.lines().filter(|line| !line.starts_with("shape")).collect();
        let kept: Vec<&str> = given.lines().filter(|line| default.contains(line)).collect();
        assert_eq!(kept, [""; 0]);
        // One key of each pair that excludes the other is left out.
        assert_eq!(given.lines().filter(|line| line.contains(" = ")).count(), Spec::keys().len() - 2);
        assert!(given.ends_with("[sweep]\nphase = [1, 2]\n"), "{given}");
    }

    #[test]
    fn a_flag_also_replaces_the_key_of_the_file_that_it_stands_instead_of() {
        let file = || Spec::from_toml("tau = 1e-4\nrelax-to = 0.1").unwrap();
        let overlaid = |arguments: &[&str], mut spec: Spec| {
            let matches = command().no_binary_name(true).try_get_matches_from(arguments).unwrap();
            SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec);
            spec
        };
        let spec = overlaid(&["--adaptive", "--relax-at", "0.01"], file());
        assert_eq!((spec.tau, spec.adaptive, spec.relax_to, spec.relax_at), (None, Some(1e-3), None, Some(0.01)));
        let spec = overlaid(&["--tau", "1e-5", "--relax-to", "0.2"], spec);
        assert_eq!((spec.tau, spec.adaptive, spec.relax_to, spec.relax_at), (Some(1e-5.into()), None, Some(0.2), None));
        assert_eq!(overlaid(&[], file()), file());
    }

    #[test]
    fn a_flag_that_is_not_given_replaces_nothing() {
        assert_eq!(parse(&[]), Spec::default());
    }

    #[test]
    fn a_switch_can_undo_the_file() {
        let mut spec = Spec { stop_when_relaxed: Some(true), ..Spec::default() };
        let matches = command().no_binary_name(true).try_get_matches_from(["--stop-when-relaxed=false"]).unwrap();
        SpecFlags::from_arg_matches(&matches).unwrap().overlay(&mut spec);
        assert_eq!(spec.stop_when_relaxed, Some(false));
    }

    #[test]
    fn the_words_of_a_flag_are_those_of_its_type() {
        fn words<T: for<'de> Deserialize<'de> + std::fmt::Debug>() -> Vec<String> {
            let refused = T::deserialize(StrDeserializer::<serde::de::value::Error>::new("")).unwrap_err().to_string();
            refused.split('`').skip(3).step_by(2).map(str::to_owned).collect()
        }
        assert_eq!(words::<Solver>(), Solver::NAMES);
        assert_eq!(words::<SolverChoice>(), SolverChoice::NAMES);
        assert_eq!(words::<Perturbation>(), PERTURBATIONS);
        assert_eq!(words::<PositionForm>(), FORMS);
        assert_eq!(words::<Design>(), DESIGNS);
        assert_eq!(words::<Order>(), ORDERS);
        assert_eq!(words::<BackendChoice>(), BACKENDS);
        assert_eq!(words::<DeviceKind>(), DeviceKind::NAMES);
        assert_eq!(words::<Precision>(), PRECISIONS);
        assert_eq!(words::<Store>(), STORES);
        assert_eq!(words::<Tables>(), TABLES);
        for name in SAMPLINGS {
            let sampling: Sampling = serde_json::from_value((*name).into()).unwrap();
            assert_eq!(serde_json::to_value(sampling).unwrap(), *name);
        }
    }
}
