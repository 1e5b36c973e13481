//! An allocator that counts, per thread, how often it is called and how many bytes are held. Also
//! used by the tests of `haptic`.
#![allow(dead_code, reason = "not every test counts both")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
    /// Bytes held, and the most since [`held`] began.
    static HELD: Cell<[i64; 2]> = const { Cell::new([0; 2]) };
}

fn count(bytes: i64) {
    // The thread's storage may be gone at its very end.
    let _ = CALLS.try_with(|calls| calls.set(calls.get() + 1));
    let _ = HELD.try_with(|held| {
        let [now, most] = held.get();
        held.set([now + bytes, most.max(now + bytes)]);
    });
}

// SAFETY: every call goes to the system allocator unchanged; counting allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as i64);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as i64));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as i64 - layout.size() as i64);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations, growths and releases of this thread so far.
pub(crate) fn calls() -> u64 {
    CALLS.with(Cell::get)
}

/// What `work` returns, the bytes that this thread holds for it, and the most that it held meanwhile.
pub(crate) fn held<R>(work: impl FnOnce() -> R) -> (R, u64, u64) {
    let [before, _] = HELD.get();
    HELD.set([before; 2]);
    let result = work();
    let [now, most] = HELD.get();
    (result, (now - before).max(0) as u64, (most - before) as u64)
}
