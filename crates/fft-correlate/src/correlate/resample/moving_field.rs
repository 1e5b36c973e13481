//! One unit field of the moving part, cropped to its support, ready to be
//! rotated, and the occupancy of its blocks, by which empty space is skipped.

use glam::DVec3;
use ndarray::{Array3, Axis};
use num_complex::{Complex, Complex32};

use crate::correlate::kernels::lanes;
use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;
use crate::correlate::resample::hull::Hull;
use crate::pair::interpolation::Interpolation;
use crate::vectors;

/// Nodes of zeros around the stored values: a coordinate beyond them, moved into the outermost
/// cell, reads zeros, so that interpolation needs no case at the rim.
pub(super) const BORDER: usize = 2;

/// The field; see the file.
pub(crate) struct MovingField<T> {
    /// Values with [`BORDER`] zeros on every side.
    pub(super) values: Array3<Complex<T>>,
    /// Position of `values[[0, 0, 0]]` relative to the pivot, in cells of the moving frame.
    pub(super) first: DVec3,
    pub(super) occupied: Occupancy,
    pub(super) hull: Hull,
    pub(super) interpolation: Interpolation,
}

impl<T: Real> MovingField<T> {
    /// The values at the nodes of `support`, of a field whose node `[0, 0, 0]` lies `first` cells
    /// from the pivot.
    pub(crate) fn new(
        support: &IndexBox,
        value: impl Fn([usize; 3]) -> Complex32,
        first: DVec3,
        interpolation: Interpolation,
    ) -> Self {
        let offset = support.lo.map(|lo| lo - BORDER as i64);
        let mut values = Array3::zeros(stored(support, interpolation));
        for at in support.indices() {
            let v = value(at);
            if v != Complex32::default() {
                let to = [0, 1, 2].map(|a| (at[a] as i64 - offset[a]) as usize);
                values[to] = Complex::new(T::nearest(v.re.into()), T::nearest(v.im.into()));
            }
        }
        Self {
            occupied: Occupancy::new(&values, lanes::<T>(vectors::native()), interpolation),
            hull: Hull::new(&values, interpolation),
            values,
            interpolation,
            first: first + DVec3::from_array(offset.map(|o| o as f64)),
        }
    }

    /// The nodes that a place at this index reads, with their weights and the weights' slopes along
    /// each axis; `None` if some lie beyond the field.
    pub(super) fn taps(
        &self,
        at: DVec3,
    ) -> Option<impl Iterator<Item = ([usize; 3], DVec3, DVec3)>> {
        let (count, first) = (self.interpolation.nodes(), self.interpolation.first(at));
        let (nx, ny, nz) = self.values.dim();
        let end = first + count as f64;
        let shape = DVec3::new(nx as f64, ny as f64, nz as f64);
        if !(first.cmpge(DVec3::ZERO).all() && end.cmple(shape).all()) {
            return None;
        }
        let interpolation = self.interpolation;
        let of = move |a: usize, n: usize| interpolation.tap(at[a] - first[a], n);
        Some((0..count * count * count).map(move |flat| {
            let n = [flat / count / count, flat / count % count, flat % count];
            let [x, y, z] = [0, 1, 2].map(|a| of(a, n[a]));
            let node = [0, 1, 2].map(|a| first[a] as usize + n[a]);
            (node, DVec3::new(x.0, y.0, z.0), DVec3::new(x.1, y.1, z.1))
        }))
    }

    /// Room for a field of the same nodes.
    pub(crate) fn empty_values(&self) -> Array3<Complex<T>> {
        Array3::zeros(self.values.dim())
    }

    /// The values themselves.
    pub(crate) fn values(&self) -> &Array3<Complex<T>> {
        &self.values
    }

    /// Bytes of the stored values.
    pub(crate) fn bytes(support: &IndexBox, interpolation: Interpolation) -> u64 {
        let nodes: usize = stored(support, interpolation).iter().product();
        (nodes * size_of::<Complex<T>>()) as u64
    }
}

/// The shape of the stored values. Three nodes in a row are read with a fourth.
fn stored(support: &IndexBox, interpolation: Interpolation) -> [usize; 3] {
    let [x, y, z] = support.shape().map(|s| s + 2 * BORDER);
    [
        x,
        y,
        z + usize::from(interpolation == Interpolation::Quadratic),
    ]
}

/// Nodes along each side of the blocks whose emptiness is known.
const BLOCK: f64 = 4.0;

/// Samples along z that are taken or skipped together, for all lanes of y.
pub(super) const PATCH: usize = 8;

/// Where a field may be nonzero within reach of a patch of samples.
pub(super) struct Occupancy {
    /// Whether a patch with its middle in this block of [`BLOCK`] cells may see anything.
    blocks: Array3<bool>,
    /// Blocks before the one that holds node 0.
    before: f64,
}

impl Occupancy {
    /// For patches of `lanes` times [`PATCH`] samples one cell apart.
    pub(super) fn new<T: Real>(
        values: &Array3<Complex<T>>,
        lanes: usize,
        interpolation: Interpolation,
    ) -> Self {
        let half = |n: usize| (n as f64 - 1.0) / 2.0;
        // From the middle to the farthest sample, and on to the farthest node that it reads.
        let reach = half(lanes).hypot(half(PATCH)) + 3f64.sqrt() * interpolation.reach();
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
    pub(super) fn is_occupied_near(&self, middle: DVec3) -> bool {
        let at = (middle / BLOCK + self.before).floor();
        at.min_element() >= 0.0
            && self
                .blocks
                .get(at.to_array().map(|c| c as usize))
                .is_some_and(|v| *v)
    }
}
