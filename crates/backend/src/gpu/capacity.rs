//! What a workgroup can hold, and so which kernel and which members.

use super::shader::{self, Variant};
use curvelax_flow::{
    number::{Precision, Real},
    solver::{Blocks, Solver, ring::MIN_POINTS},
};

/// What a workgroup of an adapter can hold.
#[derive(Clone, Copy, Debug)]
pub struct Capacity {
    /// Whether shaders may use f64.
    pub f64: bool,
    /// Maximum threads in a workgroup.
    pub threads: usize,
    /// Maximum bytes of workgroup memory.
    pub workgroup_bytes: usize,
    /// Threads of the largest subgroup.
    pub subgroup: u32,
    /// Threads of the smallest subgroup; 0 if shaders may not use subgroups.
    pub least_subgroup: u32,
    /// Whether kernels are compiled for one size, as for hardware.
    pub for_one_size: bool,
}

impl Capacity {
    /// The minimum of every WebGPU device.
    pub const LEAST: Capacity = Capacity {
        f64: false,
        threads: 256,
        workgroup_bytes: 16_384,
        subgroup: 32,
        least_subgroup: 0,
        for_one_size: true,
    };

    /// Returns the precision of a run that does not ask for one.
    pub fn best_precision(&self) -> Precision {
        if self.f64 { Precision::F64 } else { Precision::F32 }
    }

    /// Returns the largest n that fits in precision `T`.
    pub fn max_points<T: Real>(&self, solver: Solver) -> usize {
        let fits = |n: &usize| Blocks::new(*n).is_some_and(|blocks| self.check_size::<T>(blocks, solver).is_ok());
        (MIN_POINTS..1 << 16).take_while(fits).last().unwrap_or(0)
    }

    /// Checks that members of this size fit: threads and workgroup memory.
    pub fn check_size<T: Real>(&self, blocks: Blocks, solver: Solver) -> std::result::Result<(), String> {
        let threads = shader::threads(blocks, self.subgroup);
        if threads > self.threads {
            return Err(format!("{threads} threads a workgroup, and the adapter has {}", self.threads));
        }
        let bytes = shader::workgroup_bytes::<T>(blocks.count(), Variant::of(solver));
        if bytes > self.workgroup_bytes {
            return Err(format!("{bytes} bytes of workgroup memory, and the adapter has {}", self.workgroup_bytes));
        }
        Ok(())
    }

    /// Returns the fixed-step kernel that suits a ring: sweeps by shuffles if every possible subgroup holds it; for one
    /// size on hardware, and where there is no room for a row per thread.
    pub fn variant(&self, blocks: Blocks, solver: Solver) -> Variant {
        let subgroup = solver.facts().shuffles && blocks.count() <= self.least_subgroup as usize;
        let threads = shader::threads(blocks, self.subgroup);
        let fits = shader::workgroup_bytes::<f64>(threads, Variant::of(solver)) <= self.workgroup_bytes;
        Variant { subgroup, for_one_size: self.for_one_size || !fits, ..Variant::of(solver) }
    }
}
