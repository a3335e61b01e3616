//! Turns panics of other crates into errors.

use std::{
    cell::Cell,
    panic::{self, AssertUnwindSafe},
    sync::Once,
};

use crate::error::one_line;

thread_local! {
    /// Panics of this thread are caught and reported as errors.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Returns the result of `call`, or the message of its panic.
pub fn guarded<R>(call: impl FnOnce() -> R) -> std::result::Result<R, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let otherwise = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !GUARDED.get() {
                otherwise(info);
            }
        }));
    });
    GUARDED.set(true);
    let returned = panic::catch_unwind(AssertUnwindSafe(call));
    GUARDED.set(false);
    returned.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("a panic without a message");
        one_line(text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_one_line() {
        assert_eq!(guarded(|| 7), Ok(7));
        let reset = |after: u32| -> u32 { panic!("Error in Device::poll:\n  parent device\n  is lost after {after}") };
        assert_eq!(guarded(|| reset(3)), Err("Error in Device::poll: parent device is lost after 3".into()));
        assert!(!GUARDED.get());
    }
}
