//! Large arrays in large pages. What is read all over, or once from end to end, otherwise waits for the
//! addresses of its pages, and for the kernel to hand them out one by one.

use rayon::prelude::*;

/// Arrays smaller than this gain nothing.
const LEAST: usize = 2 << 20;

/// Asks the kernel to back `memory` with large pages. Before it is first touched is best; nothing is lost where
/// there are no such pages.
#[doc(hidden)]
pub fn ask<T>(memory: &[T]) {
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 4096;
        let bytes = memory.as_ptr_range();
        let first = (bytes.start as usize).next_multiple_of(PAGE);
        let len = (bytes.end as usize).saturating_sub(first) / PAGE * PAGE;
        if len >= LEAST {
            use rustix::mm::{Advice, madvise};
            let start = bytes.start.wrapping_byte_add(first - bytes.start as usize);
            // SAFETY: whole pages of the allocation; the advice changes no content. If the kernel
            // knows no such pages, nothing is lost.
            let _ = unsafe { madvise(start.cast_mut().cast(), len, Advice::LinuxHugepage) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
}

/// Collects a parallel iterator into an array in large pages.
pub(crate) fn collect<T: Send>(items: impl IndexedParallelIterator<Item = T>) -> Vec<T> {
    let mut list = Vec::with_capacity(items.len());
    ask(list.spare_capacity_mut());
    items.collect_into_vec(&mut list);
    list
}
