//! Hints to the caches of what will be read soon.

/// Bytes of a cache line, or fewer.
const LINE: usize = 64;

/// Asks for the cache line at an address for the nearest cache, ahead of its use. The address may
/// lie anywhere.
#[inline(always)]
pub fn fetch<T>(at: *const T) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint that reads nothing, on machines that all know it.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = at;
}

/// Asks for all of a value for the nearest cache, ahead of its use.
#[inline(always)]
pub(crate) fn fetch_value<T>(value: &T) {
    fetch_all(std::slice::from_ref(value));
}

/// Asks for all of a slice for the nearest cache, ahead of its use.
#[inline(always)]
pub fn fetch_all<T>(values: &[T]) {
    let first = values.as_ptr().cast::<u8>();
    for i in (0..size_of_val(values)).step_by(LINE) {
        fetch(first.wrapping_add(i));
    }
}

/// Asks for `count` numbers from `offset` on for the second-level cache, ahead of their use.
#[inline(always)]
pub fn ask_for<T>(values: &[T], offset: usize, count: usize) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    for i in (0..count).step_by(LINE / size_of::<T>()) {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let at = values.as_ptr().wrapping_add(offset + i);
        // SAFETY: a hint that reads nothing, on machines that all know it.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(at.cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = (values, offset, count);
}
