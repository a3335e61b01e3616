//! Adapters: which exist, what each can do, and which one to use.

use std::{
    collections::HashMap,
    sync::{
        Arc, Mutex, PoisonError,
        mpsc::{RecvTimeoutError, channel},
    },
    time::{Duration, Instant},
};

use crate::{
    LOADS_DRIVERS, abandoned,
    clock::Moment,
    pipeline::{self, Key},
};
use curvelax_backend::gpu::{Capacity, Variant, shader};
use curvelax_base::{
    error::{Error, Result, one_line},
    guard::guarded,
    threads,
};
use curvelax_flow::{number::Real, solver::Blocks};

/// Time after which a driver that is still compiling is reported.
const LONG: Duration = Duration::from_secs(5);
/// Time between two checks whether to continue.
const PERIOD: Duration = Duration::from_millis(100);

/// An adapter that could run the kernel.
pub struct Gpu {
    adapter: wgpu::Adapter,
    info: wgpu::AdapterInfo,
    /// Whether kernels are compiled for one size.
    for_one_size: bool,
    /// The device and its pipelines, once they are needed.
    opened: Mutex<Option<(OpenGpu, HashMap<Key, wgpu::ComputePipeline>)>>,
}

/// An opened device, on which kernels are compiled and run.
#[derive(Clone)]
pub struct OpenGpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    /// Whether the process itself computes, as with a software GPU.
    in_process: bool,
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Lists the adapters of this machine, hardware first, in the order in which `auto` prefers them.
    pub fn list() -> Vec<Gpu> {
        if !LOADS_DRIVERS {
            return Vec::new();
        }
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.flags = wgpu::InstanceFlags::empty();
        descriptor.backends = wgpu::Backends::PRIMARY;
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let mut found: Vec<Gpu> = adapters
            .into_iter()
            .map(|adapter| Gpu { info: adapter.get_info(), adapter, for_one_size: false, opened: Mutex::default() })
            .collect();
        // The no-op back end computes nothing but calls itself a CPU device.
        found.retain(|gpu| gpu.info.backend != wgpu::Backend::Noop);
        found.sort_by_key(|gpu| gpu.rank());
        found.iter_mut().for_each(|gpu| gpu.for_one_size = gpu.is_hardware());
        found
    }

    fn rank(&self) -> u32 {
        match self.info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        }
    }

    /// Returns whether it is hardware, not a software GPU on the CPU.
    pub fn is_hardware(&self) -> bool {
        self.rank() < 3
    }

    /// Returns its name, as `--adapter` matches it.
    pub fn name(&self) -> &str {
        &self.info.name
    }

    /// Whether its name contains `part`, ignoring case; without a `part` every name matches.
    fn matches(&self, part: Option<&str>) -> bool {
        part.is_none_or(|part| self.name().to_lowercase().contains(&part.to_lowercase()))
    }

    /// Selects the requested adapters from `found`: the one with this number, counted from 0, or else all whose names
    /// contain the text. Also returns whether it was a number.
    pub fn select(mut found: Vec<Gpu>, asked: Option<&str>) -> (Vec<Gpu>, bool) {
        match asked.and_then(|asked| asked.trim().parse::<usize>().ok()).filter(|number| *number < found.len()) {
            Some(number) => (vec![found.swap_remove(number)], true),
            None => (found.into_iter().filter(|gpu| gpu.matches(asked)).collect(), false),
        }
    }

    /// Returns `Vulkan`, `Metal` or `Dx12`.
    pub fn api(&self) -> String {
        format!("{:?}", self.info.backend)
    }

    /// Returns `DiscreteGpu`, `IntegratedGpu`, `VirtualGpu`, `Cpu` or `Other`.
    pub fn device_type(&self) -> String {
        format!("{:?}", self.info.device_type)
    }

    /// Returns the driver's name and version.
    pub fn driver(&self) -> String {
        format!("{} {}", self.info.driver, self.info.driver_info).trim().to_string()
    }

    /// Returns whether shaders may use f64.
    pub fn has_f64(&self) -> bool {
        self.adapter.features().contains(wgpu::Features::SHADER_F64)
    }

    /// Returns the limits that bound a run.
    pub fn limits(&self) -> wgpu::Limits {
        self.adapter.limits()
    }

    /// Returns the threads of the smallest and the largest subgroup that a shader may meet.
    pub fn subgroups(&self) -> [u32; 2] {
        [self.info.subgroup_min_size, self.info.subgroup_max_size].map(|size| size.clamp(1, 64))
    }

    /// Returns what decides whether a run fits.
    pub fn capacity(&self) -> Capacity {
        let limits = self.limits();
        let [least, most] = self.subgroups();
        let usable = self.adapter.features().contains(wgpu::Features::SUBGROUP);
        Capacity {
            f64: self.has_f64(),
            threads: limits.max_compute_invocations_per_workgroup.min(limits.max_compute_workgroup_size_x) as usize,
            workgroup_bytes: limits.max_compute_workgroup_storage_size as usize,
            subgroup: most,
            least_subgroup: if usable { least } else { 0 },
            for_one_size: self.for_one_size,
        }
    }

    /// Returns the pipeline for a ring and a variant, compiled once, and its device, opened once.
    pub fn pipeline<T: Real>(&self, blocks: Blocks, variant: Variant) -> Result<(OpenGpu, wgpu::ComputePipeline)> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        let (device, pipelines) = match &mut *opened {
            Some(opened) => opened,
            none => none.insert((self.open()?, HashMap::new())),
        };
        let [least, most] = self.subgroups();
        let subgroup = if variant.subgroup { least } else { most };
        let sizes = shader::sizes(blocks, subgroup, variant.for_one_size);
        let pipeline = pipelines
            .entry((sizes, T::NAME, variant))
            .or_insert_with(|| pipeline::compile::<T>(&device.device, sizes, variant));
        Ok((device.clone(), pipeline.clone()))
    }

    /// Opens the device and compiles the pipeline for [`pipeline`](Gpu::pipeline); calls `tell` if that takes long, and
    /// `may_continue` several times a second, whose error ends the wait.
    ///
    /// Nothing can stop a driver's compiler. It therefore runs in a thread, which is abandoned after the `limit`.
    ///
    /// # Errors
    /// [`Error::Device`] if the adapter cannot be opened, the driver panics or the limit is over, and that of
    /// `may_continue`.
    pub fn compile<T: Real>(
        self: &Arc<Self>,
        blocks: Blocks,
        variant: Variant,
        limit: Option<Duration>,
        tell: &dyn Fn(),
        may_continue: &dyn Fn() -> Result<()>,
    ) -> Result<()> {
        let (send, compiled) = channel();
        let gpu = Arc::clone(self);
        threads::start("compiler", move || {
            let done = guarded(|| gpu.pipeline::<T>(blocks, variant).map(drop));
            drop(send.send(done));
        })?;
        let begun = Instant::now();
        let mut told = false;
        let done = loop {
            let done = compiled.recv_timeout(PERIOD);
            let is_late = matches!(done, Err(RecvTimeoutError::Timeout));
            // First, so that it is told even if this thread gets no processor until the limit is over.
            if is_late && !told && begun.elapsed() >= LONG {
                tell();
                told = true;
            }
            if !is_late || limit.is_some_and(|limit| begun.elapsed() >= limit) {
                break done;
            }
            may_continue().inspect_err(|_| abandoned::abandon(Arc::clone(self)))?;
        };
        let fault = match done {
            Ok(Ok(done)) => return done,
            Ok(Err(panic)) => format!("{panic}; see `curvelax adapters`, or use --backend cpu"),
            Err(_) => {
                abandoned::abandon(Arc::clone(self));
                let seconds = limit.unwrap_or_default().as_secs_f64();
                format!("the kernel is not compiled after {seconds} s; --backend gpu waits for it as long as it takes")
            }
        };
        Err(Error::Device(format!("GPU {}: {fault}", self.name())))
    }

    /// Returns the same adapter with the kernels that hardware has, to test them.
    #[doc(hidden)]
    pub fn with_kernels_of_hardware(&self) -> Gpu {
        Gpu { adapter: self.adapter.clone(), info: self.info.clone(), for_one_size: true, opened: Mutex::default() }
    }

    /// Makes all kernels lose the device, as a driver reset does, to test the recovery.
    #[doc(hidden)]
    pub fn lose(&self) {
        if let Some((device, _)) = &*self.opened.lock().unwrap_or_else(PoisonError::into_inner) {
            device.device.destroy();
        }
    }

    /// Opens the adapter with all its limits, and with f64, subgroups and a clock where it has them.
    fn open(&self) -> Result<OpenGpu> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("curvelax"),
            required_features: self.adapter.features() & FEATURES,
            required_limits: self.adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(self.adapter.request_device(&descriptor))
            .map_err(|e| Error::Device(format!("adapter {}: cannot be opened: {e}; try --backend cpu", self.name())))?;
        let fault = Arc::new(Mutex::new(None));
        let set = |fault: &Mutex<Option<String>>, set: &dyn Fn(Option<String>) -> String| {
            let mut fault = fault.lock().unwrap_or_else(PoisonError::into_inner);
            *fault = Some(set(fault.take()));
        };
        let at = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            set(&at, &|first| first.unwrap_or_else(|| one_line(&error.to_string())));
        }));
        let at = fault.clone();
        // Dropping the device also calls back, but then no receiver is left.
        device.set_device_lost_callback(move |reason, message| {
            set(&at, &|_| one_line(&format!("the device was lost ({reason:?}) {message}")));
        });
        let in_process = self.info.device_type == wgpu::DeviceType::Cpu;
        Ok(OpenGpu { device, queue, name: self.name().to_string(), in_process, fault })
    }
}

