//! The paper's figures: the data of each, and the run that makes it.
//!
//! *From the paper:* the curves and flows, n = 100, surface diffusion of the ellipse with τ = 10⁻³ on [0, 2], of the
//! nonconvex curve with τ = 10⁻⁶ and ω = 1 to t = 0.170, the astroid under Willmore flow at t = 0, 0.0005, 0.005, and
//! nodes at u = i/n. *Chosen here:* the times between the first and the last of a figure; ω = 1 for the ellipse, which
//! the paper does not print; and τ and the sampling of the astroid, because nodes at u = i/n crowd at the cusps and the
//! run fails at once.
//!
//! The systems are [solved directly](Solver::Direct); the paper uses Gauss–Seidel. Sweeps converge to the solution that
//! a direct solver returns at once, so the figures are the limit of infinitely many sweeps. `tests/it/figures.rs`
//! bounds the distance to sweeps of the default tolerance.

use crate::report::progress::Progress;
use curvelax_base::{
    error::{Error, Result},
    text::{number, power_of_ten},
};
use curvelax_curve::Sampling;
use curvelax_draw::plot::{Plot, PlotPanel, PlottedCurve};
use curvelax_ensemble::{
    Cell, Ended, Family, Sink, Spec,
    request::spec::{BackendChoice, Precision, Solver},
    simulate::simulate,
};
use curvelax_study::placement;

/// Nodes of every figure, as in the paper.
pub const POINTS: usize = 100;
/// Speed ω of the redistribution, in the figures that have any, in 1/time.
pub const OMEGA: f64 = 1.0;

/// One figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Figure {
    /// Its name on the command line and the name of its files.
    pub name: &'static str,
    /// What the figure shows.
    pub title: &'static str,
    /// A remark to read first.
    pub remark: &'static str,
    /// Initial curve, as in `--shape`.
    pub shape: &'static str,
    /// How nodes are placed on it.
    pub sampling: Sampling,
    /// Law of motion, as in `--flow`.
    pub flow: &'static str,
    /// Time step.
    pub tau: f64,
    /// Whether nodes are redistributed along the curve, with speed [`OMEGA`].
    pub redistribution: bool,
    /// Times shown, ascending; the run ends at the last.
    pub times: &'static [f64],
    /// Whether each time has a panel of its own.
    pub side_by_side: bool,
}

/// All figures, in the paper's order.
pub const FIGURES: [Figure; 4] = [
    Figure {
        name: "fig1a",
        title: "Figure 1a. Surface diffusion of an ellipse, without redistribution",
        remark: "nodes gather at the left and right, and top and bottom are left with few",
        shape: "ellipse:2,1",
        sampling: Sampling::Parameter,
        flow: "surface-diffusion",
        tau: 1e-3,
        redistribution: false,
        times: &[0.0, 0.05, 0.3, 2.0],
        side_by_side: false,
    },
    Figure {
        name: "fig1b",
        title: "Figure 1b. Surface diffusion of an ellipse, with redistribution",
        remark: "nodes end equally spaced",
        shape: "ellipse:2,1",
        sampling: Sampling::Parameter,
        flow: "surface-diffusion",
        tau: 1e-3,
        redistribution: true,
        times: &[0.0, 0.05, 0.3, 2.0],
        side_by_side: false,
    },
    Figure {
        name: "fig1c",
        title: "Figure 1c. Surface diffusion of a nonconvex curve",
        remark: "100 nodes at u = i/n are few for its bays, and it relaxes too fast: at t = 0.05 its excess is 0.063, and \
                 0.096 with 400 equally spaced nodes",
        shape: "nonconvex",
        sampling: Sampling::Parameter,
        flow: "surface-diffusion",
        tau: 1e-6,
        redistribution: true,
        times: &[0.0, 0.0005, 0.005, 0.02, 0.17],
        side_by_side: false,
    },
    Figure {
        name: "fig2",
        title: "Figure 2. Willmore flow of an astroid",
        remark: "a cusp has no finite bending energy, so the tips depend on n: at t = 0.0005 they are at 0.899, and at 0.911 with \
                 n = 200",
        shape: "astroid",
        sampling: Sampling::Arclength,
        flow: "willmore",
        tau: 1e-7,
        redistribution: true,
        times: &[0.0, 0.0005, 0.005],
        side_by_side: true,
    },
];

