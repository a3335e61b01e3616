//! Which back end a spec gets, and why. Everything that can be refused is refused here, before any work.

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use crate::conformance::{Driven, compare::MAX_SWEEPS, self_test};
use curvelax_backend::{
    Backend, DeviceKind,
    cpu::{CpuBackend, Vectorised},
    gpu::{Capacity, Variant},
};
use curvelax_base::error::{Error, Result};
use curvelax_ensemble::{
    Cell, Spec, Study,
    request::spec::{BackendChoice, OrAuto, Precision},
    study::Stage,
};
use curvelax_flow::{
    scheme::{extrapolation::MOST_ORDER, step::Method},
    solver::{Blocks, Order, ring::MIN_POINTS},
};
use curvelax_gpu::{Device, Gpu, Kernel, LOADS_DRIVERS, may_have_hardware, patience};

pub use crate::conformance::bounds::MAX_POINTS_F32;

/// Where a run is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Platform {
    /// Kind of device.
    pub backend: DeviceKind,
    /// Name of the GPU adapter.
    pub adapter: Option<String>,
    /// Its driver and the driver's version.
    pub driver: Option<String>,
    /// Hardware or software, integrated or discrete.
    pub device_type: Option<String>,
    /// Number type of the arithmetic.
    pub precision: Precision,
    /// Why this back end was chosen.
    pub reason: String,
    /// Threads of the CPU back end.
    pub threads: Option<usize>,
}

impl Platform {
    /// Returns whether results there are the same to the last bit: those of the same program on the same adapter and
    /// driver, or on any CPU, whatever its threads and vectors.
    pub fn computes_like(&self, other: &Platform) -> bool {
        let place = |of: &Platform| (of.backend, of.adapter.clone(), of.driver.clone(), of.precision);
        place(self) == place(other)
    }

    /// Returns back end, adapter and driver.
    pub fn name(&self) -> String {
        let backend = self.backend.to_string();
        let parts = [Some(backend.as_str()), self.adapter.as_deref(), self.driver.as_deref()];
        parts.into_iter().flatten().collect::<Vec<_>>().join(" ")
    }

    /// Writes to a spec where it ran, which differs from the choice if the GPU failed.
    pub fn settle_place(&self, spec: &mut Spec) {
        spec.backend = self.backend.into();
        spec.adapter = self.adapter.clone();
    }
}

/// A back end that suits a spec, not yet opened.
#[derive(Clone)]
pub struct ChosenBackend {
    /// The device.
    pub device: Device,
    /// Its number, if it was requested by number.
    pub number: Option<String>,
    /// Whether the CPU takes over if the GPU cannot be opened or computes wrongly, since that GPU was not requested.
    pub or_cpu: bool,
    /// Number type of the run.
    pub precision: Precision,
    /// Why it was chosen.
    pub reason: String,
}

/// Chooses the back end for the members of a spec.
///
/// # Errors
/// [`Error::Request`] if the adapter, the precision or n is not available.
pub fn choose(spec: &Spec) -> Result<ChosenBackend> {
    match spec.backend {
        BackendChoice::Cpu => cpu(spec, "asked for".into()),
        BackendChoice::Gpu => gpu(spec),
        BackendChoice::Auto if spec.adapter.is_some() => gpu(spec),
        // Drivers are loaded only if needed: loading takes a tenth of a second, and Mesa's print messages that only
        // matter to windows.
        BackendChoice::Auto if !may_have_hardware() => auto(spec, Vec::new()),
        BackendChoice::Auto => auto(spec, Gpu::list()),
    }
}

/// Chooses back ends for the stages of a study: all on one device, that of its first own members, or with
/// `--backend auto` on the CPU if that device cannot run all of them. A pilot is on the CPU: a few members do not fill
/// a GPU. So are members that need more nodes than the device can hold.
///
/// # Errors
/// As [`choose`].
pub fn choose_all(study: &Study) -> Result<Vec<ChosenBackend>> {
    let (stages, own) = (study.stages(), study.own_stage());
    let specs: Vec<Spec> = stages.iter().map(|stage| study.spec_of(stage)).collect::<Result<_>>()?;
    let choice = choose(&specs[own])?;
    let there = |(stage, spec): (&Stage, &Spec)| {
        if stage.level.is_some() && study.has_pilot() {
            return cpu(spec, "a pilot does not fill a GPU".into());
        }
        if stage.is_selective() {
            return choice.with_nodes(spec);
        }
        let mut spec = spec.clone();
        choice.settle_place(&mut spec);
        choose(&spec)
    };
    let others: Result<Vec<ChosenBackend>> =
        stages.iter().zip(&specs).enumerate().filter(|(i, _)| *i != own).map(|(_, of)| there(of)).collect();
    match others {
        Err(error) if choice.or_cpu => {
            let reason = format!("the GPU cannot do all cells: {error}");
            specs.iter().map(|spec| cpu(spec, reason.clone())).collect()
        }
        others => {
            let mut all = others?;
            all.insert(own, choice);
            Ok(all)
        }
    }
}

