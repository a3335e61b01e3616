//! The ensemble used for conformance tests: no two members alike, every flow, with and without redistribution.

use curvelax_backend::gpu::Variant;
use curvelax_base::error::Result;
use curvelax_curve::polygon;
use curvelax_ensemble::{Family, Spec, schedule::Ticks};
use curvelax_flow::{
    crystal::Crystal,
    flow::Flow,
    forcing::{Conserved, Drive, Forcing},
    number::{Precision, Real},
    scheme::{
        Parameters, State,
        run::{FIRST_ORDER, Run},
    },
};

/// Laws of the members: every named flow, and a polynomial.
pub const LAWS: usize = 4;

/// One member in this many keeps its nodes.
const UNDISTRIBUTED: usize = 5;
// Otherwise one law would only be compared without redistribution.
const _: () = assert!(!LAWS.is_multiple_of(UNDISTRIBUTED));

/// Members of the comparison: a prime number, so that no size divides it.
pub const MEMBERS: usize = 11;

/// τ of member 0, the largest: the paper's 10⁻³ at n = 100, and the same `τ/h⁴`, so the same number of sweeps,
/// at every n above 47.
fn tau(n: usize) -> f64 {
    1e-3 * (100.0 / n as f64).powi(4).min(20.0)
}

/// What drives the members of a comparison, and decides between kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driven {
    /// The paper's position equation.
    Paper,
    /// The force of the polygon.
    Geometric,
    /// That force, with an energy and a mobility that depend on the direction.
    Crystals,
    /// The force of the polygon and one besides the flow; or the area or the length is kept.
    Forced,
    /// A crystal and a driving force.
    ForcedCrystals,
}

impl Driven {
    /// What drives the members of a spec.
    pub fn of(spec: &Spec) -> Driven {
        match (spec.has_crystals(), spec.is_forced(), spec.is_geometric()) {
            (true, true, _) => Driven::ForcedCrystals,
            (true, false, _) => Driven::Crystals,
            (false, true, _) => Driven::Forced,
            (false, false, true) => Driven::Geometric,
            (false, false, false) => Driven::Paper,
        }
    }

    /// The variant of a kernel for it.
    pub fn variant(self, of_paper: Variant) -> Variant {
        Variant { geometric: self != Driven::Paper, crystal: self.is_crystal(), forced: self.is_forced(), ..of_paper }
    }

    fn is_crystal(self) -> bool {
        matches!(self, Driven::Crystals | Driven::ForcedCrystals)
    }

    fn is_forced(self) -> bool {
        matches!(self, Driven::Forced | Driven::ForcedCrystals)
    }

    /// Changes members of the comparison, which are the paper's.
    pub fn change(self, runs: &mut [Run<f64>]) {
        if self == Driven::Paper {
            return;
        }
        for (j, run) in runs.iter_mut().enumerate() {
            run.parameters.geometric = 1.0;
            if self.is_crystal() {
                become_crystal(run, CRYSTALS[j % CRYSTALS.len()]);
            }
            if self.is_forced() {
                become_forced(run, if self.is_crystal() { j % 2 } else { j % FORCINGS });
            }
        }
    }
}

/// Energies and mobilities of the members: one wave, two, one of each, and a mobility alone.
const CRYSTALS: [[&str; 2]; LAWS] = [
    ["cos:4,0.03,10", "cos:2,0"],
    ["cos:2,0.05+cos:3,0.03,20", "cos:2,0.3,15+cos:1,0.2"],
    ["cos:3,0.05", "cos:4,0.5"],
    ["cos:2,0", "cos:2,0.5,30"],
];

/// Gives a member, which is at its start, the law of a crystal and thresholds of its excess over the Wulff shape.
fn become_crystal(run: &mut Run<f64>, [energy, diffusivity]: [&str; 2]) {
    let energy = energy.parse().expect("an energy");
    let flow = Flow::Crystal(Crystal { energy, diffusivity: diffusivity.parse().expect("a mobility") });
    let (n, p) = (run.state.curve.len(), &mut run.parameters);
    p.law = flow.law(1.0);
    p.polygon_ratio = flow.equilibrium().least_quotient(n);
    p.growth = 0.0;
    if p.r_offset > 0.0 {
        p.compare_with(&run.state.curve.positions().collect::<Vec<_>>());
    }
    let now = Run::new(run.state.clone(), *p).report.now;
    (run.report.before, run.report.now) = (now, now);
    (p.relax_at, p.half_at) = (0.9 * now.excess, 0.95 * now.excess);
    (p.fit_from, p.fit_to) = (now.excess, 1e-3 * now.excess);
    if p.adaptive > 0.0 {
        p.follow_to = 1e-3 * now.excess;
    }
}

/// Forces and conserved quantities of the members, each with every law: a constant force, a feedback, the area, the
/// length and both.
const FORCINGS: usize = 5;

