//! A run in a worker: the program's own loop, turn by turn, and what the page shows of it.

use std::time::{Duration, Instant};

use curvelax_backend::bounds;
use curvelax_backend::{
    Backend,
    cpu::{CpuBackend, Vectors},
};
use curvelax_curve::polygon;
use curvelax_ensemble::{
    Cell, Ended, RunProgress, Sink, Study,
    outcome::wulff_outline,
    request::spec::Precision,
    schedule::grid,
    simulate::{Roster, Simulation},
    trajectory::UserFrame,
};
use curvelax_flow::{
    equilibrium::Equilibrium,
    scheme::{
        Parameters, State, extrapolation,
        member::{Counters, Report},
        run::Run as MemberRun,
        step::Method,
    },
    solver::Blocks,
};
use glam::DVec2;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::gpu::WebGpu;
use crate::settings::Settings;

/// Time of a turn on the CPU, so that curves move.
const TURN: Duration = Duration::from_millis(25);
/// Time between two frames.
const FRAME: Duration = Duration::from_millis(40);

/// Where the members are advanced.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// In the worker, in f64.
    Cpu,
    /// By WebGPU, in f32.
    Gpu {
        /// Whether it is hardware, which rounds in other ways.
        hardware: bool,
    },
}

enum Device {
    Cpu(CpuBackend<f64>),
    Gpu(WebGpu),
}

impl Device {
    fn backend(&mut self) -> &mut dyn Backend {
        match self {
            Device::Cpu(cpu) => cpu,
            Device::Gpu(gpu) => gpu,
        }
    }
}

/// The run of a worker. What it borrows is leaked: a worker has one run, and ends with it.
pub struct Run {
    cell: &'static Cell,
    simulation: Simulation<'static>,
    watched: Watched,
    ended: Vec<Ended>,
    hardware: Option<bool>,
    /// Members told to the page.
    told: usize,
    continues: bool,
    nodes: Vec<f32>,
    excess: Vec<f64>,
    /// For each member of a crystal the Wulff shape of its first state, or of its last one.
    rests: Vec<f32>,
    times: Vec<f64>,
    /// For each member the time at which it relaxed, or until which it has not.
    relaxed: Vec<(f64, bool)>,
    /// Areas, at about the start.
    areas: Vec<Option<f64>>,
    /// Bytes that JavaScript reads.
    kept: Vec<Vec<u8>>,
    since: Instant,
}

impl Run {
    /// Starts a run, and says what the page has to know.
    pub fn start(settings: &Settings, place: Place) -> Result<(Run, Value), String> {
        let told = |error: curvelax_base::Error| error.to_string();
        let study: &'static Study = Box::leak(Box::new(settings.study()?));
        let [cell] = study.cells() else { return Err("this page runs one ensemble at a time".into()) };
        let (spec, members) = (&cell.spec, study.member_count() as usize);
        let blocks = Blocks::new(spec.points).ok_or("the scheme needs 6 nodes")?;
        let method = Method {
            solver: spec.solver(),
            order: spec.order,
            max_sweeps: spec.max_sweeps,
            most_order: spec.most_order.unwrap_or(extrapolation::MOST_ORDER),
        };
        let (device, precision, hardware) = match place {
            Place::Cpu => {
                let cpu = CpuBackend::<f64>::with_vectors(blocks, method, 1, Vectors::None).map_err(told)?;
                (Device::Cpu(cpu.for_display(members, TURN)), Precision::F64, None)
            }
            Place::Gpu { hardware } => {
                let gpu = WebGpu::new(blocks, &method, spec.adaptive.is_some(), members).map_err(told)?;
                (Device::Gpu(gpu), Precision::F32, Some(hardware))
            }
        };
        // Without portraits, which the page does not show, and for which members would pause.
        let roster = Box::leak(Box::new(Roster::new(study.cells(), precision, 0)));
        let simulation = Simulation::new(roster, members, 1, RunProgress::default()).map_err(told)?;
        let times: Vec<f64> = grid(spec.final_time()).collect();
        let gpu = if let Device::Gpu(gpu) = &device { Some(gpu.description()) } else { None };
        let answer = json!({ "members": members, "n": spec.points, "times": times, "gpu": gpu });
        let run = Run {
            cell,
            simulation,
            watched: Watched {
                device,
                placed: vec![None; members],
                states: vec![None; members],
                last: Vec::new(),
                seen: None,
                is_due: true,
            },
            ended: Vec::new(),
            hardware,
            told: 0,
            continues: true,
            nodes: vec![f32::NAN; 2 * members * spec.points],
            excess: vec![f64::NAN; members * times.len()],
            rests: Vec::new(),
            relaxed: vec![(0.0, false); members],
            areas: vec![None; members],
            times,
            kept: Vec::new(),
            since: Instant::now(),
        };
        Ok((run, answer))
    }

