//! One unit field of the moving part, cropped to its support, ready to be turned.

use glam::DVec3;
use ndarray::Array3;
use num_complex::{Complex, Complex32};

use super::hull::Hull;
use super::occupied::Occupied;
use crate::correlate::kernels::lanes;
use crate::correlate::overlap::IndexBox;
use crate::correlate::real::Real;
use crate::level;

/// Nodes of zeros around the stored values: a coordinate beyond them, moved into the outermost
/// cell, reads zeros, so that interpolation needs no case at the rim.
pub(super) const BORDER: usize = 2;

/// The field; see the file.
pub(crate) struct MovingField<T> {
    /// Values with [`BORDER`] zeros on every side.
    pub(super) values: Array3<Complex<T>>,
    /// Position of `values[[0, 0, 0]]` relative to the pivot, in cells of the moving frame.
    pub(super) first: DVec3,
    pub(super) occupied: Occupied,
    pub(super) hull: Hull,
}

impl<T: Real> MovingField<T> {
    /// The values at the nodes of `support`, of a field whose node `[0, 0, 0]` lies `first` cells
    /// from the pivot.
    pub(crate) fn new(
        support: &IndexBox,
        value: impl Fn([usize; 3]) -> Complex32,
        first: DVec3,
    ) -> Self {
        let offset = support.lo.map(|lo| lo - BORDER as i64);
        let mut values = Array3::zeros(stored(support));
        for at in support.indices() {
            let v = value(at);
            if v != Complex32::default() {
                let to = [0, 1, 2].map(|a| (at[a] as i64 - offset[a]) as usize);
                values[to] = Complex::new(T::nearest(v.re.into()), T::nearest(v.im.into()));
            }
        }
        Self {
            occupied: Occupied::new(&values, lanes::<T>(level::native())),
            hull: Hull::new(&values),
            values,
            first: first + DVec3::from_array(offset.map(|o| o as f64)),
        }
    }

    /// Bytes of the stored values.
    pub(crate) fn bytes(support: &IndexBox) -> u64 {
        let nodes: usize = stored(support).iter().product();
        (nodes * size_of::<Complex<T>>()) as u64
    }
}

/// The shape of the stored values.
fn stored(support: &IndexBox) -> [usize; 3] {
    support.shape().map(|s| s + 2 * BORDER)
}
