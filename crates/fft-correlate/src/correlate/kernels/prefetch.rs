//! Hints of what will be read soon.

/// Asks for the cache line at an address for the nearest cache, ahead of its use. The address may
/// lie anywhere.
#[inline(always)]
pub(crate) fn fetch<T>(at: *const T) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint that reads nothing, on machines that all know it.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = at;
}

/// Asks for `count` numbers from `offset` on for the second-level cache, ahead of their use.
#[inline(always)]
pub(crate) fn ask_for<T>(values: &[T], offset: usize, count: usize) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    for i in (0..count).step_by(64 / size_of::<T>()) {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let at = values.as_ptr().wrapping_add(offset + i);
        // SAFETY: a hint that reads nothing, on machines that all know it.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(at.cast()) };
    }
    #[cfg(not(all(target_arch = "x86_64", not(miri))))]
    let _ = (values, offset, count);
}
