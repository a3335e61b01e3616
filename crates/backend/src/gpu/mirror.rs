//! The host's mirror of a batch of slots: what goes into its buffers before a dispatch, and what comes back.
//!
//! Only the changed part is uploaded, together with the list of members that are due; only they get a workgroup.
//! Whoever owns the buffers, wgpu or a browser, carries the bytes.

use super::{budget::Budget, shader::TRACE_FIELDS};
use curvelax_flow::{
    number::Real,
    scheme::{
        Parameters,
        excess::half_angle,
        member::{Counters, Report},
        run::Run,
        state::{STATE_FIELDS, State},
    },
    solver::Blocks,
};

/// Field names of the parameters of one dispatch, in memory order.
pub const DISPATCH_FIELDS: [&str; 10] =
    ["steps", "max_sweeps", "most_order", "sweeps", "blocks", "groups", "nodes", "fours", "half_cosine", "half_sine"];

/// Parameters of one dispatch.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Dispatch {
    steps: u32,
    max_sweeps: u32,
    most_order: u32,
    sweeps: u32,
    blocks: u32,
    groups: u32,
    nodes: u32,
    fours: u32,
    half_cosine: f32,
    half_sine: f32,
}

/// What members may do.
#[derive(Clone, Copy)]
pub struct Caps {
    /// Maximum sweeps per system.
    pub max_sweeps: u32,
    /// Highest order of an adaptive step.
    pub most_order: u32,
}

/// The buffers of a batch, in the order of their bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// Parameters of the dispatch, the only uniform.
    Dispatch,
    /// Parameters of the members.
    Parameters,
    /// Their counters.
    Counters,
    /// Their reports.
    Reports,
    /// Their states.
    States,
    /// The slots that are due.
    Due,
    /// What a traced kernel records.
    Trace,
}

impl Binding {
    /// All, in order.
    pub const ALL: [Binding; 7] = [
        Binding::Dispatch,
        Binding::Parameters,
        Binding::Counters,
        Binding::Reports,
        Binding::States,
        Binding::Due,
        Binding::Trace,
    ];

    /// Its name in messages of drivers.
    pub fn name(self) -> &'static str {
        ["dispatch", "parameters", "counters", "reports", "states", "due", "trace"][self as usize]
    }

    /// Returns its bytes for `slots` members in numbers of type `T`.
    pub fn bytes<T: Real>(self, blocks: Blocks, slots: usize) -> usize {
        let numbers = |count: usize| slots * count * size_of::<T>();
        match self {
            Binding::Dispatch => size_of::<Dispatch>(),
            Binding::Parameters => numbers(Parameters::<T>::LEN),
            Binding::Counters => slots * size_of::<Counters>(),
            Binding::Reports => numbers(Report::<T>::LEN),
            Binding::States => numbers(state_numbers(blocks)),
            Binding::Due => slots * size_of::<u32>(),
            Binding::Trace => numbers(TRACE_FIELDS * blocks.n),
        }
    }
}

/// Numbers of a state in device memory: for every field a row of four per block.
pub fn state_numbers(blocks: Blocks) -> usize {
    STATE_FIELDS * 4 * blocks.count()
}

/// Converts a state to rows; the last number of a block of three repeats its third node.
pub fn to_rows<T: Real>(blocks: Blocks, state: &State<T>) -> Vec<T> {
    let row = |field: &[T], (first, nodes): (usize, usize)| [0, 1, 2, 3].map(|c| field[first + c.min(nodes - 1)]);
    let numbers = state.to_numbers();
    let fields = numbers.chunks_exact(blocks.n);
    fields.flat_map(|field| blocks.iter().flat_map(move |block| row(field, block))).collect()
}

/// The host's side of slots that are advanced in one dispatch.
pub struct Mirror<T> {
    blocks: Blocks,
    parameters: Vec<T>,
    counters: Vec<Counters>,
    reports: Vec<Report<T>>,
    changed: Vec<bool>,
    due: Vec<u32>,
}

impl<T: Real> Mirror<T> {
    /// Makes room for `slots` members.
    pub fn new(blocks: Blocks, slots: usize) -> Self {
        Mirror {
            blocks,
            parameters: vec![T::of(0.0); slots * Parameters::<T>::LEN],
            counters: vec![Counters::default(); slots],
            reports: vec![Report::default(); slots],
            changed: vec![true; slots],
            due: Vec::new(),
        }
    }

    /// Returns how the rings of its members are cut.
    pub fn blocks(&self) -> Blocks {
        self.blocks
    }

    /// Returns the number of slots.
    pub fn slots(&self) -> usize {
        self.counters.len()
    }

    /// Returns the bytes of its records after a dispatch: counters, then reports.
    pub fn bytes_back(&self) -> usize {
        [Binding::Counters, Binding::Reports].iter().map(|binding| binding.bytes::<T>(self.blocks, self.slots())).sum()
    }

    /// Returns the counters of a member; the sweeps are those of the last dispatch.
    pub fn counters(&self, slot: usize) -> Counters {
        self.counters[slot]
    }

    /// Returns the report on a member.
    pub fn report(&self, slot: usize) -> &Report<T> {
        &self.reports[slot]
    }

    /// Returns where the state of `slot` is stored: its first byte, and their number.
    pub fn state_at(&self, slot: usize) -> (u64, u64) {
        let bytes = (state_numbers(self.blocks) * size_of::<T>()) as u64;
        (slot as u64 * bytes, bytes)
    }

