//! The moving part's field at the nodes of the fixed part's lattice, for one rotation.

use std::ops::Range;

use glam::{DMat3, DQuat, DVec3};
use ndarray::Array3;
use num_complex::Complex32;

use crate::overlap::IndexBox;
use crate::spectral::MovingRows;

/// Nodes of zeros around the stored values, so that interpolation needs no case at the rim.
const BORDER: usize = 1;

/// One unit field of the moving part, cropped to its support, ready to be turned.
pub(crate) struct MovingField {
    /// Values with [`BORDER`] zeros on every side.
    values: Array3<Complex32>,
    /// Position of `values[[0, 0, 0]]` relative to the pivot, in cells of the moving frame.
    first: DVec3,
    /// Largest distance from the pivot at which the interpolated field may be nonzero, cells.
    radius: f64,
}

impl MovingField {
    /// Crops `values`, whose node `[0, 0, 0]` lies `first` cells from the pivot; `None` if all are
    /// zero.
    pub(crate) fn new(values: &Array3<Complex32>, first: DVec3) -> Option<Self> {
        let support = support(values)?;
        let shape = support.shape().map(|s| s + 2 * BORDER);
        let offset = support.lo.map(|lo| lo - BORDER as i64);
        let mut cropped = Array3::zeros(shape);
        let mut radius = 0.0f64;
        for ((i, j, k), value) in cropped.indexed_iter_mut() {
            let at = [
                i as i64 + offset[0],
                j as i64 + offset[1],
                k as i64 + offset[2],
            ];
            if let Some(v) = get(values, at)
                && *v != Complex32::default()
            {
                *value = *v;
                let p = first + DVec3::from_array(at.map(|a| a as f64));
                radius = radius.max(p.length());
            }
        }
        Some(Self {
            values: cropped,
            first: first + DVec3::from_array(offset.map(|o| o as f64)),
            // Trilinear weights reach to the far corner of a cell.
            radius: radius + 3f64.sqrt(),
        })
    }

    /// The box of fixed-lattice indices that can be nonzero under any rotation, when index 0 lies
    /// `origin` cells from the pivot.
    pub(crate) fn reach(&self, origin: DVec3) -> IndexBox {
        let lo = (DVec3::splat(-self.radius) - origin).ceil();
        let hi = (DVec3::splat(self.radius) - origin).floor() + 1.0;
        IndexBox {
            lo: lo.to_array().map(|v| v as i64),
            hi: hi.to_array().map(|v| v as i64),
        }
    }

    /// Bytes of the stored values.
    pub(crate) fn bytes(&self) -> u64 {
        (self.values.len() * size_of::<Complex32>()) as u64
    }

    /// This field turned by `rotation`, at the fixed-lattice indices of `within`; index 0 lies
    /// `origin` cells from the pivot.
    pub(crate) fn turned(&self, rotation: DQuat, origin: DVec3, within: IndexBox) -> Turned<'_> {
        let matrix = DMat3::from_quat(rotation);
        let back = matrix.transpose();
        let corner = origin + DVec3::from_array(within.lo.map(|v| v as f64));
        Turned {
            field: self,
            step: back,
            start: back * corner - self.first,
            bounds: self.bounds(&matrix, corner, within.shape()),
        }
    }

    /// The bounding box of the turned values, as indices from `corner` on.
    fn bounds(&self, matrix: &DMat3, corner: DVec3, shape: [usize; 3]) -> [Range<usize>; 3] {
        let (nx, ny, nz) = self.values.dim();
        let half = DVec3::new(nx as f64 - 1.0, ny as f64 - 1.0, nz as f64 - 1.0) / 2.0;
        let middle = *matrix * (self.first + half) - corner;
        let reach = DVec3::from_array(std::array::from_fn(|a| matrix.row(a).abs().dot(half)));
        let (lo, hi) = ((middle - reach).to_array(), (middle + reach).to_array());
        std::array::from_fn(|a| {
            let first = lo[a].ceil().clamp(0.0, shape[a] as f64) as usize;
            let end = (hi[a].floor() + 1.0).clamp(first as f64, shape[a] as f64) as usize;
            first..end
        })
    }
}

