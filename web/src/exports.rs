//! The functions that JavaScript calls. All memory is that of this module: JavaScript writes a request to where
//! [`reserve`] says, and reads from where [`answer`] and [`nodes`] say until the next call.

use std::cell::RefCell;

use crate::Instance;

thread_local! {
    static REQUEST: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static ANSWER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static INSTANCE: RefCell<Instance> = RefCell::default();
}

/// Makes room for `length` bytes, and returns where.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut u8 {
    REQUEST.with_borrow_mut(|request| {
        request.clear();
        request.resize(length, 0);
        request.as_mut_ptr()
    })
}

/// Answers the request, JSON in the bytes reserved, and returns the length of the answer, which is JSON, too.
#[unsafe(no_mangle)]
pub extern "C" fn ask() -> usize {
    let request = REQUEST.take();
    let text = INSTANCE.with_borrow_mut(|instance| instance.answer(&request)).to_string();
    ANSWER.with_borrow_mut(|answer| {
        *answer = text.into_bytes();
        answer.len()
    })
}

/// Where the answer is.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    ANSWER.with_borrow(|answer| answer.as_ptr())
}

/// Hands over what came back from the GPU, the bytes reserved.
#[unsafe(no_mangle)]
pub extern "C" fn deliver() {
    let bytes = REQUEST.take();
    INSTANCE.with_borrow_mut(|instance| instance.run.iter_mut().for_each(|run| run.deliver(&bytes)));
}

/// Where the nodes of the last frame are: for each member x and y of each node, in f32; NaN if not known.
#[unsafe(no_mangle)]
pub extern "C" fn nodes() -> *const f32 {
    INSTANCE.with_borrow(|instance| instance.run.as_ref().map_or(std::ptr::null(), |run| run.nodes().as_ptr()))
}

/// Where the Wulff shapes of the last frame are: for each member x and y of each node, in f32; NaN if not known.
#[unsafe(no_mangle)]
pub extern "C" fn rests() -> *const f32 {
    INSTANCE.with_borrow(|instance| instance.run.as_ref().map_or(std::ptr::null(), |run| run.rests().as_ptr()))
}

/// Where the excess of each member at each time of the grid is, in f64; NaN if not known.
#[unsafe(no_mangle)]
pub extern "C" fn excess() -> *const f64 {
    INSTANCE.with_borrow(|instance| instance.run.as_ref().map_or(std::ptr::null(), |run| run.excess().as_ptr()))
}
