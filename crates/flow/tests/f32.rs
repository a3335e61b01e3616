//! Prototype: relaxation times of adaptive runs in f32 against f64.
use curvelax_flow::{
    flow::Flow,
    number::Real,
    scheme::{
        Parameters, State,
        evolve::{Evolves, Team, evolve},
        member::NEVER,
        run::Run,
        step::Method,
    },
    solver::{Blocks, Solver},
};
use glam::DVec2;
use std::f64::consts::TAU;

fn ellipse(n: usize, a: f64) -> Vec<DVec2> {
    // Equal arc length by a fine table.
    let m = 200_000;
    let at = |t: f64| DVec2::new(a * t.cos(), t.sin());
    let mut sums = vec![0.0];
    for j in 1..=m {
        let (p, q) = (at(TAU * (j - 1) as f64 / m as f64), at(TAU * j as f64 / m as f64));
        sums.push(sums[j - 1] + p.distance(q));
    }
    (0..n)
        .map(|i| {
            let want = sums[m] * i as f64 / n as f64;
            let j = sums.partition_point(|s| *s <= want).min(m);
            let share = (want - sums[j - 1]) / (sums[j] - sums[j - 1]);
            at(TAU * ((j - 1) as f64 + share) / m as f64)
        })
        .collect()
}

fn flower(n: usize, lobes: f64) -> Vec<DVec2> {
    (0..n)
        .map(|i| {
            let t = TAU * i as f64 / n as f64;
            DVec2::from_angle(t) * (1.0 + 0.15 * (lobes * t).cos())
        })
        .collect()
}

fn time<T: Evolves>(
    nodes: &[DVec2],
    flow: &str,
    tol: f64,
    geometric: f64,
    pull: f64,
    solver: Solver,
    aimed: bool,
) -> (f64, u32, u32) {
    let n = nodes.len();
    let flow: Flow = flow.parse().unwrap();
    let ratio = n as f64 / std::f64::consts::PI * (std::f64::consts::PI / n as f64).tan();
    let mut p = Parameters {
        adaptive: tol,
        geometric,
        pull,
        polygon_ratio: ratio,
        sor: 0.0,
        tolerance: 1e-3 * tol.min(1e-3) / 1e-3,
        time_unit: 2f64.powi(-10),
        time_tick: 2f64.powi(-34),
        end_high: 64.0,
        goal_high: 64.0,
        clock_end: 64.0,
        ..Parameters::of_flow(&flow, 1e-3)
    };
    p.set_levels(
        &curvelax_flow::scheme::member::Observed::from_numbers(&[-1e18; 8]),
        &curvelax_flow::scheme::member::Observed::from_numbers(&[1e18; 8]),
    );
    let start: Run<f64> = Run::new(State::from_nodes(nodes), p);
    p.relax_at = 0.01 * start.report.now.excess;
    p.half_at = 0.5 * start.report.now.excess;
    p.follow_to = p.relax_at;
    let p: Parameters<T> = p.convert();
    let mut run: Run<T> = Run::new(State::from_nodes(nodes), p);
    run.report.progress.next = T::of(1e-5);
    run.counters.goal = 100_000;
    run.counters.stop_when_relaxed = 1;
    run.counters.order = 4;
    let blocks = Blocks::new(n).unwrap();
    let mut team = Team::new(blocks);
    let mut method = Method::coloured(solver, 20000);
    method.most_order = 4;
    let _ = aimed;
    for _ in 0..200 {
        if !run.counters.is_running() {
            break;
        }
        evolve(&mut run, &method, &mut team, 100);
    }
    let r = &run.report.progress;
    let t = if NEVER == run.counters.relax_step {
        f64::NAN
    } else {
        r.relax_high.to_f64() + r.relax_low.to_f64() + r.relax_fraction.to_f64() * r.relax_length.to_f64()
    };
    (t, run.counters.steps, run.counters.rejected)
}

#[test]
fn times() {
    let tol: f64 = std::env::var("TOL").ok().and_then(|v| v.parse().ok()).unwrap_or(1e-4);
    let ns: Vec<usize> =
        std::env::var("NS").unwrap_or("100,200".into()).split(',').map(|v| v.parse().unwrap()).collect();
    let mut all = vec![];
    for form in [0.0, 1.0] {
        for flow in ["surface-diffusion", "willmore"] {
            for &n in &ns {
                for (name, nodes) in [
                    ("2:1", ellipse(n, 2.0)),
                    ("1.2:1", ellipse(n, 1.2)),
                    ("1.05:1", ellipse(n, 1.05)),
                    ("4:1", ellipse(n, 4.0)),
                    ("flower3", flower(n, 3.0)),
                ] {
                    let pull: f64 = std::env::var("PULL").ok().and_then(|v| v.parse().ok()).unwrap_or(0.0);
                    let (d, ds, dr) = time::<f64>(&nodes, flow, tol, form, pull, Solver::Direct, true);
                    let (s, ss, sr) = time::<f32>(&nodes, flow, tol, form, pull, Solver::Direct, true);
                    let e = s / d - 1.0;
                    println!("form {form} {flow:18} n {n} {name:8} t {d:.6} ({ds}+{dr}) f32 {e:9.1e} ({ss}+{sr})");
                    all.push((n, form, e.abs()));
                }
            }
        }
    }
    for form in [0.0, 1.0] {
        for &n in &ns {
            let mut of: Vec<f64> =
                all.iter().filter(|a| a.0 == n && a.1 == form).map(|a| if a.2.is_nan() { 9.0 } else { a.2 }).collect();
            of.sort_by(f64::total_cmp);
            println!("form {form} n {n}: median {:.1e} worst {:.1e}", of[of.len() / 2], of[of.len() - 1]);
        }
    }
}