/// Writes the settings chosen for the stages to a study, so that it can be repeated exactly.
pub fn settle(study: &mut Study, choices: &[ChosenBackend]) {
    let stages = study.stages().to_vec();
    let own = || stages.iter().zip(choices).filter(|(stage, _)| stage.level.is_none());
    for (stage, choice) in own() {
        study.cells_mut()[stage.range.clone()].iter_mut().for_each(|cell| choice.settle(&mut cell.spec));
    }
    let first = own().next();
    study.settle_spec(|spec| first.iter().for_each(|(_, first)| first.settle_place(spec)));
}

/// The choice of `--backend auto`: the first hardware GPU that can do the run, else the CPU.
fn auto(spec: &Spec, adapters: Vec<Gpu>) -> Result<ChosenBackend> {
    if spec.order == Order::Lexicographic {
        return cpu(spec, "lexicographic sweeps run on the CPU".into());
    }
    let none = if LOADS_DRIVERS { "no hardware GPU found" } else { "a static program cannot load GPU drivers" };
    let mut reason = none.to_string();
    for adapter in adapters.into_iter().filter(Gpu::is_hardware) {
        let name = adapter.name().to_string();
        match take(spec, adapter, format!("hardware GPU {name}")) {
            Ok(choice) => return Ok(ChosenBackend { or_cpu: true, ..choice }),
            Err(error) => reason = format!("GPU {name} cannot do it: {error}"),
        }
    }
    cpu(spec, reason)
}

fn cpu(spec: &Spec, reason: String) -> Result<ChosenBackend> {
    let precision = spec.precision.unwrap_or(Precision::F64);
    check_precision(spec, precision)?;
    Ok(ChosenBackend { device: Device::Cpu, number: None, or_cpu: false, precision, reason })
}

fn gpu(spec: &Spec) -> Result<ChosenBackend> {
    if spec.order == Order::Lexicographic {
        let message = "--adapter: lexicographic sweeps run on the CPU only; leave out --adapter";
        return Err(Error::Request(message.into()));
    }
    let found = Gpu::list();
    let names: Vec<String> = found.iter().map(|gpu| gpu.name().to_string()).collect();
    let (chosen, by_number) = Gpu::select(found, spec.adapter.as_deref());
    let adapter = chosen.into_iter().next().ok_or_else(|| no_adapter(spec.adapter.as_deref(), &names))?;
    let number = by_number.then(|| spec.adapter.clone()).flatten();
    Ok(ChosenBackend { number, ..take(spec, adapter, "asked for".into())? })
}

/// Why there is no adapter, and what to do.
pub fn why_no_adapter() -> &'static str {
    if LOADS_DRIVERS {
        "this machine has none; use --backend cpu, or install a GPU driver (Debian's software GPU is \
         mesa-vulkan-drivers)"
    } else {
        "a static program cannot load GPU drivers; use --backend cpu, or the program for linux-gnu"
    }
}

/// Returns the error for a missing adapter; `names` are the existing ones.
pub fn no_adapter(asked: Option<&str>, names: &[String]) -> Error {
    let there =
        if names.is_empty() { why_no_adapter().to_string() } else { format!("there are: {}", names.join(", ")) };
    match asked {
        Some(name) => Error::Request(format!("--adapter {name}: no such adapter; {there} (see `curvelax adapters`)")),
        None => Error::Request(format!("--backend gpu: no GPU adapter; {there}")),
    }
}

fn take(spec: &Spec, adapter: Gpu, reason: String) -> Result<ChosenBackend> {
    let precision = fitting_precision(spec, adapter.name(), &adapter.capacity())?;
    Ok(ChosenBackend { device: Device::Gpu(Arc::new(adapter)), number: None, or_cpu: false, precision, reason })
}