impl Figure {
    /// The run that makes the figure: one unperturbed member on the CPU, in f64 and solved directly, so that all
    /// machines with the same mathematical library give the same bits.
    pub fn spec(&self) -> Result<Spec> {
        let wrong = |message: String| Error::Request(format!("{}: {message}", self.name));
        Spec {
            curves: 1,
            points: POINTS,
            shape: self.shape.parse().map_err(wrong)?,
            sampling: self.sampling,
            amplitude: 0.0.into(),
            flow: self.flow.parse().map_err(wrong)?,
            tau: Some(self.tau.into()),
            t_end: Some(self.times.iter().copied().fold(0.0, f64::max).into()),
            omega: Some(OMEGA.into()),
            no_redistribution: !self.redistribution,
            solver: Solver::Direct.into(),
            backend: BackendChoice::Cpu,
            precision: Some(Precision::F64),
            threads: Some(1),
            snapshots: self.times.to_vec(),
            ..Spec::default()
        }
        .validate()
    }

    /// Runs `spec`: [the figure's own](Figure::spec), or a variation of it with the same snapshots.
    ///
    /// # Errors
    /// [`Error::Failed`] if the curve does not reach the last time.
    pub fn simulate(&self, spec: &Spec, progress: Progress) -> Result<Ended> {
        let family = Family::new(spec)?;
        let choice = placement::choose(spec)?;
        let precision = choice.precision;
        let (mut backend, _) = choice.open(spec)?;
        let mut only = Only { ended: None, progress };
        simulate(&[Cell::only(spec.clone(), family)], precision, backend.as_mut(), 0, &mut only)?;
        only.progress.finish();
        let ended = only.ended.ok_or_else(|| Error::Failed(format!("{}: no curve came back", self.name)))?;
        let Ended { outcome, rows, .. } = &ended;
        if outcome.status.is_failure() || rows.snapshots.len() != spec.snapshots.len() {
            let (status, t, steps) = (outcome.status.name(), outcome.t_end, outcome.steps);
            return Err(Error::Failed(format!("{}: the curve is {status} at t = {t} after {steps} steps", self.name)));
        }
        Ok(ended)
    }

    /// Draws the result of a run.
    pub fn plot(&self, ended: &Ended) -> Plot {
        let curves: Vec<PlottedCurve> =
            ended.rows.snapshots.iter().map(|s| PlottedCurve::at(s.t, &s.x, &s.y)).collect();
        let own = |curve: PlottedCurve| PlotPanel { heading: Some(curve.label.clone()), curves: vec![curve] };
        let panels = match self.side_by_side {
            true => curves.into_iter().map(own).collect(),
            false => vec![PlotPanel { heading: None, curves }],
        };
        Plot { title: self.title.into(), subtitle: self.parameters(), panels }
    }

    /// The parameters, in one line.
    pub fn parameters(&self) -> String {
        let Figure { tau, sampling, .. } = self;
        let nodes = match sampling {
            Sampling::Parameter => "initial nodes at u = i/n",
            Sampling::Arclength => "initial nodes equally spaced",
            Sampling::Points => "initial nodes given",
        };
        let redistribution = if self.redistribution { format!("ω = {OMEGA}") } else { "α = 0".into() };
        format!("n = {POINTS}, τ = {}, {redistribution}, {nodes}, solved directly", superscript(&number(*tau)))
    }
}

/// `10⁻⁶` for `1e-6`; other text unchanged.
fn superscript(number: &str) -> String {
    let power = number.strip_prefix('1').and_then(|rest| rest.strip_prefix('e')?.parse().ok());
    power.map_or_else(|| number.into(), power_of_ten)
}

/// Stores the only member of a run.
struct Only {
    ended: Option<Ended>,
    progress: Progress,
}

impl Sink for Only {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.ended = Some(ended.clone());
        Ok(())
    }

    fn progress(&mut self, done: u64, total: u64, share: f64) -> Result<()> {
        self.progress.show(done, total, share, "member");
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_figure_has_a_valid_spec_and_a_name_of_its_own() {
        for (i, figure) in FIGURES.iter().enumerate() {
            let spec = figure.spec().unwrap();
            assert!(Family::new(&spec).is_ok());
            assert_eq!(spec.snapshots, figure.times);
            assert_eq!((spec.backend, spec.precision), (BackendChoice::Cpu, Some(Precision::F64)));
            assert!(FIGURES[..i].iter().all(|other| other.name != figure.name));
        }
    }

    #[test]
    fn powers_of_ten_are_raised() {
        assert_eq!(["1e-6", "0.001", "2e-7", "1e-12"].map(superscript), ["10⁻⁶", "0.001", "2e-7", "10⁻¹²"]);
    }

    #[test]
    fn a_curve_that_fails_makes_no_figure() {
        let figure = &FIGURES[0];
        // Steps so long that the first merges nodes.
        let spec = Spec { shape: "nonconvex".parse().unwrap(), tau: Some(0.05.into()), ..figure.spec().unwrap() };
        let error = figure.simulate(&spec, Progress::Quiet).unwrap_err();
        assert_eq!(error.exit_code(), 1);
        assert!(error.to_string().starts_with("fig1a: the curve is "), "{error}");
    }
}
