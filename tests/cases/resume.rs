//! A run that is interrupted repeatedly ends like one that is not, bit for bit: on the CPU and on a GPU, between any
//! two dispatches, with any number of slots, and also if the members in progress are lost.

use std::collections::BTreeMap;

use crate::common::{dumbbell, file};
use curvelax::{
    Error, Result,
    backend::{
        Backend,
        cpu::{CpuBackend, Vectorised},
        gpu::{Gpu, Kernel, Variant, kernel::Budget},
    },
    ensemble::{
        Cell, Ended, Family, Paused, RunProgress, Sink, SinkRequest, Spec,
        request::spec::{FinalTime, OrAuto, Precision, Solver},
    },
    scheme::step::Method,
    simulate::resume,
    solver::Blocks,
};
use libtest_mimic::{Failed, Trial};

/// Receives members and stops the run repeatedly.
#[derive(Default)]
struct Interrupting {
    ended: Vec<Ended>,
    /// Calls of `request` until the next stop.
    patience: u32,
    progress: RunProgress,
    /// The members in progress at the last checkpoint that had them.
    resident: BTreeMap<u64, Paused>,
    /// Whether members in progress are lost at regular stops.
    lost: bool,
}

impl Sink for Interrupting {
    fn member(&mut self, ended: &Ended) -> Result<()> {
        self.ended.push(ended.clone());
        Ok(())
    }

    fn next_request(&mut self) -> SinkRequest {
        self.patience = self.patience.saturating_sub(1);
        match self.patience {
            0 => SinkRequest::Stop(Error::Stopped("enough".into())),
            1 => SinkRequest::Checkpoint,
            _ => SinkRequest::Continue,
        }
    }

    fn checkpoint(&mut self, progress: &RunProgress) -> Result<()> {
        assert_eq!(progress.next as usize, self.ended.len());
        let RunProgress { next, early, resident } = progress;
        if let Some(resident) = resident {
            self.resident.clone_from(resident);
        }
        self.progress = RunProgress { next: *next, early: early.clone(), resident: None };
        Ok(())
    }
}

/// The case whose curves cross themselves during the run.
const CROSSING: &str = "curves that cross themselves";

/// Opens a back end for the members of a spec.
type Open<'a> = &'a dyn Fn(&Spec) -> Result<Box<dyn Backend>>;

fn cells(name: &str, spec: &Spec) -> Result<[Cell; 1]> {
    let family = match name {
        CROSSING => Family::of(spec, file(&dumbbell(4.0, 0.1)))?,
        _ => Family::new(spec)?,
    };
    Ok([Cell::only(spec.clone(), family)])
}

fn straight(name: &str, spec: &Spec, precision: Precision, open: Open) -> Result<Vec<Ended>> {
    let mut all = Interrupting { patience: u32::MAX, ..Interrupting::default() };
    resume(&cells(name, spec)?, precision, open(spec)?.as_mut(), 2, RunProgress::default(), &mut all)?;
    Ok(all.ended)
}

/// The same in pieces of `patience` dispatches; returns the results of the members and the number of pieces.
fn in_pieces(name: &str, spec: &Spec, precision: Precision, open: Open, patience: u32) -> Result<(Vec<Ended>, u32)> {
    let cells = cells(name, spec)?;
    let mut sink = Interrupting::default();
    for piece in 1.. {
        // More each time, so that the run ends although members in progress are lost.
        sink.patience = patience + piece / 4;
        sink.lost = piece % 5 == 0;
        let mut progress = std::mem::take(&mut sink.progress);
        let resident = std::mem::take(&mut sink.resident);
        if !sink.lost {
            progress.resident = Some(resident);
        }
        // As read back from disk.
        let bytes = postcard::to_allocvec(&progress).expect("a state");
        let progress = postcard::from_bytes(&bytes).expect("the same");
        match resume(&cells, precision, open(spec)?.as_mut(), 2, progress, &mut sink) {
            Err(Error::Stopped(_)) => {}
            done => return done.map(|()| (sink.ended, piece)),
        }
    }
    unreachable!("it ends")
}

fn compare(name: &str, spec: &Spec, precision: Precision, open: Open, patience: u32) -> Result<(), Failed> {
    let whole = straight(name, spec, precision, open)?;
    let (pieces, count) = in_pieces(name, spec, precision, open, patience)?;
    if count < 4 {
        return Err(format!("interrupted {} times only", count - 1).into());
    }
    if whole.len() != pieces.len() {
        return Err(format!("{} members of {}", pieces.len(), whole.len()).into());
    }
    for (one, other) in whole.iter().zip(&pieces) {
        // Debug prints every bit of a float, and NaN equal to NaN.
        if format!("{one:?}") != format!("{other:?}") {
            let member = one.outcome.member;
            return Err(format!("member {member} after {count} pieces:\n{:?}\n{:?}", one.outcome, other.outcome).into());
        }
    }
    if name == CROSSING && !whole.iter().any(|ended| ended.outcome.self_crossing.is_some_and(|t| t > 0.0)) {
        return Err("no curve has crossed itself".into());
    }
    // Negative control: a member with another seed has different bits.
    let other = straight(name, &Spec { seed: spec.seed + 1, ..spec.clone() }, precision, open)?;
    if format!("{:?}", other[3]) == format!("{:?}", whole[3]) {
        return Err("the comparison sees nothing".into());
    }
    Ok(())
}