/// Lets one of them act on a member, which is at its start. What is kept is a little off at the start.
fn become_forced(run: &mut Run<f64>, which: usize) {
    let now = &run.report.now;
    let kept = [1.0003 * now.area, 0.9999 * now.length];
    let forcing = match which {
        0 => Forcing { drive: Some(Drive::Constant(0.25)), ..Forcing::default() },
        1 => Forcing { drive: Some(Drive::Feedback { gain: -0.1, area: 5.5 }), ..Forcing::default() },
        2 => Forcing { conserved: Some(Conserved::Area), kept, ..Forcing::default() },
        3 => Forcing { conserved: Some(Conserved::Length), kept, ..Forcing::default() },
        _ => Forcing { conserved: Some(Conserved::AreaAndLength), kept, ..Forcing::default() },
    };
    forcing.write(&mut run.parameters.law, 1.0);
    let now = Run::new(run.state.clone(), run.parameters).report.now;
    (run.report.before, run.report.now) = (now, now);
}

/// Creates `count` different members of `n` nodes, each with its own curve, flow, τ, ω and κ, to run `steps` steps.
pub fn members(n: usize, count: usize, steps: u32) -> Result<Vec<Run<f64>>> {
    let amplitude = if n < 20 { 0.02 } else { 0.05 };
    let spec = Spec { points: n, amplitude: amplitude.into(), seed: 20, ..Spec::default() };
    let family = Family::new(&spec)?;
    let flows: [Flow; LAWS] = [
        Flow::SurfaceDiffusion,
        Flow::Willmore,
        Flow::Elastic(0.3),
        Flow::Polynomial(vec![0.1, -0.2, 0.05, 0.0, -0.01]),
    ];
    (0..count)
        .map(|j| {
            let nodes = family.member(j as u64)?.nodes;
            let flow = &flows[j % LAWS];
            let excess = flow.equilibrium().excess(polygon::length(&nodes), polygon::signed_area(&nodes), n);
            let mut parameters = Parameters {
                omega: 1.0 + j as f64,
                redistribution: if j % UNDISTRIBUTED == 3 { 0.0 } else { 1.0 },
                // One member in three is pulled.
                pull: if j % 3 == 1 { 50.0 } else { 0.0 },
                tolerance: FIXED_SWEEPS,
                // One member in seven chooses its own factor.
                sor: if j % 7 == 5 { 0.0 } else { 1.0 + 0.07 * (j % 10) as f64 },
                polygon_ratio: flow.equilibrium().least_quotient(n),
                relax_at: 0.9 * excess,
                half_at: 0.95 * excess,
                // Even with few steps, a member leaves points for the fit.
                fit_from: excess,
                fit_to: 1e-3 * excess,
                clock_end: f64::from(steps),
                growth: if flow.growth(1.0).is_some() { 50.0 } else { 0.0 },
                ..Parameters::of_flow(flow, tau(n) * (1.0 - 0.05 * j as f64))
            };
            // Three members in five store lengths that are not whole.
            if j % 5 % 2 == 0 {
                parameters.compare_with(&nodes);
            }
            let mut run = Run::new(State::with_offset(&nodes, parameters.r_offset), parameters);
            run.counters.goal = steps;
            Ok(run)
        })
        .collect()
}

/// Returns the tolerance of adaptive steps that are compared. In f32 it is a large one: rounding, which is not the same
/// on all devices, must not decide how much a step may grow.
pub(super) fn adaptive_tolerance<T: Real>() -> f64 {
    (4e5 * T::EPSILON).max(1e-3)
}

/// Creates the same members with adaptive steps of `tolerance`, to the time of `steps` of their own fixed steps, for a
/// run in `precision`.
pub fn adaptive_members(
    n: usize,
    count: usize,
    steps: u32,
    tolerance: f64,
    precision: Precision,
) -> Result<Vec<Run<f64>>> {
    let mut runs = members(n, count, steps)?;
    for (j, run) in runs.iter_mut().enumerate() {
        let (p, progress) = (&mut run.parameters, &mut run.report.progress);
        let end = p.tau * f64::from(steps);
        let ticks = Ticks::new(end, precision);
        (p.adaptive, p.tolerance) = (tolerance, ADAPTIVE_SWEEPS);
        p.follow_to = 1e-3 * run.report.now.excess;
        p.clock_end = end;
        p.growth *= p.tau;
        (p.time_unit, p.time_tick) = (ticks.unit, ticks.tick);
        (p.end_high, p.end_low) = ticks.split(end);
        (p.goal_high, p.goal_low) = (p.end_high, p.end_low);
        // One member in four begins with a step that is far too long and is refused.
        progress.next = if j % 4 == 2 { end } else { 0.05 * p.tau };
        run.counters.goal = u32::MAX;
        run.counters.order = FIRST_ORDER;
    }
    Ok(runs)
}

/// Tolerance of the sweeps in fixed steps. Where a residual is near its tolerance, one side may make a few sweeps more
/// than the other, and the two differ by what they leave: less than the bounds, in f32, too.
const FIXED_SWEEPS: f64 = 1e-5;
/// The same in adaptive runs: so small that they go to their rounding limit, since combinations of rows amplify what
/// sweeps leave.
const ADAPTIVE_SWEEPS: f64 = 1e-13;
