//! Relaxation times of adaptive runs in f32 against those of the same runs in f64.

use std::f64::consts::{PI, TAU};

use curvelax_flow::{
    flow::Flow,
    scheme::{
        Parameters, State,
        evolve::{Evolves, Team, evolve},
        extrapolation::MOST_ORDER_F32,
        member::{NEVER, Observed},
        run::Run,
        step::Method,
    },
    solver::{Blocks, Solver},
};
use glam::DVec2;

/// An ellipse with evenly spaced nodes and a semi-minor axis of 1.
fn ellipse(n: usize, a: f64) -> Vec<DVec2> {
    let fine = 100_000;
    let at = |place: f64| DVec2::new(a * (TAU * place / f64::from(fine)).cos(), (TAU * place / f64::from(fine)).sin());
    let mut so_far = vec![0.0];
    for j in 0..fine {
        so_far.push(so_far[j as usize] + at(j.into()).distance(at(f64::from(j + 1))));
    }
    let node = |i: usize| {
        let wanted = so_far[fine as usize] * i as f64 / n as f64;
        let after = so_far.partition_point(|s| *s <= wanted).min(fine as usize);
        let share = (wanted - so_far[after - 1]) / (so_far[after] - so_far[after - 1]);
        at((after - 1) as f64 + share)
    };
    (0..n).map(node).collect()
}

/// Adaptive steps of this tolerance up to a late time.
fn parameters(n: usize, flow: &Flow, adaptive: f64) -> Parameters<f64> {
    Parameters {
        adaptive,
        polygon_ratio: n as f64 / PI * (PI / n as f64).tan(),
        time_unit: 2f64.powi(-10),
        time_tick: 2f64.powi(-34),
        end_high: 64.0,
        goal_high: 64.0,
        clock_end: 64.0,
        ..Parameters::of_flow(flow, 0.0)
    }
}

/// t_relax to 1 % of the excess at the start, by steps of a tolerance of 1e-4 up to the highest order of f32.
fn t_relax<T: Evolves>(nodes: &[DVec2], flow: &str, geometric: bool) -> f64 {
    let (n, level) = (nodes.len(), |level: f64| Observed::from_numbers(&[level; Observed::<f64>::FIELDS.len()]));
    let mut p =
        Parameters { geometric: f64::from(u8::from(geometric)), ..parameters(n, &flow.parse::<Flow>().unwrap(), 1e-4) };
    p.set_levels(&level(-1e18), &level(1e18));
    let start = Run::new(State::<f64>::from_nodes(nodes), p).report.now.excess;
    (p.relax_at, p.half_at, p.follow_to) = (0.01 * start, 0.5 * start, 0.01 * start);
    let mut run: Run<T> = Run::new(State::from_nodes(nodes), p.convert());
    run.report.progress.next = T::of(1e-5);
    (run.counters.goal, run.counters.stop_when_relaxed, run.counters.order) = (10_000, 1, MOST_ORDER_F32);
    let method = Method { most_order: MOST_ORDER_F32, ..Method::coloured(Solver::Direct, 1) };
    let mut team = Team::new(Blocks::new(n).unwrap());
    while run.counters.is_running() && run.counters.rejected < 10_000 {
        evolve(&mut run, &method, &mut team, 100);
    }
    assert_ne!(run.counters.relax_step, NEVER, "{flow}, n = {n}");
    let p = &run.report.progress;
    [p.relax_high, p.relax_low, p.relax_fraction * p.relax_length].map(T::to_f64).iter().sum()
}

/// By how much ln excess falls per step, at the end of a step from `nodes`, by its derivative; and in that step, by
/// length and area alone, which are rounded.
fn slopes<T: Evolves>(nodes: &[DVec2]) -> [f64; 2] {
    let n = nodes.len();
    let p = parameters(n, &Flow::SurfaceDiffusion, 1.0);
    let mut run: Run<T> = Run::new(State::from_nodes(nodes), p.convert());
    let start = run.report.now;
    run.report.progress.next = T::of(2f64.powi(-8));
    (run.counters.goal, run.counters.order) = (1, 2);
    let method = Method { most_order: MOST_ORDER_F32, ..Method::coloured(Solver::Direct, 1) };
    evolve(&mut run, &method, &mut Team::new(Blocks::new(n).unwrap()), 1);
    let [before, after] = [start, run.report.now].map(|at| (at.length * at.length / at.area).to_f64());
    let excess = run.report.now.excess.to_f64();
    [run.report.progress.slope.to_f64(), (after - before) / (4.0 * PI) / excess]
}

