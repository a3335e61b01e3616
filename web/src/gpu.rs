//! The kernel through WebGPU: the program's shader, buffers and budgets. JavaScript carries the bytes, so that nothing
//! here waits.

use std::{cell::RefCell, collections::BTreeMap, mem, time::Duration};

use curvelax_backend::bounds::MAX_POINTS_F32;
use curvelax_backend::{
    Backend,
    gpu::{
        Budget, Capacity, Variant,
        mirror::{Binding, Caps, Mirror, to_rows},
        shader,
    },
};
use curvelax_base::error::{Error, Result};
use curvelax_flow::{
    scheme::{
        Parameters, State,
        member::{Counters, Report},
        run::Run,
        step::Method,
    },
    solver::{Blocks, Solver},
};
use serde_json::{Value, json};

/// What comes back from every dispatch: the records, and all states, so that none has to be waited for.
const BACK: [Binding; 3] = [Binding::Counters, Binding::Reports, Binding::States];
/// The bindings of the kernel, which is not traced.
const BOUND: usize = Binding::Trace as usize;

/// Members on a GPU of a browser.
pub struct WebGpu {
    blocks: Blocks,
    variant: Variant,
    mirror: Mirror<f32>,
    caps: Caps,
    budget: Budget,
    most: Budget,
    /// What is to be written before the next dispatch: the binding, the first byte, and the bytes.
    writes: RefCell<Vec<(Binding, u64, Vec<u8>)>>,
    /// Workgroups of a dispatch that JavaScript has not yet fetched.
    groups: u32,
    is_away: bool,
    back: Option<Vec<u8>>,
    states: Vec<f32>,
}

impl WebGpu {
    /// Makes room for `members` members of a solver that fits every WebGPU device.
    ///
    /// # Errors
    /// [`Error::Request`] if their rings do not.
    pub fn new(blocks: Blocks, method: &Method, adaptive: bool, members: usize) -> Result<WebGpu> {
        let capacity = Capacity::LEAST;
        capacity.check_size::<f32>(blocks, method.solver).map_err(|needs| {
            let most = capacity.max_points::<f32>(method.solver);
            Error::Request(format!("n = {} needs {needs}; WebGPU promises room for n up to {most}", blocks.n))
        })?;
        if blocks.n > MAX_POINTS_F32 {
            let problem = format!("n = {}: f32 was verified against f64 up to {MAX_POINTS_F32} nodes", blocks.n);
            return Err(Error::Request(problem));
        }
        let variant = Variant { adaptive, ..capacity.variant(blocks, method.solver) };
        // Whether a browser's GPU is hardware is not certain, and short dispatches show more.
        let most = Budget::most(false, blocks, variant);
        Ok(WebGpu {
            blocks,
            variant,
            mirror: Mirror::new(blocks, members),
            caps: Caps { max_sweeps: method.max_sweeps, most_order: method.most_order },
            budget: Budget::first(method.solver, most),
            most,
            writes: RefCell::default(),
            groups: 0,
            is_away: false,
            back: None,
            states: vec![0.0; Binding::States.bytes::<f32>(blocks, members) / size_of::<f32>()],
        })
    }

    /// What JavaScript needs to build the pipeline and its buffers.
    pub fn description(&self) -> Value {
        let buffer = |binding: &Binding| {
            let bytes = binding.bytes::<f32>(self.blocks, self.mirror.slots());
            json!({ "name": binding.name(), "bytes": bytes, "uniform": *binding == Binding::Dispatch })
        };
        let sizes = shader::sizes(self.blocks, Capacity::LEAST.subgroup, self.variant.for_one_size);
        json!({
            "code": shader::source::<f32>(self.variant),
            "constants": shader::constants(sizes).into_iter().collect::<BTreeMap<_, _>>(),
            "buffers": Binding::ALL.iter().take(BOUND).map(buffer).collect::<Vec<_>>(),
            "back": BACK.map(|binding| binding as usize),
        })
    }