/// The precision of the run on an adapter, if its members fit.
fn fitting_precision(spec: &Spec, name: &str, capacity: &Capacity) -> Result<Precision> {
    let precision = spec.precision.unwrap_or(capacity.best_precision());
    if precision == Precision::F64 && !capacity.f64 {
        let problem = format!("adapter {name} has no f64");
        return Err(Error::value("precision", "f64", &problem, "use --precision f32, or --backend cpu"));
    }
    check_precision(spec, precision)?;
    let (blocks, solver) = (ring(spec.points)?, spec.solver());
    let (fits, most) = match precision {
        Precision::F32 => {
            (capacity.check_size::<f32>(blocks, solver), capacity.max_points::<f32>(solver).min(MAX_POINTS_F32))
        }
        Precision::F64 => (capacity.check_size::<f64>(blocks, solver), capacity.max_points::<f64>(solver)),
    };
    fits.map_err(|needs| {
        let problem = format!("a member needs {needs}");
        let fewer = if most < MIN_POINTS { String::new() } else { format!("use {most} or fewer, or ") };
        Error::value("points", spec.points, &problem, &format!("{fewer}--backend cpu"))
    })?;
    Ok(precision)
}

/// f32 has a resolution limit: rounding grows like (1/h)⁴, and beyond the verified n results would only look right.
fn check_precision(spec: &Spec, precision: Precision) -> Result<()> {
    // Levels beside fixed steps are solved directly.
    let by_sweeps = spec.adaptive.is_some() && spec.solver().sweeps();
    if precision == Precision::F32 && spec.refine && by_sweeps {
        let problem = "in f32 sweeps leave larger errors with it than --refine is to find";
        let tightest = precision.tolerance(true);
        let [tolerance, other] = [spec.tolerance_at(precision), tightest].map(|tolerance| format!("{tolerance:e}"));
        if spec.sor() != OrAuto::Auto {
            return Err(Error::value(
                "sor",
                spec.sor(),
                problem,
                "use --sor auto, --solver direct, or --precision f64",
            ));
        }
        if spec.tolerance_at(precision) > tightest {
            let allowed = format!("use {other} or less, --solver direct, or --precision f64");
            return Err(Error::value("tolerance", tolerance, problem, &allowed));
        }
    }
    if precision == Precision::F32 && spec.points > MAX_POINTS_F32 {
        let problem = format!("f32 was verified against f64 up to {MAX_POINTS_F32} points; rounding grows like n^4");
        return Err(Error::value("points", spec.points, &problem, "use fewer points, or --precision f64"));
    }
    Ok(())
}

fn ring(n: usize) -> Result<Blocks> {
    Blocks::new(n).ok_or_else(|| Error::value("points", n, "the scheme needs 6 nodes", "use 6 or more"))
}

impl ChosenBackend {
    /// What the user should know about the choice: a software GPU is used only if a GPU is requested.
    pub fn warning(&self) -> Option<String> {
        let gpu = self.device.gpu().filter(|_| self.is_software_gpu())?;
        Some(format!("{} is a software GPU, and the CPU back end is faster: use --backend cpu", gpu.name()))
    }

    /// Returns whether the members are advanced by software that acts as a GPU.
    pub fn is_software_gpu(&self) -> bool {
        self.device.gpu().is_some_and(|gpu| !gpu.is_hardware())
    }

    /// Describes the choice in one line: what was chosen and why, and which solver.
    pub fn sentence(&self, spec: &Spec) -> String {
        format!("{}; {}", self.place(), spec.solver().facts().title)
    }

    /// The same without the solver.
    pub fn place(&self) -> String {
        format!("back end: {}, {} ({})", self.device, self.precision.name(), self.reason)
    }

    /// Writes all settings of this choice to the spec, so that it can be repeated exactly.
    pub fn settle(&self, spec: &mut Spec) {
        self.settle_place(spec);
        if spec.solver().sweeps() {
            spec.tolerance = Some(spec.tolerance_at(self.precision));
            spec.sor = Some(spec.sor());
        }
        spec.solver = spec.solver().into();
    }

    /// Writes the common settings of all cells to a spec: where they are computed.
    pub fn settle_place(&self, spec: &mut Spec) {
        spec.backend = self.device.kind().into();
        // Several adapters of one name are distinguished only by their numbers.
        let name = || self.device.gpu().map(|gpu| gpu.name().to_string());
        spec.adapter = self.number.clone().or_else(name);
        spec.precision = Some(self.precision);
    }

