//! Memory of bundles of lines: aligned buffers, unchecked access to them, transposition of blocks.

use bytemuck::{Pod, Zeroable};
use fearless_simd::prelude::*;
use sdf_grid::large;

use crate::radix::Complex;
use crate::real::Real;

/// Runs an expression with the vectors of a level: `dispatch!` without the levels between the
/// baseline and AVX2, of which no machine in use is the best.
macro_rules! dispatch_lanes {
    ($level:expr, $simd:ident => $op:expr) => {{
        #[cfg(target_arch = "x86_64")]
        {
            use fearless_simd::Simd as _;
            let level: fearless_simd::Level = $level;
            if let Some($simd) = level.as_avx512() {
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            } else if let Some($simd) = level.as_avx2() {
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            } else {
                let $simd = level.as_sse2().expect("every x86-64 machine has SSE2");
                $simd.vectorize(
                    #[inline(always)]
                    || $op,
                )
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            fearless_simd::dispatch!($level, $simd => $op)
        }
    }};
}

pub(crate) use dispatch_lanes;

/// Numbers of the widest vector that any level has: 16 of f32 with AVX-512.
const MAX_LANES: usize = 16;

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
        large::ask_for_large_pages(&lines);
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

    /// The whole buffer for unchecked access.
    pub(crate) fn tile(&mut self) -> Tile<T> {
        Tile::new(self.as_mut_slice())
    }
}

/// Numbers in memory without borrow or bounds checks (those of debug builds excepted): lanes of
/// lines are read and written in orders that a slice cannot express, by several threads at once.
#[derive(Debug)]
pub(crate) struct Tile<T> {
    start: *mut T,
    len: usize,
}

impl<T> Clone for Tile<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Tile<T> {}

// SAFETY: a tile is an address; every access through it is an unsafe call that demands that no one
// else uses the same elements.
unsafe impl<T: Send> Send for Tile<T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for Tile<T> {}

impl<T: Real> Tile<T> {
    pub(crate) fn new(numbers: &mut [T]) -> Self {
        Self {
            start: numbers.as_mut_ptr(),
            len: numbers.len(),
        }
    }

    /// Numbers that no one writes while they are read here.
    pub(crate) fn shared(numbers: &[T]) -> Self {
        Self {
            start: numbers.as_ptr().cast_mut(),
            len: numbers.len(),
        }
    }

    /// The four numbers that begin at `offset`.
    ///
    /// # Safety
    /// As [`Tile::load`].
    #[inline(always)]
    pub(crate) unsafe fn quad<S: Simd>(self, simd: S, offset: usize) -> T::Quad<S> {
        debug_assert!(offset + 4 <= self.len, "{offset} of {}", self.len);
        // SAFETY: as demanded.
        let from = unsafe { std::slice::from_raw_parts(self.start.add(offset), 4) };
        T::Quad::<S>::from_slice(simd, from)
    }

    /// Asks for the cache line at `offset`, wherever that is, ahead of its use.
    #[inline(always)]
    pub(crate) fn fetch(self, offset: usize) {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
            let at = self.start.wrapping_add(offset).cast_const();
            // SAFETY: a hint that reads nothing, on machines that all know it.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at.cast()) };
        }
        #[cfg(not(target_arch = "x86_64"))]
        let _ = offset;
    }

    /// The numbers from `offset` on.
    ///
    /// # Safety
    /// `offset` must not exceed the length.
    #[inline(always)]
    pub(crate) unsafe fn from(self, offset: usize) -> Self {
        debug_assert!(offset <= self.len);
        Self {
            // SAFETY: within the allocation, as demanded.
            start: unsafe { self.start.add(offset) },
            len: self.len - offset,
        }
    }

    /// The vector that begins at `offset`.
    ///
    /// # Safety
    /// It must lie within the memory, which must be alive and not written by anyone else.
    #[inline(always)]
    pub(crate) unsafe fn load<S: Simd>(self, simd: S, offset: usize) -> T::Native<S> {
        let lanes = T::Native::<S>::LEN;
        debug_assert!(offset + lanes <= self.len, "{offset} of {}", self.len);
        // SAFETY: as demanded.
        let from = unsafe { std::slice::from_raw_parts(self.start.add(offset), lanes) };
        T::Native::<S>::from_slice(simd, from)
    }

    /// Overwrites the vector that begins at `offset`.
    ///
    /// # Safety
    /// As [`Tile::load`], and no one else may read it.
    #[inline(always)]
    pub(crate) unsafe fn store<S: Simd>(self, offset: usize, value: T::Native<S>) {
        let lanes = T::Native::<S>::LEN;
        debug_assert!(offset + lanes <= self.len, "{offset} of {}", self.len);
        // SAFETY: as demanded.
        let to = unsafe { std::slice::from_raw_parts_mut(self.start.add(offset), lanes) };
        value.store_slice(to);
    }

    /// Element `index` of a bundle whose elements follow each other.
    ///
    /// # Safety
    /// As [`Tile::load`].
    #[inline(always)]
    pub(crate) unsafe fn get<S: Simd>(self, simd: S, index: usize) -> Complex<T::Native<S>> {
        let lanes = T::Native::<S>::LEN;
        let at = 2 * lanes * index;
        // SAFETY: as demanded.
        unsafe { [self.load(simd, at), self.load(simd, at + lanes)] }
    }

    /// Overwrites element `index` of a bundle whose elements follow each other.
    ///
    /// # Safety
    /// As [`Tile::store`].
    #[inline(always)]
    pub(crate) unsafe fn put<S: Simd>(self, _: S, index: usize, value: Complex<T::Native<S>>) {
        let lanes = T::Native::<S>::LEN;
        let at = 2 * lanes * index;
        // SAFETY: as demanded.
        unsafe {
            self.store::<S>(at, value[0]);
            self.store::<S>(at + lanes, value[1]);
        }
    }

    /// The numbers as a slice.
    ///
    /// # Safety
    /// They must be alive for `'a` and not written by anyone else.
    #[inline(always)]
    pub(crate) unsafe fn slice<'a>(self, offset: usize, len: usize) -> &'a [T] {
        debug_assert!(offset + len <= self.len);
        // SAFETY: as demanded.
        unsafe { std::slice::from_raw_parts(self.start.add(offset), len) }
    }
}