    /// The dispatch that is to be made now, if any: where in memory the bytes to write are, and the workgroups.
    pub fn fetch(&mut self, kept: &mut Vec<Vec<u8>>) -> Option<Value> {
        let groups = mem::take(&mut self.groups);
        if groups == 0 {
            return None;
        }
        kept.clear();
        let mut writes = Vec::new();
        for (binding, offset, bytes) in self.writes.take() {
            writes.push((binding as usize, offset, bytes.as_ptr() as usize, bytes.len()));
            kept.push(bytes);
        }
        Some(json!({ "writes": writes, "groups": groups }))
    }

    /// Takes what came back from a dispatch that took `took`.
    pub fn deliver(&mut self, bytes: &[u8], took: Duration) {
        self.back = Some(bytes.to_vec());
        self.budget = self.budget.after(took, self.mirror.has_used_up(), self.solver(), self.most);
    }

    fn solver(&self) -> Solver {
        self.variant.solver
    }
}

impl Backend for WebGpu {
    fn slots(&self) -> usize {
        self.mirror.slots()
    }

    fn batches(&self) -> usize {
        1
    }

    fn load(&mut self, slot: usize, run: &Run<f64>) -> Result<()> {
        let run = run.convert();
        self.mirror.load(slot, &run);
        let rows = to_rows(self.mirror.blocks(), &run.state);
        let (offset, _) = self.mirror.state_at(slot);
        let first = offset as usize / size_of::<f32>();
        self.states[first..first + rows.len()].copy_from_slice(&rows);
        self.writes.borrow_mut().push((Binding::States, offset, bytemuck::cast_slice(&rows).to_vec()));
        Ok(())
    }

    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.mirror.set_parameters(slot, &parameters.convert());
        self.mirror.set_counters(slot, |counters| counters.goal = goal);
    }

    fn clear(&mut self, slot: usize) {
        self.mirror.set_counters(slot, |counters| *counters = Counters::default());
    }

    fn start(&mut self, _: usize) -> Result<()> {
        self.groups = self.mirror.look();
        if self.groups > 0 {
            let writes = &self.writes;
            self.mirror.upload(self.budget, self.caps, |binding, offset, bytes| {
                writes.borrow_mut().push((binding, offset, bytes.to_vec()));
            });
            self.is_away = true;
        }
        Ok(())
    }

    fn is_back(&mut self, _: usize, _: Duration) -> bool {
        !self.is_away || self.back.is_some()
    }

    fn finish(&mut self, _: usize) -> Result<()> {
        if !mem::take(&mut self.is_away) {
            self.mirror.forget_sweeps();
            return Ok(());
        }
        let bytes = self.back.take().ok_or_else(|| Error::Device("the browser's GPU: nothing came back".into()))?;
        let of_states = self.states.len() * size_of::<f32>();
        let Some(records) = bytes.len().checked_sub(of_states) else {
            return Err(Error::Device(format!("the browser's GPU: {} bytes came back, too few", bytes.len())));
        };
        self.states = bytemuck::pod_collect_to_vec(&bytes[records..]);
        let idle = |slot| format!("the browser's GPU: a dispatch did nothing for the member in slot {slot}");
        self.mirror.take(&bytes[..records]).map_err(|slot| Error::Device(idle(slot)))
    }

    fn counters(&self, slot: usize) -> Counters {
        self.mirror.counters(slot)
    }

    fn report(&self, slot: usize) -> Report<f64> {
        self.mirror.report(slot).convert()
    }

    fn state(&mut self, slot: usize) -> Result<State<f64>> {
        let (offset, bytes) = self.mirror.state_at(slot);
        let [first, count] = [offset, bytes].map(|bytes| bytes as usize / size_of::<f32>());
        Ok(self.mirror.state_of(&self.states[first..first + count]).convert())
    }
}
