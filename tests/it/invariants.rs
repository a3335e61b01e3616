//! Quantities that must stay, fall, or not matter: conserved areas, decreasing energies, rigid motions, scaling,
//! solvers, precision, and the work of a run.
//!
//! Every test prints its measurements.

use std::f64::consts::TAU;

use curvelax::scheme::evolve::Evolves;
use curvelax::{
    curve::{BaseCurve, Sampling, Shape, polygon},
    ensemble::{
        Cell, Ended, Family, Outcome, Sink, Spec, Status,
        request::spec::{BackendChoice, OrAuto, Precision, Solver, SolverChoice},
    },
    equilibrium::Equilibrium,
    flow::Flow,
    placement::{self, MAX_POINTS_F32},
    scheme::{Parameters, State, evolve::Team, run::Run, step::Method},
    simulate::simulate,
    solver::{Blocks, Order},
};
use glam::DVec2;

use crate::common::{DIRECT, SWEEPS, Stepper, distance, ellipse, nodes};

/// Stores the only member of a run.
struct Last(Option<Ended>);

impl Sink for Last {
    fn member(&mut self, ended: &Ended) -> curvelax::Result<()> {
        self.0 = Some(ended.clone());
        Ok(())
    }
}

/// The outcome of `curve`, and its last nodes.
fn relaxed(spec: &Spec, curve: impl Fn(f64) -> DVec2 + Send + Sync + 'static) -> (Outcome, Vec<DVec2>) {
    let spec = spec.clone().validate().unwrap();
    let family = Family::of(&spec, BaseCurve::from_formula(curve)).unwrap();
    let choice = placement::choose(&spec).unwrap();
    let precision = choice.precision;
    let (mut backend, _) = choice.open(&spec).unwrap();
    let mut last = Last(None);
    simulate(&[Cell::only(spec, family)], precision, backend.as_mut(), 1, &mut last).unwrap();
    let ended = last.0.unwrap();
    let status = ended.outcome.status;
    assert!(matches!(status, Status::Relaxed | Status::Unfinished), "{status:?}");
    (ended.outcome, ended.portrait.unwrap().after)
}

/// A curve without any symmetry, about as large as the unit circle. Its sines are not those of the system, so that it
/// has the same bits on every machine.
fn potato(u: f64) -> DVec2 {
    let theta = TAU * u;
    let wave = |m: f64, a: f64, phase: f64| a * libm::cos(m * theta + phase);
    DVec2::new(libm::cos(theta), libm::sin(theta))
        * (1.0 + wave(2.0, 0.2, 0.0) + wave(3.0, 0.1, 0.5) + wave(5.0, 0.05, 1.0))
}

/// The fixed step of `spec`, `factor` times as long.
fn times(spec: &Spec, factor: f64) -> Option<OrAuto> {
    let Some(OrAuto::Number(tau)) = spec.tau else { panic!("no fixed step: {spec:?}") };
    Some(OrAuto::Number(factor * tau))
}

/// 100 steps, in which the curve loses its shorter waves.
fn method(precision: Precision, solver: Solver) -> Spec {
    Spec {
        curves: 1,
        points: 61,
        sampling: Sampling::Parameter,
        amplitude: 0.0.into(),
        flow: Flow::Elastic(0.4).into(),
        tau: Some(1e-4.into()),
        t_end: Some(1e-2.into()),
        backend: BackendChoice::Cpu,
        precision: Some(precision),
        solver: solver.into(),
        ..Spec::default()
    }
}

/// Every precision and solver, with the distance that rounding may cause between two results, and the distance if
/// sweeps may also end at different points within their tolerance.
const METHODS: [(Precision, Solver, f64, f64); 4] = [
    (Precision::F64, Solver::Direct, 2e-13, 2e-13),
    (Precision::F64, Solver::GaussSeidel, 2e-13, 5e-7),
    (Precision::F32, Solver::Direct, 2e-6, 2e-6),
    (Precision::F32, Solver::GaussSeidel, 2e-6, 2e-5),
];

/// Asserts that the nodes are where they are expected, and not where they would be without the motion.
#[track_caller]
fn assert_moved(what: &str, expected: &[DVec2], found: &[DVec2], unmoved: &[DVec2], bound: f64) {
    let apart = distance(expected, found);
    eprintln!("{what}: {apart:.2e}");
    assert!(apart <= bound, "{what}: {apart:e} above {bound:e}");
    assert!(distance(unmoved, found) > 0.1, "{what}: nothing moved");
}

