//! Numbers that are read and written vector by vector, in orders and with overlaps that borrowed
//! slices cannot express: lines of a bundle, and sums that take the place of what they were made
//! of; their aligned memory, and prefetch hints.

use std::cell::Cell;

use bytemuck::{Pod, Zeroable};
use fearless_simd::prelude::*;
use sdf_grid::prefetch::fetch;

use crate::correlate::real::Real;

/// Numbers of the widest vector that any level has: 16 of f32 with AVX-512.
const MAX_LANES: usize = 16;

/// Real and imaginary parts of one element of a bundle of lines.
pub(crate) type Complex<V> = [V; 2];

/// A stretch of a buffer that is borrowed mutably for as long as any tile of it lives.
///
/// Tiles of one buffer may overlap: their numbers are cells, which one thread may write through
/// one tile and read through another. Every access is checked against the tile's end.
pub(crate) struct Tile<'a, T>(&'a [Cell<T>]);

impl<T> Clone for Tile<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Tile<'_, T> {}

/// Without arguments, so that hot loops keep no registers for it.
#[cold]
#[inline(never)]
fn out_of_bounds() -> ! {
    panic!("access beyond the end of a tile");
}

impl<'a, T: Real> Tile<'a, T> {
    pub(crate) fn new(numbers: &'a mut [T]) -> Self {
        Self(Cell::from_mut(numbers).as_slice_of_cells())
    }

    /// The numbers from `offset` on.
    #[inline(always)]
    pub(crate) fn from(self, offset: usize) -> Self {
        match self.0.get(offset..) {
            Some(cells) => Self(cells),
            None => out_of_bounds(),
        }
    }

    /// The `count` cells from `offset` on.
    #[inline(always)]
    fn cells(self, offset: usize, count: usize) -> &'a [Cell<T>] {
        match self.0.len().checked_sub(count) {
            // SAFETY: `offset + count` is at most the length.
            Some(last) if offset <= last => unsafe { self.0.get_unchecked(offset..offset + count) },
            _ => out_of_bounds(),
        }
    }

    /// The vector that begins at `offset`.
    #[inline(always)]
    pub(crate) fn load<S: Simd>(self, simd: S, offset: usize) -> T::Native<S> {
        read(simd, self.cells(offset, T::Native::<S>::LEN))
    }

    /// Overwrites the vector that begins at `offset`.
    #[inline(always)]
    pub(crate) fn store<S: Simd>(self, offset: usize, value: T::Native<S>) {
        write::<S, T>(self.cells(offset, T::Native::<S>::LEN), value);
    }

    /// Element `index` of a bundle whose elements follow each other.
    #[inline(always)]
    pub(crate) fn get<S: Simd>(self, simd: S, index: usize) -> Complex<T::Native<S>> {
        let lanes = T::Native::<S>::LEN;
        let cells = self.cells(2 * lanes * index, 2 * lanes);
        [read(simd, &cells[..lanes]), read(simd, &cells[lanes..])]
    }

    /// Overwrites element `index` of a bundle whose elements follow each other.
    #[inline(always)]
    pub(crate) fn put<S: Simd>(self, _: S, index: usize, value: Complex<T::Native<S>>) {
        let lanes = T::Native::<S>::LEN;
        let cells = self.cells(2 * lanes * index, 2 * lanes);
        write::<S, T>(&cells[..lanes], value[0]);
        write::<S, T>(&cells[lanes..], value[1]);
    }

    /// Asks for the cache line at `offset`, wherever that is, ahead of its use.
    #[inline(always)]
    pub(crate) fn fetch(self, offset: usize) {
        fetch(self.0.as_ptr().wrapping_add(offset));
    }
}

/// The vector in as many cells as it has lanes.
#[inline(always)]
fn read<S: Simd, T: Real>(simd: S, cells: &[Cell<T>]) -> T::Native<S> {
    // SAFETY: cells of plain numbers lie in memory like the numbers, all of them initialized. Cells
    // belong to one thread, and nothing on it writes to them before this reference is gone.
    let numbers = unsafe { std::slice::from_raw_parts(cells.as_ptr().cast::<T>(), cells.len()) };
    T::Native::<S>::from_slice(simd, numbers)
}

/// Overwrites as many cells as a vector has lanes.
#[inline(always)]
fn write<S: Simd, T: Real>(cells: &[Cell<T>], value: T::Native<S>) {
    let start = cells.as_ptr().cast_mut().cast::<T>();
    // SAFETY: cells may be written through shared references, and lie in memory like the numbers.
    // They belong to one thread, and nothing on it uses them before this reference is gone.
    let numbers = unsafe { std::slice::from_raw_parts_mut(start, cells.len()) };
    value.store_slice(numbers);
}

/// The first element of a bundle that is only read.
#[inline(always)]
pub(crate) fn element<S: Simd, T: Real>(simd: S, numbers: &[T]) -> Complex<T::Native<S>> {
    let lanes = T::Native::<S>::LEN;
    let numbers = &numbers[..2 * lanes];
    [
        T::Native::<S>::from_slice(simd, &numbers[..lanes]),
        T::Native::<S>::from_slice(simd, &numbers[lanes..]),
    ]
}

/// A bundle whose elements lie apart.
#[derive(Clone, Copy)]
pub(crate) struct Line<'a, T> {
    tile: Tile<'a, T>,
    /// Where in the tile each element begins.
    places: &'a [usize],
}

impl<'a, T: Real> Line<'a, T> {
    /// Elements at `places`, counted from number `first` of the tile on.
    #[inline(always)]
    pub(crate) fn new(tile: Tile<'a, T>, first: usize, places: &'a [usize]) -> Self {
        let tile = tile.from(first);
        Self { tile, places }
    }

    /// Element `index`.
    #[inline(always)]
    pub(crate) fn get<S: Simd>(&self, simd: S, index: usize) -> Complex<T::Native<S>> {
        let lanes = T::Native::<S>::LEN;
        let cells = self.tile.cells(self.places[index], 2 * lanes);
        [read(simd, &cells[..lanes]), read(simd, &cells[lanes..])]
    }

    /// Overwrites element `index`.
    #[inline(always)]
    pub(crate) fn put<S: Simd>(&self, _: S, index: usize, value: Complex<T::Native<S>>) {
        let lanes = T::Native::<S>::LEN;
        let cells = self.tile.cells(self.places[index], 2 * lanes);
        write::<S, T>(&cells[..lanes], value[0]);
        write::<S, T>(&cells[lanes..], value[1]);
    }

    /// Asks for what lies `next` numbers after element `index`, ahead of its use.
    #[inline(always)]
    pub(crate) fn fetch<S: Simd>(&self, index: usize, next: usize) {
        let at = self.places[index] + next;
        self.tile.fetch(at);
        self.tile.fetch(at + T::Native::<S>::LEN);
    }
}

/// Transposes a square block of as many rows as a vector has lanes: row `r` is read from
/// `from + r * from_stride`, column `c` written to `to + c * to_stride`. The two may be the same.
#[inline(always)]
pub(crate) fn transpose<S: Simd, T: Real>(
    simd: S,
    from: Tile<'_, T>,
    from_stride: usize,
    to: Tile<'_, T>,
    to_stride: usize,
) {
    let lanes = T::Native::<S>::LEN;
    let zero = T::Native::<S>::splat(simd, T::zero());
    let mut rows = [zero; MAX_LANES];
    for (r, row) in rows.iter_mut().enumerate().take(lanes) {
        *row = from.load(simd, r * from_stride);
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
        to.store::<S>(c * to_stride, *column);
    }
}

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
