//! The skeletons of parts.

use glam::DVec3;
use sdf_grid::{DensityField, DensityKernel};

/// Points of the skeleton have a density this many times that beside a large flat face.
pub(crate) const LEAST: f64 = 1.3;

/// The nodes, metres, where the density is well above that of a flat face: the skeleton of the part
/// (its size there) and of the space around it (minus its size).
pub fn skeleton_points(field: &DensityField, kernel: &DensityKernel) -> Vec<(DVec3, f64)> {
    let least = LEAST * kernel.kappa();
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
