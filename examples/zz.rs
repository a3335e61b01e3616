use curvelax::{
    backend::{
        Backend,
        cpu::{CpuBackend, Vectorised, Vectors},
    },
    ensemble::{Family, Spec},
    flow::Flow,
    scheme::{Parameters, State, evolve::Run, step::Method},
    solver::{Blocks, Order, Solver},
};
use std::time::Instant;
fn go<T: Vectorised>(solver: Solver, n: usize, adaptive: f64, steps: u32) {
    let spec = Spec { points: n, ..Spec::default() };
    let family = Family::new(&spec).unwrap();
    let mut reference: Vec<Vec<f64>> = vec![];
    for v in Vectors::ALL {
        if !v.are_available() || std::env::var("ONLY").is_ok_and(|o| o != format!("{v:?}{}", T::NAME)) {
            continue;
        }
        let method = Method { solver, order: Order::Coloured, max_sweeps: 200000 };
        let blocks = Blocks::new(n).unwrap();
        let mut b = CpuBackend::<T>::with_vectors(blocks, method, 1, v).unwrap();
        let members = b.slots().min(64);
        for s in 0..members {
            let m = family.member(s as u64).unwrap();
            let base = Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3);
            let p = Parameters {
                adaptive,
                relax_at: -1.0,
                half_at: -1.0,
                follow_to: 1e-4,
                time_tick: 1e-15,
                time_unit: 1e-6,
                end_high: 100.0,
                goal_high: 100.0,
                ..base
            };
            let mut run = Run::new(State::from_nodes(&m.nodes), p);
            run.report.progress.next = 1e-4;
            run.counters.goal = steps;
            b.load(s, &run).unwrap();
        }
        let t = Instant::now();
        let mut done = false;
        while !done {
            b.advance().unwrap();
            done = (0..members).all(|s| {
                let c = b.counters(s);
                c.status != 0 || c.steps >= c.goal
            });
        }
        let e = t.elapsed().as_secs_f64();
        let total: f64 = (0..members)
            .map(|s| {
                let c = b.counters(s);
                if adaptive > 0.0 { 3.0 * (c.steps + c.rejected) as f64 } else { c.steps as f64 }
            })
            .sum();
        let ends: Vec<Vec<f64>> = (0..16.min(members)).map(|s| b.state(s).unwrap().to_numbers()).collect();
        if reference.is_empty() {
            reference = ends.clone();
        }
        println!(
            "{} {:?} n={n} adaptive {adaptive} {:?}: {:.3} us per curve-step, {} members, same bits {}",
            T::NAME,
            solver,
            v,
            e / total * 1e6,
            members,
            ends.iter().zip(&reference).all(|(a, b)| a == b)
        );
    }
}
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let n = a.get(1).map_or(100, |s| s.parse().unwrap());
    go::<f64>(Solver::Direct, n, 0.0, 10000);
    go::<f32>(Solver::Direct, n, 0.0, 10000);
    if a.len() > 2 {
        go::<f64>(Solver::Direct, n, 1e-3, 60);
        go::<f64>(Solver::Multigrid, n, 0.0, 100);
        go::<f32>(Solver::Multigrid, n, 0.0, 100);
        go::<f64>(Solver::GaussSeidel, n, 0.0, 20);
        go::<f32>(Solver::GaussSeidel, n, 0.0, 20);
    }
}