#[test]
fn motions_of_the_plane_move_the_result() {
    let spin = DVec2::from_angle(0.7);
    let shift = DVec2::new(300.0, -70.0);
    for (precision, solver, rounding, tolerance) in METHODS {
        let spec = method(precision, solver);
        let (_, plain) = relaxed(&spec, potato);
        let moved = |motion: fn(DVec2, DVec2) -> DVec2, by: DVec2| {
            let (_, nodes) = relaxed(&spec, move |u| motion(by, potato(u)));
            let expected: Vec<DVec2> = plain.iter().map(|node| motion(by, *node)).collect();
            (expected, nodes)
        };
        let what = |motion| format!("{precision:?} {solver:?}, {motion}");
        let (expected, nodes) = moved(|by, node| node + by, shift);
        assert_moved(&what("translation"), &expected, &nodes, &plain, rounding);
        // The largest residual in x or y depends on the axes.
        let (expected, nodes) = moved(|by, node| by.rotate(node), spin);
        assert_moved(&what("rotation"), &expected, &nodes, &plain, tolerance);
    }
}

/// A mirrored curve, traversed in the opposite direction so that it stays counter-clockwise, with the same last node,
/// which α does not move.
#[test]
fn a_mirror_mirrors_the_result() {
    let mirror = |node: DVec2| DVec2::new(-node.x, node.y);
    for (precision, solver, _, tolerance) in METHODS {
        let spec = method(precision, solver);
        let (_, plain) = relaxed(&spec, potato);
        let (_, nodes) = relaxed(&spec, move |u| mirror(potato(1.0 - u)));
        let n = plain.len();
        let expected: Vec<DVec2> = (1..=n).map(|i| mirror(plain[(2 * n - i - 1) % n])).collect();
        assert_moved(&format!("{precision:?} {solver:?}, mirror"), &expected, &nodes, &plain, tolerance);
    }
}

/// Lengths scale by c, so times by c⁴, ω by c⁻⁴ and λ by c⁻². Powers of two change no digit.
#[test]
fn a_larger_curve_is_slower_by_the_fourth_power() {
    for (precision, solver, rounding, _) in METHODS {
        let spec = method(precision, solver);
        let (outcome, plain) = relaxed(&spec, potato);
        for (c, bound) in [(2.0_f64, 0.0), (0.25, 0.0), (3.0, rounding)] {
            let scaled = Spec {
                tau: times(&spec, c.powi(4)),
                t_end: Some((spec.final_time() * c.powi(4)).into()),
                omega: Some(OrAuto::Number(1.0 / c.powi(4))),
                flow: Flow::Elastic(0.4 / (c * c)).into(),
                ..spec.clone()
            };
            let (large, nodes) = relaxed(&scaled, move |u| c * potato(u));
            let expected: Vec<DVec2> = plain.iter().map(|node| *node * c).collect();
            assert_moved(&format!("{precision:?} {solver:?}, scaled by {c}"), &expected, &nodes, &plain, bound * c);
            if bound == 0.0 {
                assert_eq!((large.sweeps_k, large.sweeps_x), (outcome.sweeps_k, outcome.sweeps_x));
                assert_eq!(large.t_half.map(|t| t / c.powi(4)), outcome.t_half);
            }
        }
        // The negative control: times scaled by c³ give a different curve.
        let (_, wrong) = relaxed(
            &Spec { tau: times(&spec, 8.0), t_end: Some((spec.final_time() * 8.0).into()), ..spec.clone() },
            |u| 2.0 * potato(u),
        );
        assert!(distance(&plain, &wrong.iter().map(|node| *node / 2.0).collect::<Vec<_>>()) > 1e-3);
    }
}

