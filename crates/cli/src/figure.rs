//! The pictures that commands draw: what of the data goes where, and under which words.

use ndarray::{Array2, Array3, Axis};
use sdf_grid::{DensityField, LengthUnit};

use crate::picture::heat_map::distance_levels;
use crate::picture::{ColourScale, Contours, HeatMap};
use crate::slice::{AXES, Slice};

/// The sheet of axis `slice.axis` nearest to the plane, as `[across, up]`.
pub fn sheet<T: Clone>(values: &Array3<T>, field: &DensityField, slice: &Slice) -> Array2<T> {
    let place = field.lattice.fractional_index(glam::DVec3::splat(slice.at))[slice.axis];
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
    let step = crate::picture::canvas::number(step, 3);
    let note = format!("lines: signed distance every {step} {unit}; bold: the boundary");
    let contours = Contours {
        values: distance,
        levels,
        bold: vec![0.0],
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
    let bounds = field.lattice.node_bounds();
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
