//! A back end that computes wrongly: the self-test finds it.

use curvelax::{
    Error,
    backend::{
        Backend,
        cpu::{CpuBackend, Vectorised, Vectors},
    },
    conformance::{Driven, self_test},
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
    },
    solver::{Blocks, Solver},
};
use libtest_mimic::Failed;

use super::{Outcome, method, require};

/// A back end that computes correctly and reports one thing wrongly.
struct Liar<B> {
    inner: B,
    lie: Lie,
}

/// A wrong report: of which number, and by how much relative to the radius.
#[derive(Clone, Copy, Debug)]
enum Lie {
    None,
    Node(f64),
    Curvature(f64),
    Excess(f64),
    Steps,
    Nothing,
}

impl<B: Backend> Backend for Liar<B> {
    fn slots(&self) -> usize {
        self.inner.slots()
    }
    fn load(&mut self, slot: usize, run: &Run<f64>) -> curvelax::Result<()> {
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
        self.inner.start(batch)
    }
    fn finish(&mut self, batch: usize) -> curvelax::Result<()> {
        self.inner.finish(batch)
    }
    fn counters(&self, slot: usize) -> Counters {
        let mut counters = self.inner.counters(slot);
        if let (Lie::Steps, false) = (self.lie, counters.is_running()) {
            counters.steps += 1;
        }
        counters
    }
    fn report(&self, slot: usize) -> Report<f64> {
        let mut report = self.inner.report(slot);
        if let Lie::Excess(by) = self.lie {
            report.now.excess += by;
        }
        report
    }
    fn state(&mut self, slot: usize) -> curvelax::Result<State<f64>> {
        let mut state = self.inner.state(slot)?;
        let curve = &mut state.curve;
        match self.lie {
            Lie::Node(by) => curve.x[5] += by,
            Lie::Curvature(by) => curve.k[2] += by,
            // Like a device whose shaders do not run: its input, or zeros.
            Lie::Nothing => state = State::zeros(curve.len()),
            Lie::None | Lie::Excess(_) | Lie::Steps => {}
        }
        Ok(state)
    }
}

pub(super) fn the_self_test_finds_a_liar<T: Vectorised>(solver: Solver, adaptive: bool) -> Outcome {
    let n = 64;
    let tested = |lie: Lie| -> Result<curvelax::Result<()>, Failed> {
        // One member at a time, as those of the self-test could not run side by side.
        let inner = CpuBackend::<T>::with_vectors(Blocks::new(n).ok_or("n")?, method(solver), 1, Vectors::None)?;
        let mut liar = Liar { inner, lie };
        let result =
            self_test::<T>(&mut liar, "toaster (bread 1.2)", false, &method(solver), n, adaptive, Driven::Paper);
        // Its slots are free again.
        liar.start(0)?;
        liar.finish(0)?;
        Ok(result)
    };
    tested(Lie::None)??;
    // The smallest lie is some thousand roundings.
    let little = 4096.0 * T::EPSILON;
    let lies = [
        (Lie::Node(little), ["x of member", "node 5"]),
        (Lie::Node(f64::NAN), ["x of member", "node 5"]),
        (Lie::Curvature(64.0 * little), ["k of member", "node 2"]),
        (Lie::Excess(little), ["excess of member", "node 0"]),
        (Lie::Steps, ["member 0", "steps"]),
        (Lie::Nothing, ["x of member", "is off by"]),
    ];
    for (lie, named) in lies {
        let Err(Error::Device(message)) = tested(lie)? else { return Err(format!("{lie:?} was not noticed").into()) };
        let parts = ["GPU toaster (bread 1.2) computes wrongly", "curvelax check", "--backend cpu"];
        for part in parts.into_iter().chain(named) {
            require(message.contains(part), || format!("{lie:?}: {part:?} is not in: {message}"))?;
        }
    }
    Ok(())
}