/// Adaptive steps and the pull choose their lengths and rates by the curve's own scale, and undergo the same motions.
#[test]
fn adaptive_steps_and_the_pull_scale_and_move_with_the_curve() {
    for (precision, bound) in [(Precision::F64, 1e-9), (Precision::F32, 1e-4)] {
        let fixed = method(precision, Solver::Direct);
        let (omega, pull) = (Some(OrAuto::Auto), OrAuto::Auto);
        let spec = Spec {
            tau: None,
            adaptive: Some(1e-3),
            omega,
            pull,
            t_end: Some(0.1.into()),
            relax_to: Some(0.5),
            ..fixed
        };
        let (outcome, plain) = relaxed(&spec, potato);
        assert!(outcome.steps > 8 && outcome.t_relax.is_some());
        for c in [2.0_f64, 0.25, 3.0] {
            let flow = Flow::Elastic(0.4 / (c * c)).into();
            let t_end = Some((spec.final_time() * c.powi(4)).into());
            let (large, nodes) = relaxed(&Spec { t_end, flow, ..spec.clone() }, move |u| c * potato(u));
            let expected: Vec<DVec2> = plain.iter().map(|node| *node * c).collect();
            let rounding = if c == 3.0 { bound * c } else { 0.0 };
            assert_moved(&format!("{precision:?} adaptive, scaled by {c}"), &expected, &nodes, &plain, rounding);
            let [a, b] = [outcome.t_relax, large.t_relax.map(|t| t / c.powi(4))].map(Option::unwrap);
            assert!((a - b).abs() <= rounding, "{a} and {b}");
            // In f32, roundings decide on a step now and then.
            assert!(large.steps == outcome.steps || (c == 3.0 && precision == Precision::F32), "{c}: {}", large.steps);
        }
        // The negative controls: an unscaled ω and an unscaled pull make a difference.
        let fixed = Spec { omega: Some(OrAuto::Number(1.0)), ..spec.clone() };
        let (_, slow) = relaxed(&fixed, potato);
        let flow = Flow::Elastic(0.1).into();
        let (_, large) =
            relaxed(&Spec { t_end: Some((16.0 * spec.final_time()).into()), flow, ..fixed }, |u| 2.0 * potato(u));
        assert!(distance(&slow, &large.iter().map(|node| *node / 2.0).collect::<Vec<_>>()) > 1e-6);
        let rate = OrAuto::Number(40.0);
        let (_, pulled) = relaxed(&Spec { pull: rate, ..spec.clone() }, potato);
        let (t_end, flow) = (Some((16.0 * spec.final_time()).into()), Flow::Elastic(0.1).into());
        let (_, large) = relaxed(&Spec { t_end, flow, pull: rate, ..spec.clone() }, |u| 2.0 * potato(u));
        assert!(distance(&pulled, &large.iter().map(|node| *node / 2.0).collect::<Vec<_>>()) > 1e-6);

        let spin = DVec2::from_angle(0.7);
        let (_, nodes) = relaxed(&spec, move |u| spin.rotate(potato(u)) + DVec2::new(30.0, -7.0));
        let expected: Vec<DVec2> = plain.iter().map(|node| spin.rotate(*node) + DVec2::new(30.0, -7.0)).collect();
        assert_moved(&format!("{precision:?} adaptive, moved"), &expected, &nodes, &plain, bound);
    }
}

/// The choice of the first node matters only through α, which moves nodes along the curve: without it not at all, with
/// it by the error of the scheme, which falls as h².
#[test]
fn the_first_node_does_not_matter() {
    let shift = 17;
    for (precision, solver, _, tolerance) in METHODS {
        // Colours are counted from the first node.
        let spec = Spec { no_redistribution: true, ..method(precision, solver) };
        let (_, plain) = relaxed(&spec, potato);
        let (_, nodes) = relaxed(&spec, move |u| potato((u + shift as f64 / 61.0).fract()));
        let expected: Vec<DVec2> = (0..61).map(|i| plain[(i + shift) % 61]).collect();
        assert_moved(&format!("{precision:?} {solver:?}, first node, α = 0"), &expected, &nodes, &plain, tolerance);
    }
    let difference = |n: usize| {
        let spec =
            Spec { points: n, tau: Some((0.36 / (n * n) as f64).into()), ..method(Precision::F64, Solver::Direct) };
        let (plain, _) = relaxed(&spec, potato);
        let (other, _) = relaxed(&spec, |u| potato((u + 0.25).fract()));
        let relative = |a: f64, b: f64| (a / b - 1.0).abs();
        relative(plain.end.length, other.end.length).max(relative(plain.end.area, other.end.area))
    };
    let [coarse, fine] = [60, 120].map(difference);
    eprintln!("first node, with redistribution: length and area differ by {coarse:.2e} and {fine:.2e}");
    assert!(coarse < 1e-4 && fine < 0.3 * coarse, "{coarse:e} {fine:e}");
}

