//! Which back end a spec gets, and why: all that can be refused is refused here, before any work.

use serde::{Deserialize, Serialize};

use super::{
    Backend,
    cpu::{CpuBackend, Vectorised},
    gpu::{Capacity, Gpu, Kernel, Variant},
};
use crate::{
    ensemble::{
        Spec,
        spec::{BackendChoice, Precision},
    },
    error::{Error, Result},
    scheme::step::Method,
    solver::{Blocks, Order, Solver},
};

/// Largest n at which f32 was verified against f64 (`docs/conformance.md`).
pub const MAX_POINTS_F32: usize = 320;

/// Where a run is computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Platform {
    /// `gpu` or `cpu`.
    pub backend: String,
    /// Name of the GPU adapter.
    pub adapter: Option<String>,
    /// Its driver and the driver's version.
    pub driver: Option<String>,
    /// Hardware or software, integrated or discrete.
    pub device_type: Option<String>,
    /// Number type of the arithmetic.
    pub precision: Precision,
    /// Why this back end was taken.
    pub reason: String,
    /// Threads of the CPU back end.
    pub threads: Option<usize>,
}

/// A back end that suits a spec, not yet opened.
pub struct Choice {
    gpu: Option<Gpu>,
    precision: Precision,
    reason: String,
}

/// Chooses the back end for members of `n` nodes.
///
/// # Errors
/// [`Error::Request`] when the adapter, the precision or n cannot be had.
pub fn choose(spec: &Spec, n: usize) -> Result<Choice> {
    match spec.backend {
        BackendChoice::Cpu => cpu(spec, n, "asked for".into()),
        BackendChoice::Gpu => gpu(spec, n),
        BackendChoice::Auto if spec.adapter.is_some() => gpu(spec, n),
        BackendChoice::Auto => auto(spec, n, Gpu::list()),
    }
}

/// What `--backend auto` takes: the first hardware GPU that can do the run, else the CPU.
fn auto(spec: &Spec, n: usize, adapters: Vec<Gpu>) -> Result<Choice> {
    if spec.order == Order::Lexicographic {
        return cpu(spec, n, "lexicographic sweeps run on the CPU".into());
    }
    let mut reason = "no hardware GPU found".to_string();
    for adapter in adapters.into_iter().filter(Gpu::is_hardware) {
        let name = adapter.name().to_string();
        match take(spec, n, adapter, format!("hardware GPU {name}")) {
            Ok(choice) => return Ok(choice),
            Err(error) => reason = format!("GPU {name} cannot do it: {error}"),
        }
    }
    cpu(spec, n, reason)
}

fn cpu(spec: &Spec, n: usize, reason: String) -> Result<Choice> {
    let precision = spec.precision.unwrap_or(Precision::F64);
    check_precision(n, precision)?;
    Ok(Choice { gpu: None, precision, reason })
}

fn gpu(spec: &Spec, n: usize) -> Result<Choice> {
    if spec.order == Order::Lexicographic {
        let message = "--adapter: lexicographic sweeps run on the CPU only; leave out --adapter";
        return Err(Error::Request(message.into()));
    }
    let found = Gpu::list();
    let names: Vec<String> = found.iter().map(|gpu| gpu.name().to_string()).collect();
    match found.into_iter().find(|gpu| gpu.matches(spec.adapter.as_deref())) {
        Some(adapter) => take(spec, n, adapter, "asked for".into()),
        None => Err(no_adapter(spec.adapter.as_deref(), &names)),
    }
}

/// The error of an adapter that is not there; `names` are those that are.
pub fn no_adapter(asked: Option<&str>, names: &[String]) -> Error {
    let there = if names.is_empty() {
        "this machine has none; take --backend cpu, or install a GPU driver (Debian's software GPU is \
         mesa-vulkan-drivers)"
            .to_string()
    } else {
        format!("there are: {}", names.join(", "))
    };
    match asked {
        Some(name) => Error::Request(format!("--adapter {name}: no such adapter; {there} (see `curvelax adapters`)")),
        None => Error::Request(format!("--backend gpu: no GPU adapter; {there}")),
    }
}

fn take(spec: &Spec, n: usize, adapter: Gpu, reason: String) -> Result<Choice> {
    let precision = fitting_precision(spec, n, adapter.name(), &adapter.capacity())?;
    Ok(Choice { gpu: Some(adapter), precision, reason })
}

/// The precision of the run on an adapter, if members of `n` nodes fit it.
fn fitting_precision(spec: &Spec, n: usize, name: &str, capacity: &Capacity) -> Result<Precision> {
    let precision = spec.precision.unwrap_or(capacity.best_precision());
    if precision == Precision::F64 && !capacity.f64 {
        let problem = format!("adapter {name} has no f64");
        return Err(Error::value("precision", "f64", &problem, "take --precision f32, or --backend cpu"));
    }
    check_precision(n, precision)?;
    let (fits, most) = match precision {
        Precision::F32 => (
            capacity.check_size::<f32>(ring(n)?, spec.solver()),
            capacity.max_points::<f32>(spec.solver()).min(MAX_POINTS_F32),
        ),
        Precision::F64 => {
            (capacity.check_size::<f64>(ring(n)?, spec.solver()), capacity.max_points::<f64>(spec.solver()))
        }
    };
    fits.map_err(|needs| {
        let problem = format!("a member needs {needs}");
        Error::value("points", n, &problem, &format!("take {most} or fewer, or --backend cpu"))
    })?;
    Ok(precision)
}

