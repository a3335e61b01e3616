//! Drivers that are no longer waited for, although they are still at work.

use std::sync::atomic::{AtomicBool, Ordering};

static IS_ANY: AtomicBool = AtomicBool::new(false);

/// Returns whether a driver is still at work. The process must then end without the C library's clean-up, which would
/// tear it down.
pub fn is_any() -> bool {
    IS_ANY.load(Ordering::Relaxed)
}

/// Abandons a driver that is using `held`, which is therefore never released.
pub(super) fn abandon<T>(held: T) {
    IS_ANY.store(true, Ordering::Relaxed);
    std::mem::forget(held);
}
