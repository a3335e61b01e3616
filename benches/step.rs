//! One step of the scheme on the CPU with each solver, and making a member: `cargo bench -p curvelax-benches`.

use criterion::{Criterion, criterion_group, criterion_main};
use curvelax::scheme::evolve::Evolves;
use curvelax::{
    ensemble::{Family, Spec},
    flow::Flow,
    scheme::{
        Parameters, State, Workspace,
        step::{Method, Steps},
    },
    solver::{Blocks, Solver},
};
use glam::DVec2;

/// The paper's ellipse after ten steps, when the increments no longer jump.
fn ellipse<T: Evolves>(n: usize) -> (State<T>, Parameters<T>, Workspace<T>) {
    let node = |i: usize| DVec2::from_angle(std::f64::consts::TAU * i as f64 / n as f64) * DVec2::new(2.0, 1.0);
    let mut state = State::<T>::from_nodes(&(1..=n).map(node).collect::<Vec<_>>());
    let parameters = Parameters::of_flow(&Flow::SurfaceDiffusion, 1e-3).convert();
    let mut work = Workspace::new(Blocks::new(n).expect("n is at least 6"));
    for _ in 0..10 {
        Steps::step(&state.curve, &mut state.increments, &parameters, &method(Solver::Direct), &mut work);
        std::mem::swap(&mut state.curve, &mut work.new);
    }
    (state, parameters, work)
}

fn method(solver: Solver) -> Method {
    Method::coloured(solver, 200_000)
}

fn step_in<T: Evolves>(c: &mut Criterion) {
    for n in [100, 200] {
        for (name, solver) in [("direct", Solver::Direct), ("gauss-seidel 1e-5", Solver::GaussSeidel)] {
            let (State { curve, increments, .. }, parameters, mut work) = ellipse::<T>(n);
            c.bench_function(&format!("step/{}/n={n}/{name}", T::NAME), |b| {
                b.iter(|| {
                    let mut increments = increments.clone();
                    Steps::step(&curve, &mut increments, &parameters, &method(solver), &mut work)
                });
            });
        }
    }
}

/// One member of the default ensemble: its random numbers, its curve, its nodes.
fn member(c: &mut Criterion) {
    let family = Family::new(&Spec::default()).expect("the default spec");
    c.bench_function("member/n=100", |b| b.iter(|| family.member(7)));
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = step_in::<f64>, step_in::<f32>, member
}
criterion_main!(benches);
