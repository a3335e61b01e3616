//! A back end that fails at any call of a run.

use std::time::Duration;

use curvelax::{
    Error,
    backend::{
        Backend,
        cpu::{CpuBackend, Vectors},
    },
    ensemble::{Cell, Family, Spec, request::spec::Precision},
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
    },
    simulate::simulate,
    solver::{Blocks, Solver},
};
use libtest_mimic::Failed;

use super::{Outcome, method, require};

/// A back end that fails at one of its calls.
struct Failing {
    inner: Box<dyn Backend>,
    /// Calls of `call` that succeed first.
    before: usize,
    call: &'static str,
    failed: bool,
}

impl Failing {
    fn count(&mut self, call: &'static str) -> curvelax::Result<()> {
        assert!(!self.failed, "{call} after the error of {}", self.call);
        match (call == self.call, &mut self.before) {
            (true, 0) => {
                self.failed = true;
                Err(Error::Device(format!("planned: {call}")))
            }
            (true, before) => {
                *before -= 1;
                Ok(())
            }
            (false, _) => Ok(()),
        }
    }
}

impl Backend for Failing {
    fn slots(&self) -> usize {
        self.inner.slots()
    }
    fn load(&mut self, slot: usize, run: &Run<f64>) -> curvelax::Result<()> {
        self.count("load")?;
        self.inner.load(slot, run)
    }
    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.inner.aim(slot, goal, parameters);
    }
    fn clear(&mut self, slot: usize) {
        self.inner.clear(slot);
    }
    fn batches(&self) -> usize {
        self.inner.batches()
    }
    fn start(&mut self, batch: usize) -> curvelax::Result<()> {
        self.count("start")?;
        self.inner.start(batch)
    }
    fn is_back(&mut self, batch: usize, most: Duration) -> bool {
        self.inner.is_back(batch, most)
    }
    fn finish(&mut self, batch: usize) -> curvelax::Result<()> {
        self.count("finish")?;
        self.inner.finish(batch)
    }
    fn counters(&self, slot: usize) -> Counters {
        self.inner.counters(slot)
    }
    fn report(&self, slot: usize) -> Report<f64> {
        self.inner.report(slot)
    }
    fn state(&mut self, slot: usize) -> curvelax::Result<State<f64>> {
        self.inner.state(slot)
    }
    fn states(&mut self, slots: &[usize]) -> curvelax::Result<Vec<State<f64>>> {
        self.count("states")?;
        self.inner.states(slots)
    }
}

pub(super) fn any_call_fails() -> Outcome {
    let spec = Spec {
        curves: 41,
        points: 32,
        tau: Some(1e-2.into()),
        t_end: Some(0.2.into()),
        relax_to: Some(0.5),
        stop_when_relaxed: Some(true),
        series: Some(0.05),
        solver: Solver::Direct.into(),
        ..Spec::default()
    };
    let spec = spec.validate()?;
    let blocks = Blocks::new(spec.points).ok_or("n")?;
    let run = |call, before| -> Result<(Vec<String>, curvelax::Result<()>), Failed> {
        let inner = CpuBackend::<f64>::with_vectors(blocks, method(Solver::Direct), 1, Vectors::None)?;
        let mut backend = Failing { inner: Box::new(inner), before, call, failed: false };
        let mut all = Vec::new();
        let cells = [Cell::only(spec.clone(), Family::new(&spec)?)];
        let result = simulate(&cells, Precision::F64, &mut backend, 2, &mut all);
        Ok((all.iter().map(|ended| format!("{ended:?}")).collect(), result))
    };
    let (whole, result) = run("none", 0)?;
    result?;
    require(whole.len() == 41, || format!("{} members", whole.len()))?;
    for call in ["load", "start", "finish", "states"] {
        let mut before = 0;
        loop {
            let (some, result) = run(call, before)?;
            let place = format!("{call} fails after {before}");
            require(some[..] == whole[..some.len()], || format!("{place}: the members before it differ"))?;
            match result {
                Ok(()) => break require(some.len() == 41, || format!("{place}: {} members", some.len()))?,
                Err(Error::Device(message)) if message == format!("planned: {call}") => {}
                Err(error) => return Err(format!("{place}: {error}").into()),
            }
            before += 1;
        }
        println!("{call} fails at each of {before} calls");
        require(before > 3, || format!("{call}: only {before} calls"))?;
    }
    Ok(())
}
