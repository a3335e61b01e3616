//! The stages of a step, each alone, in f64 and f32 on one core: `cargo bench -p curvelax-benches --bench stages`.

use criterion::{Criterion, criterion_group, criterion_main};
use curvelax::scheme::evolve::Evolves;
use curvelax::{
    ensemble::{Family, Spec, request::spec::Precision},
    schedule::Outputs,
    scheme::{
        Curve, Increments, Parameters, State, Workspace,
        curvature::Curvature,
        observe,
        position::Position,
        redistribution,
        step::{Method, Steps},
    },
    solver::{Blocks, Memory, Order, Solver, direct, gauss_seidel, sweeps::Control},
    trajectory::Trajectory,
};

/// A member of the default ensemble after ten steps, when its increments no longer jump.
struct Start<T: Evolves> {
    curve: Curve<T>,
    increments: Increments<T>,
    parameters: Parameters<T>,
    work: Workspace<T>,
}

impl<T: Evolves> Start<T> {
    fn new(points: usize) -> Start<T> {
        let spec = Spec { points, ..Spec::default() };
        let member = Family::new(&spec).and_then(|family| family.member(7)).expect("the default member");
        let run = Trajectory::new(member, &spec, Precision::F64, &Outputs::default()).launch().convert::<T>();
        let State { mut curve, mut increments, .. } = run.state;
        let (parameters, mut work) = (run.parameters, Workspace::new(Blocks::new(points).expect("n is at least 6")));
        let method = Method::coloured(Solver::Direct, 1);
        for _ in 0..10 {
            Steps::step(&curve, &mut increments, &parameters, &method, &mut work);
            std::mem::swap(&mut curve, &mut work.new);
        }
        // Leaves both systems of the eleventh step in the workspace.
        work.traced = true;
        Steps::step(&curve, &mut increments, &parameters, &method, &mut work);
        Start { curve, increments, parameters, work }
    }
}

fn stages<T: Evolves>(c: &mut Criterion) {
    let points = 100;
    let mut group = c.benchmark_group(format!("stages/{}/n={points}", T::NAME));
    let Start { curve, mut increments, parameters: p, mut work } = Start::<T>::new(points);
    let Workspace { blocks, motion, new, curvature, position, .. } = &mut work;
    let Memory { system: curvature, factor, .. } = curvature;
    let Memory { system: position, factor: factor_of_both, .. } = position;
    group.bench_function("redistribution", |b| {
        b.iter(|| redistribution::redistribute(&curve, &p, p.branches(), *blocks, motion, &mut new.r));
    });
    group.bench_function("curvature", |b| b.iter(|| curvature.assemble(&Curvature::new(&curve, new, motion, &p))));
    group.bench_function("position", |b| {
        b.iter(|| position.assemble(&Position::new(&curve, new, motion, &p, p.branches())))
    });
    group.bench_function("direct, curvature", |b| {
        b.iter(|| direct::solve(curvature, [&mut increments.k], factor));
    });
    group.bench_function("direct, position", |b| {
        b.iter(|| direct::solve(position, [&mut increments.x, &mut increments.y], factor_of_both));
    });
    // A cap that ends the solve at its first check of the residual: this measures the cost of sweeps, not their number.
    let control = Control {
        tolerance: T::of(0.0),
        negligible: T::of(0.0),
        sor: p.sor,
        max_sweeps: gauss_seidel::SWEEPS_PER_CHECK,
        order: Order::Coloured,
        refined: false,
        refinements: T::of(0.0),
    };
    let sweeps = gauss_seidel::SWEEPS_PER_CHECK;
    group.bench_function(format!("{sweeps} sweeps, curvature"), |b| {
        b.iter(|| gauss_seidel::solve(curvature, [&mut increments.k], *blocks, &control, true).sweeps);
    });
    group.bench_function(format!("{sweeps} sweeps, position"), |b| {
        b.iter(|| {
            let unknowns = [&mut increments.x, &mut increments.y];
            gauss_seidel::solve(position, unknowns, *blocks, &control, true).sweeps
        });
    });
    group.bench_function("observation", |b| {
        b.iter(|| observe::glance(&curve, new, &p, p.kind_of_law(), *blocks));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = stages::<f64>, stages::<f32>
}
criterion_main!(benches);