/// The median and the largest error of ellipses under two flows.
fn errors(n: usize, geometric: bool, aspects: &[f64]) -> [f64; 2] {
    let mut all = Vec::new();
    for aspect in aspects {
        let nodes = ellipse(n, *aspect);
        for flow in ["surface-diffusion", "willmore"] {
            let [short, long] = [t_relax::<f32>(&nodes, flow, geometric), t_relax::<f64>(&nodes, flow, geometric)];
            all.push((short / long - 1.0).abs());
            println!(
                "n = {n}, {aspect}:1, {flow}, geometric {geometric}: {long:.6}, f32 off by {:.1e}",
                all[all.len() - 1]
            );
        }
    }
    all.sort_by(f64::total_cmp);
    [all[all.len() / 2], all[all.len() - 1]]
}

#[test]
fn times_in_f32_are_those_in_f64_up_to_400_nodes() {
    for (n, bounds) in [(100, [1e-5, 5e-5]), (200, [2e-5, 1e-4]), (320, [5e-5, 3e-4]), (400, [5e-5, 3e-4])] {
        let [median, worst] = errors(n, true, &[1.05, 1.2, 2.0, 4.0]);
        assert!(median < bounds[0] && worst < bounds[1], "n = {n}: {median:e} {worst:e}");
    }
}

/// In the paper's form k moves the nodes, and k has the digits of f32.
#[test]
fn times_in_the_paper_s_form_lose_more_where_nodes_are_many() {
    for (n, bounds) in [(100, [1e-4, 3e-4]), (200, [1e-4, 1e-3]), (320, [1e-4, 1e-3]), (400, [3e-4, 2e-3])] {
        let [median, worst] = errors(n, false, &[1.05, 1.2, 2.0, 4.0]);
        assert!(median < bounds[0] && worst < bounds[1], "n = {n}: {median:e} {worst:e}");
    }
}

#[test]
fn the_slope_of_the_excess_in_f32_is_right_near_a_circle() {
    for n in [64, 100, 200] {
        for aspect in [1.005, 1.05, 1.5] {
            let nodes = ellipse(n, aspect);
            let ([short, rounded], [long, exact]) = (slopes::<f32>(&nodes), slopes::<f64>(&nodes));
            println!(
                "n = {n}, {aspect}:1: {long:.6}, in f32 off by {:.1e}, else {:.1e}",
                short / long - 1.0,
                rounded / exact - 1.0
            );
            assert!((short / long - 1.0).abs() < 5e-3, "n = {n}, {aspect}:1: {short} {long}");
            assert!(aspect > 1.01 || (rounded / exact - 1.0).abs() > 0.01, "the control passes: {rounded} {exact}");
        }
    }
}

#[test]
fn the_excess_in_f32_is_right_to_its_eighth_decimal() {
    let (mut worst, mut worst_quotient) = (0.0_f64, 0.0_f64);
    for n in [64, 100, 200] {
        for aspect in [1.0, 1.001, 1.05, 1.2] {
            let nodes = ellipse(n, aspect);
            let polygon_ratio = n as f64 / PI * (PI / n as f64).tan();
            let p = Parameters { polygon_ratio, ..Parameters::of_flow(&Flow::SurfaceDiffusion, 1.0) };
            let short: Run<f32> = Run::new(State::from_nodes(&nodes), p.convert());
            let rounded: Vec<DVec2> = short.state.curve.positions().collect();
            let exact = Run::<f64>::new(State::from_nodes(&rounded), p).report.now.excess;
            let now = short.report.now;
            let quotient = now.length * now.length / (4.0 * std::f32::consts::PI * now.area) - polygon_ratio as f32;
            worst = worst.max((f64::from(now.excess) - exact).abs());
            worst_quotient = worst_quotient.max((f64::from(quotient) - exact).abs());
        }
    }
    println!("{worst:e}; by the quotient of length and area {worst_quotient:e}");
    assert!(worst < 1e-8 && worst_quotient > 1e-7, "{worst:e} {worst_quotient:e}");
}
