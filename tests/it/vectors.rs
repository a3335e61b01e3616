//! Members side by side in vector instructions against one member at a time: the same bits, whatever runs next to a
//! member, on any number of threads. Each comparison has a negative control.

use curvelax::{
    Result,
    backend::{
        Backend,
        cpu::{CpuBackend, Vectorised, Vectors},
    },
    ensemble::{Cell, Ended, Spec, Status, Study, request::spec::Solver},
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
        step::Method,
    },
    simulate::simulate,
    solver::Blocks,
};

/// A back end with fewer slots, so that members share vectors with others.
struct Fewer(Box<dyn Backend>, usize);

impl Backend for Fewer {
    fn slots(&self) -> usize {
        self.1.min(self.0.slots())
    }
    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        self.0.load(slot, run)
    }
    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.0.aim(slot, goal, parameters);
    }
    fn clear(&mut self, slot: usize) {
        self.0.clear(slot);
    }
    fn batches(&self) -> usize {
        1
    }
    fn start(&mut self, _: usize) -> Result<()> {
        Ok(())
    }
    fn finish(&mut self, _: usize) -> Result<()> {
        self.0.advance()
    }
    fn counters(&self, slot: usize) -> Counters {
        self.0.counters(slot)
    }
    fn report(&self, slot: usize) -> Report<f64> {
        self.0.report(slot)
    }
    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        self.0.state(slot)
    }
}

/// Members with all kinds of ends, and output times, some of them inside steps.
fn spec(shape: &str, more: Spec) -> Spec {
    let shape = shape.parse().unwrap();
    Spec { shape, curves: 37, series: Some(0.013), snapshots: vec![0.0, 0.02], ..more }.validate().unwrap()
}

/// All members of `specs`, with the same solver and n, side by side.
fn run<T: Vectorised>(specs: &[Spec], vectors: Vectors, threads: usize, slots: usize) -> Vec<Ended> {
    let method = Method::coloured(specs[0].solver(), specs[0].max_sweeps);
    let blocks = Blocks::new(specs[0].points).unwrap();
    let backend = CpuBackend::<T>::with_vectors(blocks, method, threads, vectors).unwrap();
    let mut all = Vec::new();
    let cells: Vec<Cell> = specs.iter().flat_map(|spec| Study::new(spec.clone()).unwrap().cells().to_vec()).collect();
    simulate(&cells, T::PRECISION, &mut Fewer(Box::new(backend), slots), 2, &mut all).unwrap();
    all
}

fn same_bits<T: Vectorised>(name: &str, specs: &[Spec]) {
    let alone = run::<T>(specs, Vectors::None, 1, 16);
    assert_eq!(alone.len() as u64, specs.iter().map(Spec::all_members).sum::<u64>());
    let (mut compared, mut wider) = (0, 0);
    for vectors in Vectors::ALL.into_iter().filter(|vectors| vectors.are_available()) {
        for (threads, slots) in [(1, 1000), (2, 11)] {
            let abreast = run::<T>(specs, vectors, threads, slots);
            for (one, other) in alone.iter().zip(&abreast) {
                // Debug prints every bit of a float, and NaN equal to NaN.
                let member = one.outcome.member;
                assert_eq!(
                    format!("{one:?}"),
                    format!("{other:?}"),
                    "{name}, {} {vectors:?}, member {member}",
                    T::NAME
                );
            }
            compared += abreast.len();
            wider += usize::from(vectors != Vectors::None);
        }
    }
    assert!(compared > 0);
    println!("{name}, {}: {compared} members, {wider} runs in vectors", T::NAME);
    // Negative control: a member with another seed has different bits.
    let other: Vec<Spec> = specs.iter().map(|spec| Spec { seed: spec.seed + 1, ..spec.clone() }).collect();
    let other = run::<T>(&other, Vectors::widest(), 1, 1000);
    assert_ne!(format!("{:?}", alone[5]), format!("{:?}", other[5]));
}

#[test]
fn fixed_steps_give_the_same_bits_in_every_vector() {
    for solver in Solver::ALL {
        for n in [32, 37] {
            let fixed = Spec {
                tau: Some(1e-3.into()),
                t_end: Some(0.3.into()),
                points: n,
                solver: solver.into(),
                ..Spec::default()
            };
            let specs = [spec("ellipse:2,1", Spec { stop_when_relaxed: Some(true), relax_to: Some(0.5), ..fixed })];
            same_bits::<f64>(&format!("{solver:?}, n = {n}"), &specs);
            same_bits::<f32>(&format!("{solver:?}, n = {n}"), &specs);
        }
    }
}

#[test]
fn adaptive_steps_give_the_same_bits_in_every_vector() {
    for solver in Solver::ALL {
        let adaptive = Spec {
            adaptive: Some(1e-2),
            t_end: Some(0.4.into()),
            points: 33,
            solver: solver.into(),
            ..Spec::default()
        };
        let specs = [spec("flower:3:0.3", Spec { stop_when_relaxed: Some(true), ..adaptive })];
        same_bits::<f64>(&format!("{solver:?}, adaptive"), &specs);
        same_bits::<f32>(&format!("{solver:?}, adaptive"), &specs);
    }
}

#[test]
fn members_that_take_other_branches_are_not_disturbed() {
    for solver in Solver::ALL {
        // Every branch alone, and all mixtures.
        let specs = [(Some(1e-3.into()), None), (None, Some(1e-2))].map(|(tau, adaptive)| {
            let (solver, amplitude) = (solver.into(), 0.1.into());
            let mut mixed =
                Spec { tau, adaptive, t_end: Some(0.03.into()), points: 32, solver, amplitude, ..Spec::default() };
            let axes = ["no-redistribution=true,false", "pull=0,3", "flow=surface-diffusion;willmore;poly:0.2"];
            axes.into_iter().for_each(|axis| mixed.sweep.set(axis.parse().unwrap()));
            Spec { curves: 3, ..spec("ellipse:2,1", mixed) }
        });
        same_bits::<f64>(&format!("{solver:?}, mixed"), &specs);
        same_bits::<f32>(&format!("{solver:?}, mixed"), &specs);
    }
}

#[test]
fn members_that_fail_leave_the_lanes_to_others() {
    let base = Spec {
        t_end: Some(0.5.into()),
        points: 40,
        solver: Solver::Direct.into(),
        amplitude: 0.3.into(),
        ..Spec::default()
    };
    let fixed = [spec("lemniscate:1", Spec { tau: Some(1e-3.into()), ..base.clone() })];
    let adaptive = [spec("lemniscate:1", Spec { adaptive: Some(1e-3), ..base })];
    for specs in [&fixed, &adaptive] {
        let all = run::<f64>(specs, Vectors::widest(), 2, 1000);
        let singular = all.iter().filter(|ended| ended.outcome.status == Status::Singular).count();
        let first = all[0].outcome.steps;
        assert!(singular > 9 && all.iter().any(|ended| ended.outcome.steps != first), "{singular} end badly");
    }
    same_bits::<f64>("fixed steps that fail", &fixed);
    same_bits::<f32>("fixed steps that fail", &fixed);
    same_bits::<f64>("adaptive steps that fail", &adaptive);
    same_bits::<f32>("adaptive steps that fail", &adaptive);
}

#[test]
fn the_widest_vectors_are_chosen() {
    assert!(Vectors::widest().are_available());
    let all: Vec<bool> = Vectors::ALL.map(Vectors::are_available).to_vec();
    assert_eq!(all.iter().rposition(|has| *has), Vectors::ALL.iter().position(|v| *v == Vectors::widest()));
}