    /// Takes a turn. The answer has the dispatch that is to be made before the next one, and whether a frame is due.
    pub fn turn(&mut self) -> Result<Value, String> {
        let gone = self.simulation.turn(&mut self.watched, &mut Collected(&mut self.ended));
        self.continues = gone.map_err(|error| error.to_string())?;
        for (slot, trajectory) in self.simulation.resident() {
            self.watched.placed[slot] = Some((trajectory.index(), trajectory.placing()));
        }
        let Run { watched: Watched { device, .. }, kept, .. } = self;
        let dispatch = if let Device::Gpu(gpu) = device { gpu.fetch(kept) } else { None };
        self.since = Instant::now();
        let frame = self.watched.is_due || !self.continues;
        Ok(json!({ "continues": self.continues, "dispatch": dispatch, "frame": frame }))
    }

    /// Takes what came back from the GPU.
    pub fn deliver(&mut self, bytes: &[u8]) {
        if let Device::Gpu(gpu) = &mut self.watched.device {
            gpu.deliver(bytes, self.since.elapsed());
        }
    }

    /// Brings nodes and excess up to date, and says what has happened.
    pub fn frame(&mut self) -> Result<Value, String> {
        let n = self.cell.spec.points;
        self.watched.is_due = false;
        let mut shown = std::mem::take(&mut self.watched.last);
        let mut excesses = Vec::new();
        for (slot, trajectory) in self.simulation.resident() {
            let member = trajectory.index();
            let state = self.watched.states[slot].take();
            shown.extend(state.map(|state| (member, trajectory.placing(), state)));
            excesses.push((member as usize, trajectory.excess()));
            self.relaxed[member as usize] = (trajectory.now(), false);
        }
        excesses.into_iter().for_each(|(member, excess)| self.note(member, &excess));
        let new: Vec<Ended> = self.ended[self.told..].to_vec();
        let over: Vec<u64> = new.iter().map(|ended| ended.outcome.member).collect();
        for (member, placing, state) in shown {
            let first = 2 * member as usize * n;
            let nodes = placing.nodes(&state);
            if self.areas[member as usize].is_none() || over.contains(&member) {
                self.note_rest(member as usize, &nodes);
            }
            self.areas[member as usize].get_or_insert_with(|| polygon::signed_area(&nodes));
            for (to, node) in self.nodes[first..first + 2 * n].chunks_exact_mut(2).zip(nodes) {
                to.copy_from_slice(&[node.x as f32, node.y as f32]);
            }
        }
        for ended in &new {
            let (member, outcome) = (ended.outcome.member as usize, &ended.outcome);
            self.note(member, &ended.excess);
            self.relaxed[member] = outcome.t_relax.map_or((outcome.t_end, false), |t| (t, true));
        }
        self.told = self.ended.len();
        Ok(json!({
            "ended": new.iter().map(|ended| self.row(ended)).collect::<Vec<_>>(),
            "done": self.ended.len(),
            "continues": self.continues,
            "rests": self.rests.len(),
            "mean": self.mean(),
            "times": self.relaxed,
            "area": self.areas.iter().flatten().sum::<f64>() / self.areas.iter().flatten().count() as f64,
        }))
    }

    /// Notes the Wulff shape of the area and the centroid of a member, if it is a crystal.
    fn note_rest(&mut self, member: usize, nodes: &[DVec2]) {
        let Equilibrium::Wulff(energy) = self.cell.spec.typical().flow.equilibrium() else { return };
        let shape = wulff_outline(nodes, &energy);
        self.rests.resize(2 * shape.len() * self.relaxed.len(), f32::NAN);
        let own = &mut self.rests[2 * shape.len() * member..][..2 * shape.len()];
        for (to, node) in own.chunks_exact_mut(2).zip(shape) {
            to.copy_from_slice(&[node.x as f32, node.y as f32]);
        }
    }

    fn note(&mut self, member: usize, excess: &[f64]) {
        let first = member * self.times.len();
        self.excess[first..first + excess.len()].copy_from_slice(excess);
    }

