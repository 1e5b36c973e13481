//! Planes through density fields.

use glam::DVec3;
use ndarray::{Array2, Array3, Axis};
use sdf_grid::{
    Aabb, DensityError, DensityField, DensityKernel, DensityOptions, KernelError, Lattice,
    LatticeError, LengthUnit, Monitor, Sampling, TriangleMesh,
};

use crate::number::number;

/// The sheet of axis `slice.axis` nearest to the plane, as `[across, up]`.
pub fn sheet<T: Clone>(values: &Array3<T>, field: &DensityField, slice: &Slice) -> Array2<T> {
    let place = field.lattice().fractional_index(DVec3::splat(slice.at))[slice.axis];
    let last = values.len_of(Axis(slice.axis)) - 1;
    let index = (place.round().max(0.0) as usize).min(last);
    values.index_axis(Axis(slice.axis), index).to_owned()
}

/// A plane perpendicular to a coordinate axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slice {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Where on that axis, metres.
    pub at: f64,
}

/// Text that is no plane.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected {}, found {found}", SliceTextError::EXPECTED)]
pub struct SliceTextError {
    /// What was there.
    pub found: String,
}

impl SliceTextError {
    /// What is a plane.
    pub const EXPECTED: &str = "x=, y= or z= and a number";
}

/// Letters of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

impl Slice {
    /// Reads `y=0`; the number is in `unit`.
    ///
    /// # Errors
    /// If the text is anything else.
    pub fn parse(text: &str, unit: LengthUnit) -> Result<Self, SliceTextError> {
        let wrong = || SliceTextError {
            found: text.to_owned(),
        };
        let (axis, at) = text.split_once('=').ok_or_else(wrong)?;
        let axis = AXES
            .iter()
            .position(|a| *a == axis.trim())
            .ok_or_else(wrong)?;
        let at: f64 = at.trim().parse().map_err(|_| wrong())?;
        if !at.is_finite() {
            return Err(wrong());
        }
        Ok(Self {
            axis,
            at: at * unit.in_metres(),
        })
    }

    /// The two other axes: horizontal, vertical in a picture.
    pub fn plane_axes(&self) -> [usize; 2] {
        match self.axis {
            0 => [1, 2],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    /// `y = 3 mm`.
    pub fn label(&self, unit: LengthUnit) -> String {
        let at = number(self.at / unit.in_metres(), 4);
        format!("{} = {at} {unit}", AXES[self.axis])
    }

    /// A lattice one node thick over `bounds`, with about `nodes` nodes along its longer side.
    ///
    /// # Errors
    /// If the bounds have no extent or are not finite.
    pub fn lattice(&self, bounds: &Aabb, nodes: usize) -> Result<Lattice, LatticeError> {
        let [across, up] = self.plane_axes();
        let size = bounds.size();
        let spacing = size[across].max(size[up]) / nodes as f64;
        let mut origin = bounds.min + DVec3::splat(0.5 * spacing);
        let mut shape = [1; 3];
        origin[self.axis] = self.at;
        for axis in [across, up] {
            shape[axis] = (size[axis] / spacing).round().max(1.0) as usize;
        }
        Lattice::new(origin, spacing, shape)
    }

    /// A part's density on the plane within `bounds`, computed for a picture, finer than a scene's
    /// lattice; `sigma` is the kernel's.
    ///
    /// # Errors
    /// If the bounds have no extent, `sigma` is out of range, or the monitor cancels.
    pub fn density(
        &self,
        mesh: &TriangleMesh,
        sigma: f64,
        bounds: &Aabb,
        monitor: &dyn Monitor,
    ) -> Result<DensityField, SliceError> {
        let kernel = DensityKernel::new(sigma)?;
        let options = DensityOptions {
            sampling: Sampling::Point,
            ..DensityOptions::default()
        };
        let lattice = self.lattice(bounds, PLANE_SAMPLES)?;
        Ok(DensityField::compute(
            mesh, &kernel, &lattice, &options, monitor,
        )?)
    }
}

/// Samples along the longer side of a density on a plane.
const PLANE_SAMPLES: usize = 260;

/// Why there is no density on a plane.
#[derive(Debug, thiserror::Error)]
pub enum SliceError {
    /// The kernel is out of range.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The bounds have no extent or are not finite.
    #[error(transparent)]
    Lattice(#[from] LatticeError),
    /// The density could not be computed.
    #[error(transparent)]
    Density(#[from] DensityError),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_becomes_a_plane() {
        let slice = Slice::parse("y=2.5", LengthUnit::Mm).unwrap();
        assert_eq!((slice.axis, slice.at), (1, 2.5e-3));
        assert_eq!(slice.label(LengthUnit::Mm), "y = 2.5 mm");
        for bad in ["y", "w=1", "y=a", "y=inf", "=1", ""] {
            assert!(Slice::parse(bad, LengthUnit::Mm).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_lattice_is_flat_and_covers_the_bounds() {
        let bounds = Aabb {
            min: DVec3::new(-2.0, -1.0, 0.0),
            max: DVec3::new(2.0, 1.0, 1.0),
        };
        let slice = Slice { axis: 1, at: 0.5 };
        let lattice = slice.lattice(&bounds, 40).unwrap();
        assert_eq!(lattice.shape(), [40, 1, 10]);
        assert_eq!(lattice.position([0, 0, 0]), DVec3::new(-1.95, 0.5, 0.05));
    }
}
