//! Large arrays in large pages: scattered reads otherwise wait for the addresses of small pages, and
//! for the kernel to hand them out one by one.

use rayon::prelude::*;

/// Arrays smaller than this gain nothing.
#[cfg(target_os = "linux")]
const LEAST: usize = 2 << 20;

/// Asks the kernel to back `memory` with large pages. Before it is first touched is best; nothing
/// is lost where there are no such pages.
#[doc(hidden)]
pub fn ask_for_large_pages<T>(memory: &[T]) {
    #[cfg(target_os = "linux")]
    {
        const PAGE: usize = 4096;
        let bytes = memory.as_ptr_range();
        let first = (bytes.start as usize).next_multiple_of(PAGE);
        let len = (bytes.end as usize).saturating_sub(first) / PAGE * PAGE;
        if len >= LEAST {
            use rustix::mm::{Advice, madvise};
            let start = bytes.start.wrapping_byte_add(first - bytes.start as usize);
            // SAFETY: `start` is the first page boundary in `memory` and `len` is cut down to whole
            // pages before its end, so the range lies in an allocation that the borrow keeps alive
            // (zero where it holds no whole page, and then `len < LEAST`). The advice moves pages,
            // never their content, so that it may be given for memory that others read; where the
            // kernel refuses it, nothing has happened.
            let _ = unsafe { madvise(start.cast_mut().cast(), len, Advice::LinuxHugepage) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
}

/// Collects a parallel iterator into an array in large pages.
pub(crate) fn collect<T: Send>(items: impl IndexedParallelIterator<Item = T>) -> Vec<T> {
    let mut list = room(items.len());
    items.collect_into_vec(&mut list);
    list
}

/// As [`collect`], into two arrays.
pub(crate) fn collect_both<A: Send, B: Send>(
    items: impl IndexedParallelIterator<Item = (A, B)>,
) -> (Vec<A>, Vec<B>) {
    let (mut a, mut b) = (room(items.len()), room(items.len()));
    items.unzip_into_vecs(&mut a, &mut b);
    (a, b)
}

fn room<T>(len: usize) -> Vec<T> {
    let mut list = Vec::with_capacity(len);
    ask_for_large_pages(list.spare_capacity_mut());
    list
}