    /// The mean excess at the times that all members have reached.
    fn mean(&self) -> Vec<f64> {
        let members = self.relaxed.len();
        let at = |i: usize| self.excess.iter().skip(i).step_by(self.times.len()).sum::<f64>() / members as f64;
        (0..self.times.len()).map(at).take_while(|mean| mean.is_finite()).collect()
    }

    /// The row of a member in the page's table, with the conformance bound of its time if that is known: of a GPU, in
    /// fixed steps.
    fn row(&self, ended: &Ended) -> Value {
        let outcome = &ended.outcome;
        let bound = self.hardware.zip(outcome.t_relax).filter(|_| self.cell.spec.adaptive.is_none());
        let bound = bound.and_then(|(hardware, t)| {
            let after = self.times.iter().position(|time| *time >= t).filter(|after| *after > 0)?;
            let [before, now] = [after - 1, after].map(|i| Some((*self.times.get(i)?, *ended.excess.get(i)?)));
            let ((t0, e0), (t1, e1)) = before.zip(now)?;
            let steps = (t / outcome.t_end * outcome.steps as f64).ceil() as u32;
            Some(bounds::excess_time::<f32>(hardware, steps, (e0 - e1) / (t1 - t0)))
        });
        json!({
            "member": outcome.member,
            "status": outcome.status.name(),
            "t_relax": outcome.t_relax,
            "steps": outcome.steps,
            "bound": bound,
        })
    }

    /// The nodes of the last frame.
    pub fn nodes(&self) -> &[f32] {
        &self.nodes
    }

    /// The Wulff shapes of all members, each a polygon of as many nodes; empty unless they are crystals.
    pub fn rests(&self) -> &[f32] {
        &self.rests
    }

    /// The excess of all members at all times of the grid.
    pub fn excess(&self) -> &[f64] {
        &self.excess
    }
}

/// Collects the members in memory.
struct Collected<'a>(&'a mut Vec<Ended>);

impl Sink for Collected<'_> {
    fn member(&mut self, ended: &Ended) -> curvelax_base::Result<()> {
        self.0.push(ended.clone());
        Ok(())
    }
}

/// A device that keeps states to be shown: while it advances members, they cannot be asked for.
struct Watched {
    device: Device,
    /// The member in each slot, after the last turn.
    placed: Vec<Option<(u64, UserFrame)>>,
    /// Their states, when a frame is due.
    states: Vec<Option<State<f64>>>,
    /// The last states of members that have left.
    last: Vec<(u64, UserFrame, State<f64>)>,
    seen: Option<Instant>,
    is_due: bool,
}

impl Backend for Watched {
    fn slots(&self) -> usize {
        self.placed.len()
    }
    fn load(&mut self, slot: usize, run: &MemberRun<f64>) -> curvelax_base::Result<()> {
        self.states[slot] = Some(run.state.clone());
        self.device.backend().load(slot, run)
    }
    fn aim(&mut self, slot: usize, goal: u32, parameters: &Parameters<f64>) {
        self.device.backend().aim(slot, goal, parameters);
    }
    fn clear(&mut self, slot: usize) {
        if let (Some((member, placing)), Ok(state)) = (self.placed[slot].take(), self.device.backend().state(slot)) {
            self.last.push((member, placing, state));
        }
        self.device.backend().clear(slot);
    }
    fn batches(&self) -> usize {
        1
    }
    fn start(&mut self, batch: usize) -> curvelax_base::Result<()> {
        self.device.backend().start(batch)
    }
    fn is_back(&mut self, batch: usize, most: Duration) -> bool {
        self.device.backend().is_back(batch, most)
    }
    fn finish(&mut self, batch: usize) -> curvelax_base::Result<()> {
        self.device.backend().finish(batch)?;
        if self.seen.is_none_or(|seen| seen.elapsed() >= FRAME) {
            (self.seen, self.is_due) = (Some(Instant::now()), true);
            for slot in (0..self.placed.len()).filter(|slot| self.placed[*slot].is_some()) {
                self.states[slot] = Some(self.device.backend().state(slot)?);
            }
        }
        Ok(())
    }
    fn counters(&self, slot: usize) -> Counters {
        match &self.device {
            Device::Cpu(cpu) => cpu.counters(slot),
            Device::Gpu(gpu) => gpu.counters(slot),
        }
    }
    fn report(&self, slot: usize) -> Report<f64> {
        match &self.device {
            Device::Cpu(cpu) => cpu.report(slot),
            Device::Gpu(gpu) => gpu.report(slot),
        }
    }
    fn state(&mut self, slot: usize) -> curvelax_base::Result<State<f64>> {
        self.device.backend().state(slot)
    }
}
