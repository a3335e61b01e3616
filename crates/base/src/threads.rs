//! All threads are started here, so that a system without any left gives an error that says so.

use std::{
    collections::BTreeMap,
    error::Error as _,
    fmt::Display,
    sync::{Arc, Mutex, OnceLock, PoisonError},
    thread::{Builder, JoinHandle},
};

use rayon::{ThreadPool, ThreadPoolBuilder, prelude::*};

use crate::error::{Error, Result};

/// The remedy if the system starts no more threads.
const REMEDY: &str = "raise the limit of this user or container (ulimit -u, pids.max), or end other processes";

/// Starts a thread that does `work`; debuggers show its `name`.
///
/// # Errors
/// [`Error::Failed`] if the system starts no more threads.
pub fn start(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>> {
    Builder::new().name(name.into()).spawn(work).map_err(|e| no_more("a thread", "", &e))
}

/// Returns the pool of `count` threads (0: all cores), which is started once: a run opens a back end for each of its
/// stages, and the system may have no threads left by then. A panic in one of them prints no second message.
///
/// # Errors
/// Those of [`start`].
pub fn pool(count: usize) -> Result<Arc<ThreadPool>> {
    static POOLS: Mutex<BTreeMap<usize, Arc<ThreadPool>>> = Mutex::new(BTreeMap::new());
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = pools.get(&count) {
        return Ok(Arc::clone(pool));
    }
    let builder = ThreadPoolBuilder::new().panic_handler(|_| {});
    // WebAssembly has no threads but the one that asks.
    let pool = match cfg!(target_family = "wasm") {
        true => builder.num_threads(1).use_current_thread().build(),
        false => builder.num_threads(count).build(),
    };
    let pool = Arc::new(pool.map_err(|e| match count {
        0 => no_more("a thread on each core", "try --threads 1, or ", &e),
        1 => no_more("1 thread", "", &e),
        _ => no_more(&format!("{count} threads"), "try --threads 1, or ", &e),
    })?);
    pools.insert(count, Arc::clone(&pool));
    Ok(pool)
}

/// Lets a thread of `pool` do `work`; where there are no other threads, it is done at once.
pub fn hand_over(pool: &ThreadPool, work: impl FnOnce() + Send + 'static) {
    match cfg!(target_family = "wasm") {
        true => pool.install(work),
        false => pool.spawn(work),
    }
}

/// Threads that prepare members and evaluate them while a back end advances others. They start when they are first
/// needed.
pub struct HostThreads {
    count: usize,
    pool: OnceLock<Option<ThreadPool>>,
}

impl HostThreads {
    /// Fewer items are not worth starting threads for.
    const MIN_ITEMS: usize = 64;

    /// Plans `count` threads (0: all cores).
    pub fn new(count: usize) -> HostThreads {
        HostThreads { count, pool: OnceLock::new() }
    }

    /// Returns whether these threads share the work on so many items.
    pub fn share(&self, items: usize) -> bool {
        self.count != 1 && items >= Self::MIN_ITEMS && !cfg!(target_family = "wasm")
    }

    /// Returns `of` for each item, in order: on these threads, or on the thread that asks if there is little to do, if
    /// one is enough, or if the system starts no more of them.
    pub fn map<T: Send, R: Send>(&self, items: Vec<T>, of: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
        let start = || ThreadPoolBuilder::new().num_threads(self.count).build().ok();
        match if self.share(items.len()) { self.pool.get_or_init(start) } else { &None } {
            Some(pool) => pool.install(|| items.into_par_iter().map(of).collect()),
            None => items.into_iter().map(of).collect(),
        }
    }
}

fn no_more(what: &str, fewer: &str, error: &dyn Display) -> Error {
    Error::Failed(format!("cannot start {what}: {error}; {fewer}{REMEDY}"))
}

/// Returns `of` for each number below `count`, in order: on all cores, or on this thread if no others can be started.
pub fn map<R: Send>(count: u32, of: impl Fn(u32) -> R + Sync) -> Vec<R> {
    if rayon::current_thread_index().is_some() || has_common_pool() {
        (0..count).into_par_iter().map(&of).collect()
    } else {
        (0..count).map(of).collect()
    }
}

/// Whether rayon's common pool exists. Its first use would panic if it could not be started.
fn has_common_pool() -> bool {
    static IS_THERE: OnceLock<bool> = OnceLock::new();
    *IS_THERE.get_or_init(|| match ThreadPoolBuilder::new().build_global() {
        Ok(()) => true,
        // An error without a source means that the pool was built earlier.
        Err(e) => e.source().is_none(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_without_threads_is_an_error_with_a_remedy() {
        let error = no_more("1 thread", "", &"no");
        assert_eq!(error.exit_code(), 1);
        assert_eq!(error.to_string(), format!("cannot start 1 thread: no; {REMEDY}"));
    }

    #[test]
    fn items_stay_in_order_and_threads_start_only_for_many() {
        for (threads, items, start) in [(0, 1000, true), (3, 1000, true), (3, 10, false), (1, 1000, false)] {
            let host = HostThreads::new(threads);
            let here = std::thread::current().id();
            let done = host.map((0..items).collect(), |i: u32| (2 * i, std::thread::current().id()));
            assert!(done.iter().zip(0..).all(|((double, _), i)| *double == 2 * i));
            assert_eq!(done.iter().any(|(_, thread)| *thread != here), start, "{threads} threads, {items} items");
        }
    }

    #[test]
    fn all_numbers_come_in_their_order() {
        let double: Vec<u32> = (0..1000).map(|n| 2 * n).collect();
        assert_eq!(map(1000, |n| 2 * n), double);
        assert_eq!(pool(3).unwrap().install(|| map(1000, |n| 2 * n)), double);
        assert_eq!(map(0, |n| n), [0_u32; 0]);
    }
}
