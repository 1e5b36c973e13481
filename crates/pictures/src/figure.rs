//! Pictures of density fields on slices and in space.

use std::collections::HashMap;

use glam::DVec3;
use ndarray::Array2;
use sdf_grid::{DensityField, DensityKernel, LengthUnit, TriangleMesh};

use crate::cloud::Cloud;
use crate::colour::ColourScale;
use crate::heat_map::{Contours, HeatMap, distance_levels};
use crate::number::number;
use crate::skeleton_points::{LEAST, skeleton_points};
use crate::slice::{AXES, Slice, sheet};

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
    let step = number(step, 3);
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

/// Faces that meet at less than this angle (its cosine) are drawn as one.
const SMOOTH: f64 = 0.9;

/// The [`skeleton_points`] as a picture.
pub fn skeleton(
    title: String,
    mesh: &TriangleMesh,
    field: &DensityField,
    kernel: &DensityKernel,
    unit: LengthUnit,
) -> Cloud {
    let metre = unit.in_metres();
    let least = LEAST * kernel.kappa();
    let (points, values): (Vec<_>, Vec<_>) = skeleton_points(field, kernel)
        .into_iter()
        .map(|(point, value)| (point / metre, value))
        .unzip();
    let least = number(least, 2);
    Cloud {
        title,
        note: format!(
            "nodes with |density| above {least}, {LEAST} times that of a flat face: {}",
            points.len()
        ),
        scale: ColourScale::diverging(values.iter().copied(), 0.99),
        points,
        values,
        width: field.lattice().spacing() / metre,
        edges: sharp_edges(mesh).map(|e| e.map(|p| p / metre)).collect(),
        legend: "|density|\n+ inside\n\u{2212} outside".to_owned(),
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
