//! The moving part's field at the nodes of the fixed part's lattice, for one rotation.

mod rows;

use std::ops::Range;

use fearless_simd::prelude::*;
use glam::{DMat3, DQuat, DVec3};
use ndarray::{Array3, Axis};
use num_complex::{Complex, Complex32};

use crate::fused::lanes;
use crate::hull::{Hull, TurnedHull};
use crate::overlap::IndexBox;
use crate::real::Real;
use crate::spectral::MovingRows;

/// Nodes of zeros around the stored values: a coordinate beyond them, moved into the outermost
/// cell, reads zeros, so that interpolation needs no case at the rim.
const BORDER: usize = 2;

/// Nodes along each side of the blocks whose emptiness is known.
const BLOCK: f64 = 4.0;

/// Samples along z that are taken or skipped together, for all lanes of y.
const PATCH: usize = 8;

/// One unit field of the moving part, cropped to its support, ready to be turned.
pub(crate) struct MovingField<T> {
    /// Values with [`BORDER`] zeros on every side.
    values: Array3<Complex<T>>,
    /// Position of `values[[0, 0, 0]]` relative to the pivot, in cells of the moving frame.
    first: DVec3,
    /// Largest distance from the pivot at which the interpolated field may be nonzero, cells.
    radius: f64,
    occupied: Occupied,
    hull: Hull,
}

/// Where a field may be nonzero within reach of a patch of samples.
struct Occupied {
    /// Whether a patch with its middle in this block of [`BLOCK`] cells may see anything.
    blocks: Array3<bool>,
    /// Blocks before the one that holds node 0.
    before: f64,
}

impl Occupied {
    /// For patches of `lanes` times [`PATCH`] samples one cell apart.
    fn new<T: Real>(values: &Array3<Complex<T>>, lanes: usize) -> Self {
        let half = |n: usize| (n as f64 - 1.0) / 2.0;
        // From the middle to the farthest sample, and on to the far corner of its cell.
        let reach = half(lanes).hypot(half(PATCH)) + 3f64.sqrt();
        let before = (reach / BLOCK).ceil() as usize;
        let shape = values.dim();
        let count = |n: usize| n.div_ceil(BLOCK as usize) + 2 * before;
        let mut blocks = Array3::from_elem([count(shape.0), count(shape.1), count(shape.2)], false);
        for ((i, j, k), v) in values.indexed_iter() {
            if *v != Complex::default() {
                blocks[[i, j, k].map(|n| n / BLOCK as usize + before)] = true;
            }
        }
        for axis in 0..3 {
            for mut lane in blocks.lanes_mut(Axis(axis)) {
                let line = lane.to_vec();
                for (i, v) in lane.iter_mut().enumerate() {
                    let near = i.saturating_sub(before)..(i + before + 1).min(line.len());
                    *v = line[near].contains(&true);
                }
            }
        }
        let before = before as f64;
        Self { blocks, before }
    }

    /// Whether a patch with its middle at this index may see anything.
    fn near(&self, middle: DVec3) -> bool {
        let at = (middle / BLOCK + self.before).floor();
        at.min_element() >= 0.0
            && self
                .blocks
                .get(at.to_array().map(|c| c as usize))
                .is_some_and(|v| *v)
    }
}

impl<T: Real> MovingField<T> {
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
                *value = Complex::new(T::nearest(v.re.into()), T::nearest(v.im.into()));
                let p = first + DVec3::from_array(at.map(|a| a as f64));
                radius = radius.max(p.length());
            }
        }
        let level = fearless_simd::Level::new();
        Some(Self {
            occupied: Occupied::new(&cropped, lanes::<T>(level)),
            hull: Hull::new(&cropped),
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
        (self.values.len() * size_of::<Complex<T>>()) as u64
    }

    /// This field turned by `rotation`, at the fixed-lattice indices of `within`, counted from the
    /// corner of `placed`, a box around it; index 0 lies `origin` cells from the pivot.
    pub(crate) fn turned(
        &self,
        rotation: DQuat,
        origin: DVec3,
        placed: IndexBox,
        within: IndexBox,
    ) -> Turned<'_, T> {
        let matrix = DMat3::from_quat(rotation);
        let back = matrix.transpose();
        let corner = origin + DVec3::from_array(placed.lo.map(|v| v as f64));
        let start = back * corner - self.first;
        Turned {
            field: self,
            step: back,
            start,
            hull: self.hull.turned(start, &back),
            bounds: self.bounds(&matrix, corner, &placed, &within),
        }
    }

    /// The bounding box of the turned values inside of `within`, as indices from the corner of
    /// `placed` on, which lies `corner` cells from the pivot.
    fn bounds(
        &self,
        matrix: &DMat3,
        corner: DVec3,
        placed: &IndexBox,
        within: &IndexBox,
    ) -> [Range<usize>; 3] {
        let (nx, ny, nz) = self.values.dim();
        let half = DVec3::new(nx as f64 - 1.0, ny as f64 - 1.0, nz as f64 - 1.0) / 2.0;
        // All but the innermost nodes of the border are beyond reach.
        let outer = (BORDER - 1) as f64;
        let middle = *matrix * (self.first + half) - corner;
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
}

