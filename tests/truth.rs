//! The scheme against exact solutions, and its variants (sweeps, order, precision) against each other.
//!
//! Every test states the exact solution and prints what it measured. A bound that is missed means an error, not a
//! bound too tight.

mod common;

use curvelax::{
    backend::choose::MAX_POINTS_F32,
    curve::{Sampling, Shape, polygon},
    ensemble::{Family, Spec},
    flow::Flow,
    number::Real,
    scheme::{
        Parameters, State, Workspace, curvature,
        evolve::{Run, evolve},
        position, redistribution,
        step::{self, Method},
    },
    solver::{Blocks, Order, direct},
};
use glam::DVec2;

use common::{DIRECT, SWEEPS, Stepper, distance, ellipse, mode, radius, slope, wavy_circle};

/// Relative amplitude of a mode that still decays linearly.
const SMALL: f64 = 1e-3;

/// What the linear theory says at time `end`: the radius, from `R' = -b(1/R)`, and `∫ rate_m(R(t)) dt`.
fn linear_theory(flow: &Flow, radius: f64, m: u32, end: f64) -> (f64, f64) {
    let (steps, slope) = (1000, |r: f64| -flow.b(1.0 / r));
    let h = end / f64::from(steps);
    (0..steps).fold((radius, 0.0), |(r, decay), _| {
        let s1 = slope(r);
        let s2 = slope(r + 0.5 * h * s1);
        let s3 = slope(r + 0.5 * h * s2);
        let s4 = slope(r + h * s3);
        let after = r + h / 6.0 * (s1 + 2.0 * s2 + 2.0 * s3 + s4);
        let middle = r + 0.5 * h * s2;
        let rates = [r, middle, after].map(|r| flow.linear_rate(m, r));
        (after, decay + h / 6.0 * (rates[0] + 4.0 * rates[1] + rates[2]))
    })
}

/// Decay `ln(a(0)/a(T))` of mode m on a circle, T such that the theory says 1 at the first radius, over that theory.
fn decay_over_theory(flow: &Flow, radius: f64, m: u32, n: usize, steps: u32, mut step: impl FnMut(&mut Linear)) -> f64 {
    let end = 1.0 / flow.linear_rate(m, radius).abs();
    let nodes = wavy_circle(n, radius, m, SMALL);
    let p = Parameters::of_flow(flow, end / f64::from(steps));
    let mut curve = Linear { state: State::from_nodes(&nodes), work: Workspace::new(Blocks::new(n).unwrap()), p };
    (0..steps).for_each(|_| step(&mut curve));
    let after: Vec<DVec2> = curve.state.curve.positions().collect();
    (mode(&nodes, m) / mode(&after, m)).ln() / linear_theory(flow, radius, m, end).1
}

/// A circle with a small mode.
struct Linear {
    state: State<f64>,
    work: Workspace<f64>,
    p: Parameters<f64>,
}

fn correct_step(Linear { state, work, p }: &mut Linear) {
    step::step(&state.curve, &mut state.increments, p, &DIRECT, work);
    std::mem::swap(&mut state.curve, &mut work.new);
}

/// A step whose 𝓑_i has `φ(k_i) + φ(k_{i-1})`, as the paper prints it.
fn misprinted_step(Linear { state, work, p }: &mut Linear) {
    redistribution::redistribute(state, p, work);
    curvature::assemble(state, p, work);
    direct::solve(&work.curvature, [&mut work.dk]);
    (0..state.len()).for_each(|i| work.k[i] = state.k[i] + work.dk[i]);
    work.k.close();

    position::assemble(state, p, work);
    for i in 0..state.len() {
        let ([_, before, _, after, _], ir) = (work.k.window(i), work.ir[i]);
        let change = 0.5 * (p.phi(before) - p.phi(after)) * ir;
        let row = &mut work.position.rows[i];
        // The diagonal is q/τ minus the other entries, so it changes by as much the other way.
        let c = row.weight / (p.tau * work.iq[i]);
        let rescale = c / (c - change);
        for (rhs, old) in work.position.rhs.iter_mut().zip([&state.x, &state.y]) {
            let [_, before, here, ..] = old.window(i);
            rhs[i] = (rhs[i] - change / c * (before - here)) * rescale;
        }
        row.b += change / c;
        [row.a, row.b, row.d, row.e] = [row.a, row.b, row.d, row.e].map(|entry| entry * rescale);
    }
    direct::solve(&work.position, [&mut work.dx, &mut work.dy]);
    for i in 0..state.len() {
        work.x[i] = state.x[i] + work.dx[i];
        work.y[i] = state.y[i] + work.dy[i];
    }
    work.x.close();
    work.y.close();
    step::accept(state, work);
}