/// A bundle whose elements lie apart.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'a, T> {
    pub(crate) tile: Tile<T>,
    /// Where in the tile each element begins.
    pub(crate) places: &'a [usize],
}

impl<T: Real> Line<'_, T> {
    /// # Safety
    /// As [`Tile::from`]; there must be a place with this index.
    #[inline(always)]
    unsafe fn at(&self, index: usize) -> Tile<T> {
        debug_assert!(index < self.places.len());
        // SAFETY: as demanded.
        unsafe { self.tile.from(*self.places.get_unchecked(index)) }
    }

    /// Element `index`.
    ///
    /// # Safety
    /// As [`Tile::load`]; there must be a place with this index.
    #[inline(always)]
    pub(crate) unsafe fn get<S: Simd>(&self, simd: S, index: usize) -> Complex<T::Native<S>> {
        // SAFETY: as demanded.
        unsafe { self.at(index).get(simd, 0) }
    }

    /// Asks for what lies `next` numbers after element `index`, ahead of its use.
    ///
    /// # Safety
    /// As [`Line::get`].
    #[inline(always)]
    pub(crate) unsafe fn fetch<S: Simd>(&self, index: usize, next: usize) {
        // SAFETY: as demanded.
        let at = unsafe { self.at(index) };
        at.fetch(next);
        at.fetch(next + T::Native::<S>::LEN);
    }

    /// Overwrites element `index`.
    ///
    /// # Safety
    /// As [`Tile::store`]; there must be a place with this index.
    #[inline(always)]
    pub(crate) unsafe fn put<S: Simd>(&self, simd: S, index: usize, value: Complex<T::Native<S>>) {
        // SAFETY: as demanded.
        unsafe { self.at(index).put(simd, 0, value) }
    }
}

/// Asks for `count` numbers from `offset` on for the second-level cache, ahead of their use.
#[inline(always)]
pub(crate) fn ask_for<T>(values: &[T], offset: usize, count: usize) {
    #[cfg(target_arch = "x86_64")]
    for i in (0..count).step_by(64 / size_of::<T>()) {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let at = values.as_ptr().wrapping_add(offset + i);
        // SAFETY: a hint that reads nothing, on machines that all know it.
        unsafe { _mm_prefetch::<_MM_HINT_T1>(at.cast()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, offset, count);
}

/// Transposes a square block of as many rows as a vector has lanes: row `r` is read from
/// `from + r * from_stride`, column `c` written to `to + c * to_stride`.
///
/// # Safety
/// All rows and columns must lie within their memory, which no one else may use; the two may be
/// the same.
#[inline(always)]
pub(crate) unsafe fn transpose<S: Simd, T: Real>(
    simd: S,
    from: Tile<T>,
    from_stride: usize,
    to: Tile<T>,
    to_stride: usize,
) {
    let lanes = T::Native::<S>::LEN;
    let zero = T::Native::<S>::splat(simd, T::zero());
    let mut rows = [zero; MAX_LANES];
    for (r, row) in rows.iter_mut().enumerate().take(lanes) {
        // SAFETY: as demanded.
        *row = unsafe { from.load(simd, r * from_stride) };
    }
    // Each perfect shuffle of the list rotates the bits of (row, lane) by one.
    let mut done = 1;
    while done < lanes {
        let mut next = rows;
        for i in 0..lanes / 2 {
            (next[2 * i], next[2 * i + 1]) = rows[i].interleave(rows[i + lanes / 2]);
        }
        rows = next;
        done *= 2;
    }
    for (c, column) in rows.iter().enumerate().take(lanes) {
        // SAFETY: as demanded.
        unsafe { to.store::<S>(c * to_stride, *column) };
    }
}
