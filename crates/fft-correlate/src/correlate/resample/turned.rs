//! A field turned by one rotation.

use std::ops::Range;

use glam::{DMat3, DQuat, DVec3};

use super::field::{BORDER, MovingField};
use super::hull::TurnedHull;
use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;

/// A field turned by one rotation; see [`Turned::new`].
pub(crate) struct Turned<'a, T> {
    pub(super) field: &'a MovingField<T>,
    /// Columns: moving-lattice steps per fixed-lattice step.
    pub(super) step: DMat3,
    /// Moving-lattice index of fixed-lattice index `[0, 0, 0]` of the box.
    pub(super) start: DVec3,
    pub(super) hull: TurnedHull,
    pub(super) bounds: [Range<usize>; 3],
}

impl<'a, T: Real> Turned<'a, T> {
    /// `field` turned by `rotation`, at the fixed-lattice indices of `within`, counted from the
    /// corner of `placed`, a box around it; index 0 lies `origin` cells from the pivot.
    pub(crate) fn new(
        field: &'a MovingField<T>,
        rotation: DQuat,
        origin: DVec3,
        placed: IndexBox,
        within: IndexBox,
    ) -> Self {
        let matrix = DMat3::from_quat(rotation);
        let back = matrix.transpose();
        let corner = origin + DVec3::from_array(placed.lo.map(|v| v as f64));
        let start = back * corner - field.first;
        Self {
            field,
            step: back,
            start,
            hull: field.hull.turned(start, &back),
            bounds: bounds(field, &matrix, corner, &placed, &within),
        }
    }

    /// Gradient of the real and of the imaginary part at a node, per cell along the moving
    /// lattice's axes; `None` beyond the field.
    pub(crate) fn gradient(&self, node: [usize; 3]) -> Option<[DVec3; 2]> {
        let at = self.start + self.step * DVec3::from_array(node.map(|n| n as f64));
        let (nx, ny, nz) = self.field.values.dim();
        let last = [nx, ny, nz].map(|n| n as f64 - 1.0);
        if (0..3).any(|a| at[a] < 0.0 || at[a] >= last[a]) {
            return None;
        }
        let cell = at.floor();
        let f = at - cell;
        let mut sum = [DVec3::ZERO; 2];
        for corner in 0..8 {
            let c = [corner >> 2 & 1, corner >> 1 & 1, corner & 1];
            let v = self.field.values[[0, 1, 2].map(|a| cell[a] as usize + c[a])];
            let weight = |a: usize| if c[a] == 1 { f[a] } else { 1.0 - f[a] };
            let slope = |a: usize| if c[a] == 1 { 1.0 } else { -1.0 };
            let g = DVec3::new(
                slope(0) * weight(1) * weight(2),
                weight(0) * slope(1) * weight(2),
                weight(0) * weight(1) * slope(2),
            );
            let (re, im): (f64, f64) = (v.re.into(), v.im.into());
            sum[0] += re * g;
            sum[1] += im * g;
        }
        Some(sum)
    }
}

/// The bounding box of the turned values inside of `within`, as indices from the corner of
/// `placed` on, which lies `corner` cells from the pivot.
fn bounds<T: Real>(
    field: &MovingField<T>,
    matrix: &DMat3,
    corner: DVec3,
    placed: &IndexBox,
    within: &IndexBox,
) -> [Range<usize>; 3] {
    let (nx, ny, nz) = field.values.dim();
    let half = DVec3::new(nx as f64 - 1.0, ny as f64 - 1.0, nz as f64 - 1.0) / 2.0;
    // All but the innermost nodes of the border are beyond reach.
    let outer = (BORDER - 1) as f64;
    let middle = *matrix * (field.first + half) - corner;
    let reach = DVec3::from_array(std::array::from_fn(|a| {
        matrix.row(a).abs().dot(half - outer)
    }));
    let (lo, hi) = ((middle - reach).to_array(), (middle + reach).to_array());
    std::array::from_fn(|a| {
        let [from, to] = [within.lo[a], within.hi[a]].map(|i| (i - placed.lo[a]) as f64);
        let first = lo[a].ceil().clamp(from, to) as usize;
        let end = (hi[a].floor() + 1.0).clamp(first as f64, to) as usize;
        first..end
    })
}