/// What is used where an adapter has it.
const FEATURES: wgpu::Features =
    wgpu::Features::SHADER_F64.union(wgpu::Features::SUBGROUP).union(wgpu::Features::TIMESTAMP_QUERY);

impl OpenGpu {
    /// The current moment, from which the time of its work counts.
    pub(super) fn now(&self) -> Moment {
        Moment::now(self.in_process)
    }

    /// Checks whether wgpu has reported a fault.
    pub fn check(&self) -> Result<()> {
        self.fault().map_or(Ok(()), |fault| Err(self.error(&fault)))
    }

    /// What wgpu reported, in one line, if anything: that the device was lost, or else the first fault.
    pub(super) fn fault(&self) -> Option<String> {
        let known = || self.fault.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if known().is_some() {
            // Calls on a lost device look invalid; polling it reports the loss.
            let _ = guarded(|| self.device.poll(wgpu::PollType::Poll));
        }
        known()
    }

    /// Converts a fault of this device into an error.
    pub(super) fn error(&self, fault: &str) -> Error {
        let OpenGpu { name, .. } = self;
        Error::Device(format!("GPU {name}: {fault}; see `curvelax adapters`, or use --backend cpu"))
    }

    /// Waits for the submission, but no longer than `most`. Returns whether it is done.
    pub(super) fn wait(&self, submission: &wgpu::SubmissionIndex, most: Duration) -> Result<bool> {
        let wait =
            |poll| guarded(|| self.device.poll(poll)).map_err(|fault| self.error(&self.fault().unwrap_or(fault)));
        let polled = wait(wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: Some(most) })?;
        if polled.is_err() {
            // A lost device accepts no submission, so there is none to wait for; this poll reports the loss.
            let _ = wait(wgpu::PollType::Poll)?;
        }
        self.check()?;
        match polled {
            Ok(_) => Ok(true),
            Err(wgpu::PollError::Timeout) => Ok(false),
            Err(error) => Err(self.error(&format!("a dispatch was not taken ({error})"))),
        }
    }
}