/// A field turned by one rotation; see [`MovingField::turned`].
pub(crate) struct Turned<'a, T> {
    field: &'a MovingField<T>,
    /// Columns: moving-lattice steps per fixed-lattice step.
    step: DMat3,
    /// Moving-lattice index of fixed-lattice index `[0, 0, 0]` of the box.
    start: DVec3,
    hull: TurnedHull,
    bounds: [Range<usize>; 3],
}

impl<T: Real> MovingRows<T> for Turned<'_, T> {
    fn bounds(&self) -> [Range<usize>; 3] {
        self.bounds.clone()
    }

    fn fill(&self, x: usize, y: usize, row: &mut [Complex<T>]) -> bool {
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

    fn fill_lanes<S: Simd>(&self, simd: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize> {
        rows::sample(simd, self, x, y, bundle)
    }
}

impl<T: Real> Turned<'_, T> {
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
fn trilinear<T: Real>(values: &[Complex<T>], shape: [usize; 3], at: DVec3) -> Complex<T> {
    let cell: [usize; 3] =
        std::array::from_fn(|a| (at[a].max(0.0) as usize).min(shape[a].saturating_sub(2)));
    let f: [T; 3] = std::array::from_fn(|a| T::nearest(at[a] - cell[a] as f64));
    let (sx, sy) = (shape[1] * shape[2], shape[2]);
    let base = cell[0] * sx + cell[1] * sy + cell[2];
    let along_z = |o: usize| values[o] * (T::one() - f[2]) + values[o + 1] * f[2];
    let along_y = |o: usize| along_z(o) * (T::one() - f[1]) + along_z(o + sy) * f[1];
    along_y(base) * (T::one() - f[0]) + along_y(base + sx) * f[0]
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

#[cfg(test)]
mod tests {
    use fearless_simd::Level;
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    use super::*;
    use crate::lanes::dispatch_lanes;

    /// A shell with a hole and a separate grain: full, empty and partly filled blocks.
    fn field(rng: &mut SmallRng) -> Array3<Complex32> {
        Array3::from_shape_fn([33, 66, 41], |(i, j, k)| {
            let p = DVec3::new(i as f64 - 15.0, j as f64 - 12.0, k as f64 - 17.0);
            let shell = (8.0..11.0).contains(&p.length());
            let grain = (p - DVec3::new(0.0, 44.0, 0.0)).length() < 2.0;
            if shell || grain {
                Complex32::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0))
            } else {
                Complex32::default()
            }
        })
    }

    /// Largest difference between bundles and rows over all samples, and how many bundles skipped.
    fn compare<T: Real>(level: Level, turned: &Turned<'_, T>) -> (f64, usize) {
        let lanes = dispatch_lanes!(level, simd => lanes_of::<_, T>(simd));
        let [xs, ys, zs] = turned.bounds();
        let (mut worst, mut skipped) = (0.0f64, 0);
        let mut bundle = vec![T::nearest(f64::NAN); 2 * lanes * zs.end];
        for x in xs {
            for y in ys.clone().step_by(lanes) {
                let filled =
                    dispatch_lanes!(level, simd => turned.fill_lanes(simd, x, y, &mut bundle));
                skipped += usize::from(filled.len() < zs.len());
                for lane in 0..lanes.min(ys.end - y) {
                    let mut row = vec![Complex::default(); zs.end];
                    turned.fill(x, y + lane, &mut row);
                    for (z, exact) in row.iter().enumerate() {
                        let mut found = Complex::default();
                        if filled.contains(&z) {
                            found.re = bundle[2 * z * lanes + lane];
                            found.im = bundle[(2 * z + 1) * lanes + lane];
                        }
                        let apart: Complex<T> = found - exact;
                        worst = worst.max(apart.l1_norm().into());
                    }
                }
            }
        }
        (worst, skipped)
    }

    #[inline(always)]
    fn lanes_of<S: Simd, T: Real>(_: S) -> usize {
        T::Native::<S>::LEN
    }

    /// The bundles, in which empty patches are skipped and coordinates are kept relative to a node
    /// nearby, against the rows, whose coordinates are in double precision. Values are of order
    /// one; f32 coordinates within 20 cells are good to 1e-6.
    #[test]
    fn bundles_equal_rows() {
        let mut rng = SmallRng::seed_from_u64(6);
        let values = field(&mut rng);
        let first = DVec3::new(-15.3, -12.0, -17.8);
        let (single, double) = (
            MovingField::<f32>::new(&values, first).unwrap(),
            MovingField::<f64>::new(&values, first).unwrap(),
        );
        let origin = DVec3::new(-30.5, -29.5, -28.5);
        for turn in 0..6 {
            let mut c = || rng.random_range(-1.0..1.0);
            let rotation = match turn {
                0 => DQuat::IDENTITY,
                1 => DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2),
                _ => DQuat::from_xyzw(c(), c(), c(), c()).normalize(),
            };
            // Once everything, once a box that cuts the field.
            let mut within = single.reach(origin);
            if turn % 2 == 1 {
                within.hi[1] -= 19;
                within.lo[2] += 17;
            }
            for level in [Level::new(), Level::baseline()] {
                let (worst, skipped) =
                    compare(level, &single.turned(rotation, origin, within, within));
                assert!(worst < 8e-6, "{rotation}: {worst}");
                assert!(skipped > 0);
                let (worst, _) = compare(level, &double.turned(rotation, origin, within, within));
                assert!(worst < 1e-13, "{rotation}: {worst}");
            }
        }
    }
}