/// A field turned by one rotation; see [`MovingField::turned`].
pub(crate) struct Turned<'a> {
    field: &'a MovingField,
    /// Columns: moving-lattice steps per fixed-lattice step.
    step: DMat3,
    /// Moving-lattice index of fixed-lattice index `[0, 0, 0]` of the box.
    start: DVec3,
    bounds: [Range<usize>; 3],
}

impl MovingRows for Turned<'_> {
    fn bounds(&self) -> [Range<usize>; 3] {
        self.bounds.clone()
    }

    fn fill(&self, x: usize, y: usize, row: &mut [Complex32]) -> bool {
        let start = self.start + self.step.x_axis * x as f64 + self.step.y_axis * y as f64;
        let step = self.step.z_axis;
        let (nx, ny, nz) = self.field.values.dim();
        let inside = inside(start, step, [nx, ny, nz], self.bounds[2].clone());
        let values = self
            .field
            .values
            .as_slice()
            .expect("made in standard layout");
        for z in inside.clone() {
            row[z] = trilinear(values, [nx, ny, nz], start + step * z as f64);
        }
        !inside.is_empty()
    }
}

/// The part of `range` where `start + step * z` lies within the lattice of `shape` on every axis.
fn inside(start: DVec3, step: DVec3, shape: [usize; 3], range: Range<usize>) -> Range<usize> {
    let (mut lo, mut hi) = (range.start as f64, range.end as f64 - 1.0);
    for a in 0..3 {
        let last = shape[a] as f64 - 1.0;
        if step[a].abs() < 1e-12 {
            if start[a] < 0.0 || start[a] > last {
                return 0..0;
            }
        } else {
            let (p, q) = (-start[a] / step[a], (last - start[a]) / step[a]);
            lo = lo.max(p.min(q));
            hi = hi.min(p.max(q));
        }
    }
    if hi < lo {
        return 0..0;
    }
    let first = lo.ceil() as usize;
    first..(hi.floor() as usize + 1).max(first)
}

/// The trilinear interpolant at a fractional index inside (to rounding) the lattice.
fn trilinear(values: &[Complex32], shape: [usize; 3], at: DVec3) -> Complex32 {
    let cell: [usize; 3] =
        std::array::from_fn(|a| (at[a].max(0.0) as usize).min(shape[a].saturating_sub(2)));
    let f: [f32; 3] = std::array::from_fn(|a| (at[a] - cell[a] as f64) as f32);
    let (sx, sy) = (shape[1] * shape[2], shape[2]);
    let base = cell[0] * sx + cell[1] * sy + cell[2];
    let along_z = |o: usize| values[o] * (1.0 - f[2]) + values[o + 1] * f[2];
    let along_y = |o: usize| along_z(o) * (1.0 - f[1]) + along_z(o + sy) * f[1];
    along_y(base) * (1.0 - f[0]) + along_y(base + sx) * f[0]
}

/// The bounding box of the nonzero values, or `None`.
pub(crate) fn support(values: &Array3<Complex32>) -> Option<IndexBox> {
    let mut found: Option<IndexBox> = None;
    for ((i, j, k), value) in values.indexed_iter() {
        if *value != Complex32::default() {
            let at = [i as i64, j as i64, k as i64];
            let b = found.get_or_insert(IndexBox {
                lo: at,
                hi: at.map(|v| v + 1),
            });
            b.lo = std::array::from_fn(|a| b.lo[a].min(at[a]));
            b.hi = std::array::from_fn(|a| b.hi[a].max(at[a] + 1));
        }
    }
    found
}

fn get(values: &Array3<Complex32>, at: [i64; 3]) -> Option<&Complex32> {
    let index = at.map(usize::try_from);
    match index {
        [Ok(i), Ok(j), Ok(k)] => values.get([i, j, k]),
        _ => None,
    }
}