/// Surface diffusion of a circle: mode m decays like `exp(-m²(m²-1) t / R⁴)`.
#[test]
fn small_modes_of_a_circle_decay_at_the_rates_of_surface_diffusion() {
    for (m, radius) in [(2, 1.0), (3, 1.0), (4, 1.0), (2, 1.7)] {
        let [e50, e100, e200] =
            [50, 100, 200].map(|n| decay_over_theory(&Flow::SurfaceDiffusion, radius, m, n, 8000, correct_step) - 1.0);
        let orders = [(e50 / e100).log2(), (e100 / e200).log2()];
        eprintln!(
            "surface diffusion, R = {radius}, mode {m}: errors {e50:.2e} {e100:.2e} {e200:.2e}, orders {orders:.3?}"
        );
        assert!(e100.abs() < 0.02, "mode {m}: {e100:e}");
        assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.15), "mode {m}: orders {orders:?}");
    }
}

/// The negative control of the rates: they tell the paper's misprint from the scheme.
#[test]
fn the_misprint_of_the_paper_does_not_converge_to_the_rates() {
    for n in [50, 100, 200] {
        let ratio = decay_over_theory(&Flow::SurfaceDiffusion, 1.0, 2, n, 2000, misprinted_step);
        eprintln!("as printed, n = {n}: {ratio:.4} of the rate");
        assert!(ratio > 2.0, "n = {n}: {ratio}");
    }
}

/// Elastic flow: mode m on the steady circle decays with `(m²-1)²/R⁴`; the others by their linear rate along R(t).
#[test]
fn small_modes_decay_at_the_linear_rates_of_every_flow() {
    let elastic = |m: u32| f64::from((m * m - 1).pow(2));
    for m in [2, 3, 4] {
        assert!((Flow::Elastic(0.5).linear_rate(m, 1.0) - elastic(m)).abs() < 1e-12);
    }
    let flows =
        [Flow::Elastic(0.5), Flow::Willmore, Flow::Polynomial(vec![0.4]), Flow::Polynomial(vec![0.3, -0.2, 0.1, 0.05])];
    for flow in flows {
        for m in [2, 3, 4] {
            let error = decay_over_theory(&flow, 1.0, m, 100, 4000, correct_step) - 1.0;
            eprintln!("{flow}, mode {m}: {error:.2e}");
            assert!(error.abs() < 0.02, "{flow}, mode {m}: {error:e}");
        }
    }
}

/// `R(t) = (R₀⁴ + 2t)^(1/4)`, and for modes `(1 + 2t/R₀⁴)^(-(m²-1)(m²-3/2)/2)`: what the theory used above gives.
#[test]
fn the_linear_theory_of_willmore_flow_is_the_closed_form() {
    for (m, end) in [(2, 0.1), (3, 0.02)] {
        let (radius, decay) = linear_theory(&Flow::Willmore, 1.0, m, end);
        let m2 = f64::from(m * m);
        let exact = 0.5 * (m2 - 1.0) * (m2 - 1.5) * (1.0 + 2.0 * end).ln();
        assert!((radius - (1.0 + 2.0 * end).powf(0.25)).abs() < 1e-12, "{radius}");
        assert!((decay / exact - 1.0).abs() < 1e-8, "mode {m}: {decay} instead of {exact}");
    }
}

/// Willmore flow of the unit circle, `R(1) = 3^(1/4)`, with τ = h²: order 2.
#[test]
fn the_willmore_circle_grows_as_it_should_with_order_two() {
    let exact = 3.0_f64.powf(0.25);
    let errors = [10, 20, 40, 80, 160].map(|n| {
        let p = Parameters::of_flow(&Flow::Willmore, 1.0 / (n * n) as f64);
        let curve = Stepper::<f64>::new(&wavy_circle(n, 1.0, 2, 0.0), &p, DIRECT).steps(n * n);
        (n, (radius(&curve.positions()) - exact).abs())
    });
    let order = -slope(&errors.map(|(n, error)| ((n as f64).ln(), error.ln())));
    eprintln!("Willmore circle: {errors:?}, order {order:.4}");
    assert!((order - 2.0).abs() < 0.05, "order {order}");
    for ((n, error), published) in errors.into_iter().zip([2.47e-2, 6.2e-3, 1.56e-3, 3.9e-4]) {
        assert!((error / published - 1.0).abs() < 0.02, "n = {n}: {error:e} instead of {published:e}");
    }
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

/// The paper's ellipse at t = 2.
fn paper_ellipse<T: Real>(method: Method, tolerance: f64) -> Vec<DVec2> {
    let p = Parameters { tolerance, ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3) };
    Stepper::<T>::new(&ellipse(100), &p, method).steps(2000).positions()
}

