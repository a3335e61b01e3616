//! The kernel on the first adapter of this machine: start-up, sweeps alone, whole steps.
//!
//! Sweeps run on systems that never reach their tolerance, so that a dispatch makes a known number of them. Whole steps
//! are those of the conformance ensemble. Figures are means over dispatches, in seconds summed over all cores; for
//! sweeps, the difference between a long dispatch and a short one.

use curvelax::{
    backend::{
        Backend,
        gpu::{Gpu, Kernel, Variant, kernel::Budget},
    },
    conformance::{adaptive_members, members},
    number::Real,
    solver::{Blocks, Solver},
};

const MEMBERS: usize = 512;

fn main() {
    let gpus = Gpu::list();
    let Some(gpu) = gpus.first() else { return println!("no adapter") };
    println!("{} ({})", gpu.name(), gpu.driver());
    let sizes: Vec<usize> = std::env::args().filter_map(|size| size.parse().ok()).collect();
    for n in if sizes.is_empty() { vec![32, 100] } else { sizes } {
        measure::<f32>(gpu, n);
        measure::<f64>(gpu, n);
    }
}

fn measure<T: Real>(gpu: &Gpu, n: usize) {
    let (kernel, start) = start::<T>(gpu, n, gpu.capacity().variant(Blocks::new(n).unwrap(), Solver::GaussSeidel));
    let (one, two) = (
        sweeps(kernel, n, 0),
        sweeps(self::start::<T>(gpu, n, gpu.capacity().variant(Blocks::new(n).unwrap(), Solver::GaussSeidel)).0, n, 1),
    );
    println!(
        "{} n = {n}: start {start:.2} s; ns per sweep, system and node: k {one:.2}, x and y {:.2}",
        T::NAME,
        two / 2.0
    );
    let (kernel, start) = self::start::<T>(gpu, n, Variant::of(Solver::Direct));
    println!("{} n = {n}: start {start:.2} s; µs per direct step {:.2}", T::NAME, direct(kernel, n));
    let adaptive = Variant { adaptive: true, ..Variant::of(Solver::Direct) };
    println!("{} n = {n}: start {:.2} s, adaptive", T::NAME, self::start::<T>(gpu, n, adaptive).1);
}

/// Processor seconds of this process over all cores, which other processes do not affect; on a hardware GPU, only
/// the wall clock matters.
fn now() -> f64 {
    let ticks = || {
        let text = std::fs::read_to_string("/proc/self/stat").ok()?;
        let fields: Vec<f64> =
            text.rsplit(')').next()?.split_whitespace().skip(11).take(2).map_while(|f| f.parse().ok()).collect();
        Some(fields.iter().sum::<f64>() / 100.0)
    };
    ticks().unwrap_or(0.0)
}

/// A kernel after its first dispatch, and the seconds until then.
fn start<T: Real>(gpu: &Gpu, n: usize, variant: Variant) -> (Kernel<T>, f64) {
    let started = now();
    let mut kernel = Kernel::<T>::new(gpu, Blocks::new(n).unwrap(), MEMBERS, 1 << 30, variant).unwrap();
    let mut first =
        if variant.adaptive { adaptive_members(n, 1, 1, 1e-3, T::PRECISION) } else { members(n, 1, 1) }.unwrap();
    kernel.load(0, &first.remove(0)).unwrap();
    // Drivers compile at the first dispatch.
    kernel.advance().unwrap();
    (kernel, now() - started)
}

/// Mean processor seconds of a dispatch, over many.
fn dispatch<T: Real>(kernel: &mut Kernel<T>) -> f64 {
    let (at, mut count) = (now(), 0);
    while count < 3 || now() - at < 0.6 {
        kernel.advance().unwrap();
        count += 1;
    }
    (now() - at) / f64::from(count)
}

/// ns per sweep and node of the curvature (phase 0) or the position solve (phase 1).
fn sweeps<T: Real>(kernel: Kernel<T>, n: usize, phase: u32) -> f64 {
    let mut seconds = Vec::new();
    let mut kernel = kernel;
    for sweeps in [8, 808] {
        kernel = kernel.with_budget(Budget { steps: 1, sweeps });
        for (slot, mut run) in members(n, MEMBERS, 1).unwrap().into_iter().enumerate() {
            run.parameters.sor = 1e-9;
            run.counters.phase = phase;
            kernel.load(slot, &run).unwrap();
        }
        seconds.push(dispatch(&mut kernel));
    }
    let still =
        (0..MEMBERS).filter(|slot| kernel.counters(*slot).status == 0 && kernel.counters(*slot).steps == 0).count();
    if still < MEMBERS {
        println!("only {still} members still sweep");
    }
    (seconds[1] - seconds[0]) * 1e9 / (800 * MEMBERS * n) as f64
}

/// µs per step and curve, of the steps that were made.
fn direct<T: Real>(kernel: Kernel<T>, n: usize) -> f64 {
    let mut kernel = kernel.with_budget(Budget { steps: 20, sweeps: 1 << 20 });
    for (slot, mut run) in members(n, MEMBERS, 1 << 20).unwrap().into_iter().enumerate() {
        // The conformance ensemble redistributes ever more strongly, which most members would not survive.
        run.parameters.omega = 1.0;
        kernel.load(slot, &run).unwrap();
    }
    let steps = |kernel: &Kernel<T>| (0..MEMBERS).map(|slot| f64::from(kernel.counters(slot).steps)).sum::<f64>();
    kernel.advance().unwrap();
    let (at, before) = (now(), steps(&kernel));
    while now() - at < 0.6 {
        kernel.advance().unwrap();
    }
    (now() - at) * 1e6 / (steps(&kernel) - before)
}
