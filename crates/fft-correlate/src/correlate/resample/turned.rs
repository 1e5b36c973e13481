//! A field turned by one rotation.

use std::ops::Range;

use glam::{DMat3, DQuat, DVec3};
use ndarray::Array3;
use num_complex::Complex;

use super::field::{BORDER, MovingField};
use super::hull::TurnedHull;
use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;

/// A field turned by one rotation; see [`Turned::new`].
pub(crate) struct Turned<'a, T> {
    pub(super) field: &'a MovingField<T>,
    /// The field's own, or others at its nodes.
    pub(super) values: &'a Array3<Complex<T>>,
    /// Columns: moving-lattice steps per fixed-lattice step.
    pub(super) step: DMat3,
    /// Moving-lattice index of fixed-lattice index `[0, 0, 0]` of the box.
    pub(super) start: DVec3,
    pub(super) hull: TurnedHull,
    pub(super) bounds: [Range<usize>; 3],
}

impl<'a, T: Real> Turned<'a, T> {
    /// `values` at the nodes of `field`, empty where it is, turned by `rotation`, at the fixed-lattice
    /// indices of `within`, counted from the corner of `placed`, a box around it; index 0 lies
    /// `origin` cells from the pivot.
    pub(crate) fn new(
        field: &'a MovingField<T>,
        values: &'a Array3<Complex<T>>,
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
            values,
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
        let mut sum = [DVec3::ZERO; 2];
        for (node, weights, slopes) in self.field.taps(at)? {
            let v = self.values[node];
            let [w, s] = [weights, slopes];
            let g = DVec3::new(s.x * w.y * w.z, w.x * s.y * w.z, w.x * w.y * s.z);
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
    // What reads no node but those of the border.
    let outer = BORDER as f64 - field.reading.reach();
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