/// Steps and sweeps of a few runs, which are deterministic: if they change, the program has changed.
#[test]
fn the_work_of_a_run_is_what_it_was() {
    let spec = |flow: Flow, n, sor| Spec {
        points: n,
        flow: flow.into(),
        sor: Some(OrAuto::Number(sor)),
        tau: Some(1e-3.into()),
        t_end: Some(0.1.into()),
        ..method(Precision::F64, Solver::GaussSeidel)
    };
    let direct = Spec { solver: Solver::Direct.into(), ..spec(Flow::Willmore, 61, 1.0) };
    let adaptive =
        Spec { tau: None, adaptive: Some(1e-3), solver: SolverChoice::Auto, ..spec(Flow::Willmore, 61, 1.0) };
    let adaptive = Spec { omega: Some(OrAuto::Number(1.0)), ..adaptive };
    let swept = Spec { solver: Solver::GaussSeidel.into(), ..adaptive.clone() };
    let automatic = Spec { sor: Some(OrAuto::Auto), ..spec(Flow::SurfaceDiffusion, 100, 1.0) };
    let stops =
        Spec { stop_when_relaxed: Some(true), t_end: Some(2.0.into()), ..spec(Flow::SurfaceDiffusion, 50, 1.7) };
    let mut changed = Vec::new();
    for (name, spec, expected) in [
        ("surface diffusion", spec(Flow::SurfaceDiffusion, 100, 1.0), [100, 281616, 259784]),
        ("Willmore flow, over-relaxed", spec(Flow::Willmore, 61, 1.7), [100, 11672, 10592]),
        (
            "elastic flow, lexicographic",
            Spec { order: Order::Lexicographic, ..spec(Flow::Elastic(0.4), 61, 1.0) },
            [100, 32016, 29680],
        ),
        ("until relaxed", stops, [192, 12632, 11640]),
        ("direct", direct, [100, 0, 0]),
        ("over-relaxed as it chooses", automatic, [100, 53704, 49456]),
        ("adaptive", adaptive, [14, 0, 0]),
        ("adaptive, by sweeps", swept, [14, 242160, 239456]),
    ] {
        let (outcome, _) = relaxed(&spec, potato);
        let work = [outcome.steps, outcome.sweeps_k, outcome.sweeps_x];
        eprintln!("{name}: {work:?}");
        changed.extend((work != expected).then_some((name, work)));
    }
    assert_eq!(changed, []);
}

/// Surface diffusion conserves the area.
#[test]
fn the_area_of_the_paper_s_ellipse_is_kept() {
    let p = Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3);
    for (name, method) in [("direct", DIRECT), ("Gauss-Seidel", SWEEPS)] {
        let mut curve = Stepper::<f64>::new(&ellipse(100), &p, method);
        let start = curve.sums().area;
        let mut drift = 0.0_f64;
        for _ in 0..2000 {
            curve.step();
            drift = drift.max((curve.sums().area / start - 1.0).abs());
        }
        eprintln!("area drift, {name}: {drift:.3e}, {:.3e} in the end", curve.sums().area / start - 1.0);
        assert!(drift <= 4e-4, "{name}: {drift:e}");
    }
}

/// Each flow is the gradient flow of its energy: length, `½∮k²` and `∮(½k² + λ)`.
#[test]
fn every_gradient_flow_lowers_its_energy_at_every_step() {
    let potato = nodes(100, |u| potato(u / TAU));
    for flow in [Flow::SurfaceDiffusion, Flow::Willmore, Flow::Elastic(0.5)] {
        for (name, nodes, tau) in [("ellipse", ellipse(100), 1e-3), ("potato", potato.clone(), 1e-4)] {
            let mut curve = Stepper::<f64>::new(&nodes, &Parameters::of_flow(&flow, tau), DIRECT);
            let energy = |curve: &Stepper<f64>| match flow {
                Flow::SurfaceDiffusion => curve.sums().length,
                _ => curve.sums().energy,
            };
            let (start, mut before) = (energy(&curve), energy(&curve));
            for step in 1..=1000 {
                curve.step();
                let after = energy(&curve);
                assert!(after < before * (1.0 + 1e-13), "{flow}, {name}, step {step}: {before} to {after}");
                before = after;
            }
            eprintln!("{flow}, {name}: energy from {start:.6} to {before:.6}");
            assert!(before < 0.97 * start);
        }
    }
}

/// The negative control: other quantities do not fall. Surface diffusion does not lower the area, and Willmore flow
/// lengthens curves.
#[test]
fn what_is_no_energy_of_a_flow_does_not_fall() {
    let p = Parameters::of_flow(&Flow::Willmore, 1e-3);
    let curve = Stepper::<f64>::new(&ellipse(100), &p, DIRECT);
    let start = curve.sums().length;
    let end = curve.steps(1000).sums().length;
    assert!(end > 1.05 * start, "{start} to {end}");
}

