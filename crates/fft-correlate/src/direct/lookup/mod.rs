//! Sums of weighted points of one part, looked up in a blend of the other part's densities.

mod grid;
mod map;
mod points;
mod quadratic;
mod sum;
mod trilinear;

pub(super) use grid::LookupGrid;
pub(super) use points::PointSet;
pub(super) use sum::{Sums, sum};
