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
