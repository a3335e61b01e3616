//! Adapters that cases share, so that each of their kernels is compiled once.

use std::{
    collections::HashMap,
    sync::{Arc, LazyLock, Mutex},
};

use curvelax::{backend::gpu::Gpu, scheme::evolve::Evolves, solver::Solver};

/// The adapter for the cases of a precision and a solver, which share its kernels, each compiled once. The kinds do not
/// share one adapter, since it compiles one kernel at a time.
pub fn adapter<T: Evolves>(index: usize, solver: Solver) -> Arc<Gpu> {
    type Kind = (usize, &'static str, &'static str);
    static OPENED: LazyLock<Mutex<HashMap<Kind, Arc<Gpu>>>> = LazyLock::new(Mutex::default);
    let mut opened = OPENED.lock().expect("no case panics while it holds the lock");
    let kind = (index, T::NAME, solver.name());
    opened.entry(kind).or_insert_with(|| Arc::new(Gpu::list().swap_remove(index))).clone()
}