    /// Returns where this choice computes the members of `spec`.
    pub fn platform(&self, spec: &Spec) -> Platform {
        let gpu = self.device.gpu();
        Platform {
            backend: self.device.kind(),
            adapter: gpu.map(|gpu| gpu.name().to_string()),
            driver: gpu.map(|gpu| gpu.driver()),
            device_type: gpu.map(|gpu| gpu.device_type()),
            precision: self.precision,
            reason: self.reason.clone(),
            threads: gpu.is_none().then(|| threads(spec)),
        }
    }

    /// Returns the choice for a later part of a study whose first part runs `there`, since a study does not change
    /// device midway. If the GPU of the first part failed, this is the CPU; otherwise a GPU that fails is an error.
    pub fn after(self, there: &Platform) -> ChosenBackend {
        match (self.device.kind(), there.backend) {
            (DeviceKind::Gpu, DeviceKind::Cpu) => self.on_cpu(there.reason.clone()),
            _ => ChosenBackend { or_cpu: false, ..self },
        }
    }

    /// The same device for members of another number of nodes, or the CPU in f64 if it cannot hold them.
    fn with_nodes(&self, spec: &Spec) -> Result<ChosenBackend> {
        let same = Spec { precision: Some(self.precision), ..spec.clone() };
        let fits = match &self.device {
            Device::Cpu => check_precision(&same, self.precision),
            Device::Gpu(gpu) => fitting_precision(&same, gpu.name(), &gpu.capacity()).map(drop),
        };
        match fits {
            Ok(()) => Ok(self.clone()),
            Err(error) => cpu(&Spec { precision: None, ..spec.clone() }, error.to_string()),
        }
    }

    fn on_cpu(&self, reason: String) -> ChosenBackend {
        ChosenBackend { device: Device::Cpu, number: None, or_cpu: false, precision: self.precision, reason }
    }

    /// Opens the device for a cohort of cells, under the eyes of `watch`, which receives what is opened.
    ///
    /// # Errors
    /// As [`open`](ChosenBackend::open), and that of the watch.
    pub fn open_for(&self, cohort: &[Cell], watch: &OpeningWatch) -> Result<(Box<dyn Backend>, Platform)> {
        (watch.tell)(&self.sentence(&cohort[0].spec));
        let curves = cohort.iter().map(|cell| cell.spec.member_count()).sum();
        let whole = Spec { curves, only: None, shard: None, ..cohort[0].spec.clone() };
        self.open_any(&whole, watch)
    }

    /// Opens the device for the members of `spec`; a GPU must pass a
    /// [self-test](crate::conformance::self_test()). If `--backend auto` chose a GPU that fails or is not ready in two
    /// minutes, it opens the CPU, and the platform's reason says why.
    ///
    /// # Errors
    /// [`Error::Device`] if a requested GPU cannot be opened or computes wrongly.
    pub fn open(&self, spec: &Spec) -> Result<(Box<dyn Backend>, Platform)> {
        self.open_any(spec, &OpeningWatch::default())
    }

    fn open_any(&self, spec: &Spec, watch: &OpeningWatch) -> Result<(Box<dyn Backend>, Platform)> {
        match self.precision {
            Precision::F32 => self.open_in::<f32>(spec, watch),
            Precision::F64 => self.open_in::<f64>(spec, watch),
        }
    }

    fn open_in<T: Vectorised>(&self, spec: &Spec, watch: &OpeningWatch) -> Result<(Box<dyn Backend>, Platform)> {
        let blocks = ring(spec.points)?;
        let method = Method {
            solver: spec.solver(),
            order: spec.order,
            max_sweeps: spec.max_sweeps,
            most_order: spec.most_order.unwrap_or(MOST_ORDER),
        };
        let opened = match &self.device {
            Device::Cpu => CpuBackend::<T>::for_members(blocks, method, threads(spec), spec.member_count())
                .map(|backend| Box::new(backend) as Box<dyn Backend>),
            Device::Gpu(gpu) => {
                let limit = if self.or_cpu { Some(patience()?) } else { None };
                open_gpu::<T>(gpu, blocks, spec, &method, limit, watch)
            }
        };
        match opened {
            Ok(backend) => Ok((backend, self.platform(spec))),
            Err(Error::Device(fault)) if self.or_cpu => {
                self.on_cpu(format!("the GPU failed: {fault}")).open_in::<T>(spec, watch)
            }
            Err(error) => Err(error),
        }
    }
}

/// Watches a device being opened.
pub struct OpeningWatch<'a> {
    /// Receives which back end is opened, and in a `note: …` what is waited for, if that takes long.
    pub tell: &'a dyn Fn(&str),
    /// Asked several times a second during the wait; an error ends it.
    pub may_continue: &'a dyn Fn() -> Result<()>,
}