/// Members with all kinds of ends, and output times, some of them inside steps.
fn specs() -> Vec<(&'static str, Spec)> {
    let events = ["slow = excess <= 0.5 * start", "bent = k_max <= 3", "never = length <= 0.1"];
    let event = events.map(|text| text.parse().expect("an event")).to_vec();
    let outputs = |more: Spec| Spec {
        event: event.clone(),
        curves: 13,
        series: Some(0.013),
        snapshots: vec![0.0, 0.02],
        points: 33,
        ..more
    };
    let fixed = |solver: Solver| {
        outputs(Spec { tau: Some(1e-3.into()), t_end: Some(0.15.into()), solver: solver.into(), ..Spec::default() })
    };
    let adaptive = |solver: Solver| {
        let shape = "nonconvex".parse().expect("a shape");
        outputs(Spec {
            adaptive: Some(1e-3),
            tau: None,
            t_end: Some(0.4.into()),
            shape,
            solver: solver.into(),
            ..Spec::default()
        })
    };
    let mut specs = Vec::new();
    for solver in Solver::ALL {
        specs.push(("fixed steps", fixed(solver)));
        specs.push(("adaptive steps", adaptive(solver)));
    }
    let by_size = Spec { tau: Some(OrAuto::Auto), t_end: Some(FinalTime::Auto), ..fixed(Solver::Direct) };
    specs.push(("times by the size of the curves", by_size));
    // With a long dumbbell.
    specs.push((
        CROSSING,
        Spec { t_end: Some(1.5.into()), points: 128, pull: OrAuto::Auto, ..adaptive(Solver::Direct) },
    ));
    let short = Spec {
        t_end: Some(0.0502.into()),
        stop_when_relaxed: Some(true),
        relax_to: Some(0.7),
        ..fixed(Solver::Direct)
    };
    specs.push(("members that end early and steps that end short", short));
    specs.into_iter().map(|(name, spec)| (name, spec.validate().expect("a right spec"))).collect()
}

fn on_the_cpu<T: Vectorised>(spec: &Spec) -> Result<Box<dyn Backend>> {
    let method = Method::coloured(spec.solver(), spec.max_sweeps);
    let blocks = Blocks::new(spec.points).expect("a ring");
    Ok(Box::new(CpuBackend::<T>::new(blocks, method, 2)?))
}

/// The tests.
pub fn trials() -> Vec<Trial> {
    let mut trials = Vec::new();
    for (name, spec) in specs() {
        let title = format!("{name}, {:?}", spec.solver());
        let own = spec.clone();
        trials.push(Trial::test(format!("cpu f64, {title}"), move || {
            compare(name, &own, Precision::F64, &on_the_cpu::<f64>, 3)
        }));
        let own = spec.clone();
        trials.push(Trial::test(format!("cpu f32, {title}"), move || {
            compare(name, &own, Precision::F32, &on_the_cpu::<f32>, 2)
        }));
        let gpu = || Gpu::list().into_iter().next();
        let there = gpu().is_some_and(|gpu| gpu.has_f64());
        let on_a_gpu = move || {
            let gpu = gpu().ok_or("no adapter")?;
            let open = |spec: &Spec| -> Result<Box<dyn Backend>> {
                let blocks = Blocks::new(spec.points).expect("a ring");
                let variant = gpu.capacity().variant(blocks, spec.solver());
                let watched = !spec.event.is_empty();
                let variant = Variant { adaptive: spec.adaptive.is_some(), watched, ..variant };
                let kernel = Kernel::<f64>::in_batches(&gpu, blocks, [2, 7], spec.max_sweeps, variant)?;
                // So few that dispatches end inside solves; adaptive steps are long, and need thousands of sweeps.
                let sweeps = if spec.adaptive.is_some() { 600 } else { 50 };
                Ok(Box::new(kernel.with_budget(Budget { steps: 9, sweeps })))
            };
            compare(name, &spec, Precision::F64, &open, 9)
        };
        trials.push(Trial::test(format!("gpu f64, {title}"), on_a_gpu).with_ignored_flag(!there));
    }
    trials
}
