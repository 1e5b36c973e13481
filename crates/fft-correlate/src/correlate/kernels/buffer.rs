//! Aligned memory for bundles of lines, and hints of what will be read next.

use super::tile::Tile;
use crate::correlate::real::Real;
use bytemuck::{Pod, Zeroable};

/// One cache line.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct CacheLine([u8; 64]);

/// Zeroed numbers that begin on a cache line.
pub(crate) struct Buffer<T> {
    lines: Vec<CacheLine>,
    kind: std::marker::PhantomData<T>,
}

impl<T: Real> Buffer<T> {
    pub(crate) fn zeroed(len: usize) -> Self {
        let lines = (len * size_of::<T>()).div_ceil(size_of::<CacheLine>());
        let lines = bytemuck::zeroed_vec(lines);
        // Read in strides of a kibibyte and more.
        #[cfg(not(miri))]
        sdf_grid::large::ask_for_large_pages(&lines);
        Self {
            lines,
            kind: std::marker::PhantomData,
        }
    }

    pub(crate) fn as_slice(&self) -> &[T] {
        bytemuck::cast_slice(&self.lines)
    }

    pub(crate) fn as_mut_slice(&mut self) -> &mut [T] {
        bytemuck::cast_slice_mut(&mut self.lines)
    }

    /// The whole buffer, to be read and written in any order.
    pub(crate) fn tile(&mut self) -> Tile<'_, T> {
        Tile::new(self.as_mut_slice())
    }
}

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