/// f32 has a resolution limit: rounding grows like (1/h)⁴, and beyond the verified n results would only look right.
fn check_precision(n: usize, precision: Precision) -> Result<()> {
    if precision == Precision::F32 && n > MAX_POINTS_F32 {
        let problem = format!("f32 was verified against f64 up to {MAX_POINTS_F32} points; rounding grows like n^4");
        return Err(Error::value("points", n, &problem, "take fewer points, or --precision f64"));
    }
    Ok(())
}

fn ring(n: usize) -> Result<Blocks> {
    Blocks::new(n)
        .ok_or_else(|| Error::value("points", n, "a ring of fewer than 6 nodes cannot be coloured", "take 6 or more"))
}

impl Choice {
    /// The number type of the run.
    pub fn precision(&self) -> Precision {
        self.precision
    }

    /// One line: what was taken and why, and which solver.
    pub fn sentence(&self, spec: &Spec) -> String {
        let precision = match self.precision {
            Precision::F32 => "f32",
            Precision::F64 => "f64",
        };
        let device = match &self.gpu {
            Some(gpu) => format!("GPU {} ({})", gpu.name(), gpu.api()),
            None => "CPU".into(),
        };
        let solver = match spec.solver() {
            Solver::GaussSeidel => "Gauss-Seidel sweeps",
            Solver::Multigrid => "sweeps inside multigrid",
            Solver::Direct => "direct solver",
        };
        format!("back end: {device}, {precision} ({}); {solver}", self.reason)
    }

    /// The spec with everything that this choice settled written out, so that it can be repeated as it is.
    pub fn settle(&self, spec: &mut Spec) {
        self.settle_place(spec);
        if spec.solver().sweeps() {
            spec.tolerance = Some(spec.tolerance_at(self.precision));
        }
        spec.solver = spec.solver().into();
    }

    /// Writes into a spec with cells what they all have in common: where they are computed.
    pub fn settle_place(&self, spec: &mut Spec) {
        spec.backend = if self.gpu.is_some() { BackendChoice::Gpu } else { BackendChoice::Cpu };
        spec.adapter = self.gpu.as_ref().map(|gpu| gpu.name().to_string());
        spec.precision = Some(self.precision);
    }

    /// Opens it for the members of `spec`, of `n` nodes.
    pub fn open(self, spec: &Spec, n: usize) -> Result<(Box<dyn Backend>, Platform)> {
        match self.precision {
            Precision::F32 => self.open_in::<f32>(spec, n),
            Precision::F64 => self.open_in::<f64>(spec, n),
        }
    }

    fn open_in<T: Vectorised>(self, spec: &Spec, n: usize) -> Result<(Box<dyn Backend>, Platform)> {
        let blocks = ring(n)?;
        let mut platform = Platform {
            backend: "cpu".into(),
            adapter: None,
            driver: None,
            device_type: None,
            precision: self.precision,
            reason: self.reason,
            threads: None,
        };
        if let Some(gpu) = self.gpu {
            let members = usize::try_from(spec.member_count()).unwrap_or(usize::MAX);
            let variant = gpu.capacity().variant(blocks, spec.solver());
            let variant = Variant { adaptive: spec.adaptive.is_some(), ..variant };
            let kernel = Kernel::<T>::new(&gpu, blocks, members, spec.max_sweeps, variant)?;
            platform.backend = "gpu".into();
            platform.adapter = Some(gpu.name().to_string());
            platform.driver = Some(gpu.driver());
            platform.device_type = Some(gpu.device_type());
            return Ok((Box::new(kernel), platform));
        }
        let method = Method { solver: spec.solver(), order: spec.order, max_sweeps: spec.max_sweeps };
        let backend = CpuBackend::<T>::new(blocks, method, spec.threads.unwrap_or(0))?;
        platform.threads = Some(backend.threads());
        Ok((Box::new(backend), platform))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What every WebGPU device has at least.
    const LEAST: Capacity =
        Capacity { f64: false, threads: 256, workgroup_bytes: 16_384, subgroup: 32, least_subgroup: 0 };

    fn refused(precision: Option<Precision>, n: usize, capacity: &Capacity) -> String {
        let spec = Spec { precision, ..Spec::default() };
        fitting_precision(&spec, n, "toaster", capacity).unwrap_err().to_string()
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
        assert_eq!(fitting_precision(&spec, 100, "toaster", &LEAST).unwrap(), Precision::F32);
        let with_f64 = Capacity { f64: true, ..LEAST };
        assert_eq!(fitting_precision(&spec, 100, "toaster", &with_f64).unwrap(), Precision::F64);
    }

    #[test]
    fn more_points_than_the_workgroup_holds_are_refused_with_the_largest_number_that_fits() {
        let capacity = Capacity { f64: true, ..LEAST };
        let spec = Spec { precision: Some(Precision::F64), ..Spec::default() };
        let most = capacity.max_points::<f64>(spec.solver());
        assert!(most >= 512, "{most}");
        fitting_precision(&spec, most, "toaster", &capacity).unwrap();
        let message = refused(Some(Precision::F64), most + 1, &capacity);
        for part in [format!("--points {}", most + 1), format!("take {most} or fewer"), "--backend cpu".into()] {
            assert!(message.contains(&part), "{message}");
        }
        let few_threads = Capacity { threads: 32, ..capacity };
        assert!(refused(Some(Precision::F64), 256, &few_threads).contains("threads a workgroup"));
    }

    #[test]
    fn f32_beyond_what_was_verified_is_refused_with_the_reason() {
        let spec = Spec { precision: Some(Precision::F32), backend: BackendChoice::Cpu, ..Spec::default() };
        choose(&spec, MAX_POINTS_F32).unwrap();
        let message = choose(&spec, MAX_POINTS_F32 + 1).err().unwrap().to_string();
        assert!(message.contains("verified against f64 up to"), "{message}");
    }
}
