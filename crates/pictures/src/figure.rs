//! Pictures of density fields on slices and in space.

use std::collections::HashMap;

use glam::DVec3;
use ndarray::{Array2, Array3, Axis};
use sdf_grid::{
    Aabb, DensityField, DensityKernel, Lattice, LatticeError, LengthUnit, TriangleMesh,
};

use crate::cloud::Cloud;
use crate::colour::ColourScale;
use crate::heat_map::{Contours, HeatMap, distance_levels};

/// The sheet of axis `slice.axis` nearest to the plane, as `[across, up]`.
pub fn sheet<T: Clone>(values: &Array3<T>, field: &DensityField, slice: &Slice) -> Array2<T> {
    let place = field
        .lattice()
        .fractional_index(glam::DVec3::splat(slice.at))[slice.axis];
    let last = values.len_of(Axis(slice.axis)) - 1;
    let index = (place.round().max(0.0) as usize).min(last);
    values.index_axis(Axis(slice.axis), index).to_owned()
}

/// Contour lines of the signed distance on a plane, in `unit`, and what to say about them.
pub fn distance_contours(
    field: &DensityField,
    slice: &Slice,
    unit: LengthUnit,
) -> (Contours, String) {
    let metre = unit.in_metres() as f32;
    let distance = sheet(&field.signed_distance, field, slice).mapv(|d| d / metre);
    let levels = distance_levels(&distance, 12);
    let step = levels.iter().map(|l| l.abs()).fold(f64::INFINITY, f64::min);
    let step = crate::canvas::number(step, 3);
    let note =
        format!("lines: signed distance every {step} {unit}, negative inside; bold: the boundary");
    let contours = Contours {
        values: distance,
        levels,
        bold: vec![0.0],
        labelled: true,
    };
    (contours, note)
}

/// A heat map of `values` (one per node of `field`'s sheet) with distance contours over it.
pub fn density_map(
    title: String,
    legend: &str,
    values: Array2<f32>,
    field: &DensityField,
    slice: &Slice,
    unit: LengthUnit,
) -> HeatMap {
    let [across, up] = slice.plane_axes();
    let bounds = field.lattice().node_bounds();
    let metre = unit.in_metres();
    let (contours, note) = distance_contours(field, slice, unit);
    HeatMap {
        title,
        horizontal: format!("{} ({unit})", AXES[across]),
        vertical: format!("{} ({unit})", AXES[up]),
        scale: ColourScale::diverging(values.iter().map(|v| f64::from(*v)), 0.995),
        values,
        across: [bounds.min[across] / metre, bounds.max[across] / metre],
        up: [bounds.min[up] / metre, bounds.max[up] / metre],
        legend: legend.to_owned(),
        contours: vec![contours],
        note,
        equal_axes: true,
    }
}

/// Points of the skeleton have a density this many times that beside a large flat face.
const SKELETON: f64 = 1.3;

/// Faces that meet at less than this angle (its cosine) are drawn as one.
const SMOOTH: f64 = 0.9;

/// The nodes, metres, where the density is well above that of a flat face: the skeleton of the part
/// (its size there) and of the space around it (minus its size).
pub fn skeleton_points(field: &DensityField, kernel: &DensityKernel) -> Vec<(DVec3, f64)> {
    let least = SKELETON * kernel.kappa();
    let nodes = field.interior.indexed_iter().map(|(index, interior)| {
        let at = [index.0, index.1, index.2];
        let inside = f64::from(interior.norm());
        (at, inside, f64::from(field.exterior[at].norm()))
    });
    nodes
        .filter(|(_, inside, outside)| inside.max(*outside) > least)
        .map(|(at, inside, outside)| {
            let value = if inside > outside { inside } else { -outside };
            (field.lattice().position(at), value)
        })
        .collect()
}

/// The [`skeleton_points`] as a picture.
pub fn skeleton(
    title: String,
    mesh: &TriangleMesh,
    field: &DensityField,
    kernel: &DensityKernel,
    unit: LengthUnit,
) -> Cloud {
    let metre = unit.in_metres();
    let least = SKELETON * kernel.kappa();
    let (points, values): (Vec<_>, Vec<_>) = skeleton_points(field, kernel)
        .into_iter()
        .map(|(point, value)| (point / metre, value))
        .unzip();
    let least = crate::canvas::number(least, 2);
    Cloud {
        title,
        note: format!(
            "nodes with |density| above {least}, {SKELETON} times that of a flat face: {}",
            points.len()
        ),
        scale: ColourScale::diverging(values.iter().copied(), 0.99),
        points,
        values,
        width: field.lattice().spacing() / metre,
        edges: sharp_edges(mesh).map(|e| e.map(|p| p / metre)).collect(),
        legend: "|density|\n+ inside\n- outside".to_owned(),
        unit: unit.to_string(),
    }
}

/// Edges where faces meet at an angle, or with one face only.
fn sharp_edges(mesh: &TriangleMesh) -> impl Iterator<Item = [DVec3; 2]> {
    let mut edges: HashMap<[u32; 2], Vec<DVec3>> = HashMap::new();
    for (t, [a, b, c]) in mesh.triangles().iter().zip(mesh.faces()) {
        let normal = (b - a).cross(c - a).normalize_or_zero();
        for k in 0..3 {
            let (v, w) = (t[k], t[(k + 1) % 3]);
            edges.entry([v.min(w), v.max(w)]).or_default().push(normal);
        }
    }
    let sharp = |normals: &[DVec3]| match normals {
        [a, b] => a.dot(*b) < SMOOTH,
        _ => true,
    };
    edges
        .into_iter()
        .filter(move |(_, normals)| sharp(normals))
        .map(|(ends, _)| ends.map(|v| mesh.vertices()[v as usize]))
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
        let at = crate::canvas::number(self.at / unit.in_metres(), 4);
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