    /// Returns the state that is stored in `rows`.
    pub fn state_of(&self, rows: &[T]) -> State<T> {
        let nodes = |((_, nodes), row): ((usize, usize), &[T])| row[..nodes].to_vec();
        let of_field = |field: &[T]| self.blocks.iter().zip(field.chunks_exact(4)).flat_map(nodes).collect::<Vec<T>>();
        let numbers: Vec<T> = rows.chunks_exact(4 * self.blocks.count()).flat_map(of_field).collect();
        State::from_numbers(&numbers)
    }

    /// Puts a member into a slot; its state is to be stored as [rows](to_rows).
    pub fn load(&mut self, slot: usize, run: &Run<T>) {
        self.counters[slot] = run.counters;
        self.reports[slot] = run.report;
        self.set_parameters(slot, &run.parameters);
    }

    /// Changes the parameters of a member.
    pub fn set_parameters(&mut self, slot: usize, parameters: &Parameters<T>) {
        let length = Parameters::<T>::LEN;
        self.parameters[slot * length..(slot + 1) * length].copy_from_slice(&parameters.to_numbers());
        self.changed[slot] = true;
    }

    /// Changes the counters of a member.
    pub fn set_counters(&mut self, slot: usize, change: impl FnOnce(&mut Counters)) {
        change(&mut self.counters[slot]);
        self.changed[slot] = true;
    }

    /// Looks which members are due, and returns how many: the workgroups of the next dispatch.
    pub fn look(&mut self) -> u32 {
        self.due.clear();
        self.due.extend((0..).zip(&self.counters).filter(|(_, counters)| counters.is_running()).map(|(slot, _)| slot));
        self.due.len() as u32
    }

    /// Passes on what is to be written before a dispatch: the buffer, the first byte, and the bytes.
    pub fn upload(&mut self, Budget { steps, sweeps }: Budget, caps: Caps, write: impl Fn(Binding, u64, &[u8])) {
        let Caps { max_sweeps, most_order } = caps;
        let [nodes, fours, blocks] = [self.blocks.n, self.blocks.fours, self.blocks.count()].map(|count| count as u32);
        let groups = blocks.isqrt();
        let [half_cosine, half_sine] = half_angle(self.blocks.n).map(|number| number as f32);
        let asked =
            Dispatch { steps, max_sweeps, most_order, sweeps, blocks, groups, nodes, fours, half_cosine, half_sine };
        write(Binding::Dispatch, 0, bytemuck::bytes_of(&asked));
        write(Binding::Due, 0, bytemuck::cast_slice(&self.due));
        // From the first changed slot to the last: needless uploads in between only write back what came from the
        // device.
        let Some(first) = self.changed.iter().position(|changed| *changed) else { return };
        let end = self.changed.iter().rposition(|changed| *changed).map_or(first, |last| last + 1);
        self.changed[first..end].fill(false);
        let reports: Vec<T> = self.reports[first..end].iter().flat_map(Report::to_numbers).collect();
        let length = Parameters::<T>::LEN;
        let from = |binding: Binding| (binding.bytes::<T>(self.blocks, first)) as u64;
        let parameters = bytemuck::cast_slice(&self.parameters[first * length..end * length]);
        write(Binding::Parameters, from(Binding::Parameters), parameters);
        write(Binding::Counters, from(Binding::Counters), bytemuck::cast_slice(&self.counters[first..end]));
        write(Binding::Reports, from(Binding::Reports), bytemuck::cast_slice(&reports));
    }

    /// Takes the counters and the reports of all slots as they came back from a dispatch.
    ///
    /// # Errors
    /// The slot of a member that was due and has neither made a step or a sweep nor ended: a kernel that does nothing
    /// must not be waited for.
    pub fn take(&mut self, bytes: &[u8]) -> Result<(), usize> {
        let (counters, reports) = bytes.split_at(self.slots() * size_of::<Counters>());
        let counters: Vec<Counters> = bytemuck::pod_collect_to_vec(counters);
        let reports: Vec<T> = bytemuck::pod_collect_to_vec(reports);
        self.forget_sweeps();
        for slot in self.due.iter().map(|slot| *slot as usize) {
            if !has_advanced(&self.counters[slot], &counters[slot]) {
                return Err(slot);
            }
            self.counters[slot] = counters[slot];
            self.reports[slot] = Report::from_numbers(&reports[slot * Report::<T>::LEN..(slot + 1) * Report::<T>::LEN]);
        }
        Ok(())
    }

    /// Whether a member that was due has used up its budget: it neither ended nor came to its goal.
    pub fn has_used_up(&self) -> bool {
        self.due.iter().any(|slot| self.counters[*slot as usize].is_running())
    }

    /// Members that were not due have made no sweeps.
    pub fn forget_sweeps(&mut self) {
        for counters in &mut self.counters {
            (counters.sweeps_k, counters.sweeps_x) = (0, 0);
        }
    }
}

/// Whether a due member has made a step or a sweep, or ended.
fn has_advanced(before: &Counters, after: &Counters) -> bool {
    let position = |c: &Counters| (c.status, c.steps, c.rejected, c.phase, c.solve_sweeps);
    position(before) != position(after) || after.sweeps_k + after.sweeps_x > 0
}