impl Default for OpeningWatch<'_> {
    fn default() -> Self {
        OpeningWatch { tell: &|_| {}, may_continue: &|| Ok(()) }
    }
}

/// Threads of the CPU back end: all cores unless the spec gives a number.
fn threads(spec: &Spec) -> usize {
    spec.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

/// Creates the kernel for the members of `spec`, which has passed its self-test. Compiling may take the time `limit`.
fn open_gpu<T: Vectorised>(
    gpu: &Arc<Gpu>,
    blocks: Blocks,
    spec: &Spec,
    method: &Method,
    limit: Option<Duration>,
    watch: &OpeningWatch,
) -> Result<Box<dyn Backend>> {
    let members = usize::try_from(spec.member_count()).unwrap_or(usize::MAX);
    let adaptive = spec.adaptive.is_some();
    // Those that may vanish pause, too.
    let watched = !spec.event.is_empty() || spec.drive.is_some();
    let driven = Driven::of(spec);
    let variant = Variant { adaptive, watched, ..driven.variant(gpu.capacity().variant(blocks, spec.solver())) };
    // The self-test has its own cap: with the run's, a solve may end before it converges, and then roundings decide.
    let tested = Method { max_sweeps: MAX_SWEEPS, ..*method };
    let then =
        limit.map_or(String::new(), |limit| format!("; after {} s the CPU is used instead", limit.as_secs_f64()));
    let waits = || (watch.tell)(&format!("note: GPU {} is still compiling the kernel{then}", gpu.name()));
    gpu.compile::<T>(blocks, variant, limit, &waits, watch.may_continue)?;
    let mut kernel = Kernel::<T>::new(gpu, blocks, members, tested.max_sweeps, variant)?;
    let device = format!("{} ({})", gpu.name(), gpu.driver());
    self_test::<T>(&mut kernel, &device, gpu.is_hardware(), &tested, blocks.n, adaptive, driven)?;
    Ok(Box::new(kernel.with_caps(method.max_sweeps, method.most_order)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAST: Capacity = Capacity::LEAST;

    fn refused(precision: Option<Precision>, n: usize, capacity: &Capacity) -> String {
        let spec = Spec { precision, points: n, ..Spec::default() };
        fitting_precision(&spec, "toaster", capacity).unwrap_err().to_string()
    }

    #[test]
    fn f64_on_an_adapter_without_it_is_refused_by_name() {
        let message = refused(Some(Precision::F64), 100, &LEAST);
        for part in ["--precision f64", "adapter toaster has no f64", "--precision f32", "--backend cpu"] {
            assert!(message.contains(part), "{message}");
        }
    }

    #[test]
    fn a_run_that_asks_for_no_precision_gets_the_best_there_is() {
        let spec = Spec::default();
        assert_eq!(fitting_precision(&spec, "toaster", &LEAST).unwrap(), Precision::F32);
        let with_f64 = Capacity { f64: true, ..LEAST };
        assert_eq!(fitting_precision(&spec, "toaster", &with_f64).unwrap(), Precision::F64);
    }

    #[test]
    fn more_points_than_the_workgroup_holds_are_refused_with_the_largest_number_that_fits() {
        let capacity = Capacity { f64: true, ..LEAST };
        let spec = Spec { precision: Some(Precision::F64), ..Spec::default() };
        let most = capacity.max_points::<f64>(spec.solver());
        assert!(most >= 512, "{most}");
        fitting_precision(&Spec { points: most, ..spec }, "toaster", &capacity).unwrap();
        let message = refused(Some(Precision::F64), most + 1, &capacity);
        for part in [format!("--points {}", most + 1), format!("use {most} or fewer"), "--backend cpu".into()] {
            assert!(message.contains(&part), "{message}");
        }
        let few_threads = Capacity { threads: 32, ..capacity };
        assert!(refused(Some(Precision::F64), 256, &few_threads).contains("threads a workgroup"));
    }

    #[test]
    fn f32_beyond_what_was_verified_is_refused_with_the_reason() {
        let spec =
            |points| Spec { points, precision: Some(Precision::F32), backend: BackendChoice::Cpu, ..Spec::default() };
        choose(&spec(MAX_POINTS_F32)).unwrap();
        let message = choose(&spec(MAX_POINTS_F32 + 1)).err().unwrap().to_string();
        assert!(message.contains("verified against f64 up to"), "{message}");
    }
}