/// The paper's ellipse at t = 2.
fn paper_ellipse<T: Evolves>(method: Method, tolerance: f64) -> Vec<DVec2> {
    let p = Parameters { tolerance, ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3) };
    Stepper::<T>::new(&ellipse(100), &p, method).steps(2000).positions()
}

#[test]
fn sweeps_to_a_residual_agree_with_the_direct_solve() {
    let exact = paper_ellipse::<f64>(DIRECT, 1e-5);
    let lexicographic = Method { order: Order::Lexicographic, ..SWEEPS };
    for (method, tolerance, bound) in [(SWEEPS, 2e-6, 2e-6), (SWEEPS, 1e-8, 1e-7), (lexicographic, 2e-6, 2e-6)] {
        let apart = distance(&paper_ellipse::<f64>(method, tolerance), &exact);
        eprintln!("{:?} sweeps, tolerance {tolerance:e}: {apart:.2e} from the direct solve", method.order);
        assert!(apart <= bound, "{:?}, tolerance {tolerance:e}: {apart:e}", method.order);
    }
}

#[test]
fn single_precision_agrees_with_double_on_the_paper_s_ellipse() {
    let apart = distance(&paper_ellipse::<f32>(SWEEPS, 1e-3), &paper_ellipse::<f64>(DIRECT, 1e-5));
    eprintln!("f32 sweeps: {apart:.2e} from f64");
    assert!(apart <= 5e-4, "{apart:e}");
}

/// Nodes at t = 1, and t_relax, of the 2:1 ellipse.
fn relaxed_ellipse<T: Evolves>(n: usize, method: &Method, tolerance: f64) -> (Vec<DVec2>, f64) {
    let shape = Shape::Ellipse { a: 2.0, b: 1.0 }.into();
    let spec = Spec { shape, sampling: Sampling::Arclength, points: n, amplitude: 0.0.into(), ..Spec::default() };
    let nodes = Family::new(&spec).unwrap().member(0).unwrap().nodes;
    let excess = Equilibrium::Circle.excess(polygon::length(&nodes), polygon::signed_area(&nodes), n);
    let parameters = Parameters {
        tolerance,
        polygon_ratio: Equilibrium::Circle.least_quotient(n),
        relax_at: 0.01 * excess,
        half_at: 0.5 * excess,
        ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3)
    };
    let mut run: Run<T> = Run::<f64>::new(State::from_nodes(&nodes), parameters).convert();
    run.counters.goal = 1000;
    let mut work = Team::new(Blocks::new(n).unwrap());
    Evolves::evolve(&mut run, method, &mut work, 1000);
    assert_eq!((run.counters.status, run.counters.steps), (0, 1000), "n = {n}");
    let t_relax = (f64::from(run.counters.relax_step) + run.report.progress.relax_fraction.to_f64()) * 1e-3;
    (run.state.curve.positions().collect(), t_relax)
}

/// Errors of f32 in positions (over the radius 2) and in t_relax (relative).
fn f32_errors(n: usize) -> [f64; 2] {
    let (exact, exact_time) = relaxed_ellipse::<f64>(n, &DIRECT, 1e-5);
    let (found, time) = relaxed_ellipse::<f32>(n, &SWEEPS, 1e-3);
    let errors = [distance(&found, &exact), time / exact_time - 1.0];
    eprintln!("f32, n = {n}: positions {:.2e}, t_relax {:.2e} relative of {exact_time:.5}", errors[0], errors[1]);
    errors
}

/// Asserts that f32 is as good at n nodes as the documents say.
fn assert_f32_follows(n: usize) {
    let [positions, t_relax] = f32_errors(n);
    assert!(positions <= 5e-4 && t_relax.abs() <= 1e-3, "n = {n}: {positions:e}, {t_relax:e}");
}

#[test]
fn single_precision_follows_double_as_n_grows() {
    [100, 200, 257].into_iter().for_each(assert_f32_follows);
}

#[test]
#[ignore = "takes a minute: cargo test --release --test it invariants -- --ignored --nocapture"]
fn single_precision_follows_double_up_to_its_limit() {
    assert_f32_follows(320);
    // Sweeps stop at their floor.
    let [positions, t_relax] = f32_errors(MAX_POINTS_F32);
    assert!(positions <= 5e-4 && t_relax.abs() <= 1.5e-3, "{positions:e}, {t_relax:e}");
}