#[test]
fn sweeps_to_a_residual_agree_with_the_direct_solve() {
    let exact = paper_ellipse::<f64>(DIRECT, 1e-5);
    let lexicographic = Method { order: Order::Lexicographic, ..SWEEPS };
    for (method, tolerance, bound) in [(SWEEPS, 1e-5, 1e-5), (SWEEPS, 1e-8, 1e-7), (lexicographic, 1e-5, 1e-5)] {
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

/// Elastic flow: the circle `R = 1/√(2λ)` is steady, that of the scheme being off by O(h²).
#[test]
fn the_circle_that_balances_bending_and_length_stays() {
    for lambda in [0.5, 2.0, 0.1] {
        let steady = (2.0_f64 * lambda).sqrt().recip();
        let p = Parameters::of_flow(&Flow::Elastic(lambda), 1e-3 * steady.powi(4));
        let drifts = [50, 100, 200].map(|n| {
            let curve = Stepper::<f64>::new(&wavy_circle(n, steady, 2, 0.0), &p, DIRECT).steps(2000);
            radius(&curve.positions()) / steady - 1.0
        });
        let orders = [(drifts[0] / drifts[1]).log2(), (drifts[1] / drifts[2]).log2()];
        eprintln!("λ = {lambda}: the steady circle drifts by {drifts:?}, orders {orders:.3?}");
        assert!(drifts[1].abs() < 1e-3, "λ = {lambda}: {drifts:?}");
        assert!(orders.iter().all(|order| (order - 2.0).abs() < 0.05), "λ = {lambda}: {orders:?}");
    }
}

/// The energies that the flows are gradients of: length, `½∮k²` and `∮(½k² + λ)`.
#[test]
fn every_gradient_flow_lowers_its_energy_at_every_step() {
    for (flow, steps) in [(Flow::SurfaceDiffusion, 1000), (Flow::Willmore, 1000), (Flow::Elastic(0.5), 1000)] {
        let mut curve = Stepper::<f64>::new(&ellipse(100), &Parameters::of_flow(&flow, 1e-3), DIRECT);
        let energy = |curve: &Stepper<f64>| match flow {
            Flow::SurfaceDiffusion => curve.sums().length,
            _ => curve.sums().energy,
        };
        let (start, mut before) = (energy(&curve), energy(&curve));
        for step in 1..=steps {
            curve.step();
            let after = energy(&curve);
            assert!(after < before * (1.0 + 1e-13), "{flow}, step {step}: {before} to {after}");
            before = after;
        }
        eprintln!("{flow}: energy from {start:.6} to {before:.6}");
        assert!(before < 0.95 * start);
    }
}

/// Nodes at t = 1, and t_relax, of the 2:1 ellipse.
fn relaxed_ellipse<T: Real>(n: usize, method: &Method, tolerance: f64) -> (Vec<DVec2>, f64) {
    let shape = Shape::Ellipse { a: 2.0, b: 1.0 };
    let spec = Spec { shape, sampling: Sampling::Arclength, points: n, amplitude: 0.0, ..Spec::default() };
    let nodes = Family::new(&spec).unwrap().member(0).unwrap().nodes;
    let excess = polygon::excess(&nodes);
    let parameters = Parameters {
        tolerance,
        polygon_ratio: polygon::regular_ratio(n),
        relax_at: 0.01 * excess,
        half_at: 0.5 * excess,
        ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3)
    };
    let launch = Launch { nodes, parameters, goal: 1000, stop_when_relaxed: false, excess, turning: 1 };
    let (mut run, mut work) = (Run::<T>::new(&launch), Workspace::new(Blocks::new(n).unwrap()));
    evolve(&mut run, method, &mut work, 1000);
    assert_eq!((run.counters.status, run.counters.steps), (0, 1000), "n = {n}");
    let t_relax = (f64::from(run.counters.relax_step) + run.report.relax_fraction.to_f64()) * 1e-3;
    (run.state.positions().collect(), t_relax)
}

/// Errors of f32 in positions (over the radius 2) and in t_relax (relative).
fn f32_errors(n: usize) -> [f64; 2] {
    let (exact, exact_time) = relaxed_ellipse::<f64>(n, &DIRECT, 1e-5);
    let (found, time) = relaxed_ellipse::<f32>(n, &SWEEPS, 1e-3);
    let errors = [distance(&found, &exact), time / exact_time - 1.0];
    eprintln!("f32, n = {n}: positions {:.2e}, t_relax {:.2e} relative of {exact_time:.5}", errors[0], errors[1]);
    errors
}

/// f32 is as good as its documents say at n nodes.
fn assert_f32_follows(n: usize) {
    let [positions, t_relax] = f32_errors(n);
    assert!(positions <= 5e-4 && t_relax.abs() <= 1e-3, "n = {n}: {positions:e}, {t_relax:e}");
}

#[test]
fn single_precision_follows_double_as_n_grows() {
    [100, 200, 257].into_iter().for_each(assert_f32_follows);
}

#[test]
#[ignore = "takes a minute: cargo test --release --test truth -- --ignored --nocapture"]
fn single_precision_follows_double_up_to_its_limit() {
    assert_f32_follows(MAX_POINTS_F32);
    f32_errors(400);
}
