//! Arrays on a lattice.

use bytemuck::Zeroable;
use ndarray::Array3;

use super::lattice::Lattice;
use crate::support::large;

/// An array of zeros on `lattice`, or none if the memory cannot be had. Untouched: its pages are
/// first written by the threads that fill them.
pub(super) fn zeros<T: Zeroable>(lattice: &Lattice) -> Option<Array3<T>> {
    let values = bytemuck::allocation::try_zeroed_vec(lattice.len()).ok()?;
    large::ask_for_large_pages(&values);
    Array3::from_shape_vec(lattice.shape(), values).ok()
}
