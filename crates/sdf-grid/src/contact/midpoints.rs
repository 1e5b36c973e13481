//! A part's surface as points, in rows.

use super::error::ContactError;
use super::samples::{FLAT, SurfaceSample, surface_pieces};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces::merged;

/// The surface of `mesh` in pieces whose sides are at most `distance` long (metres), those of
/// coplanar triangles together.
///
/// # Errors
/// If the distance is not positive and finite, there would be too many, or no triangle has an area.
pub(crate) fn surface_samples(
    mesh: &TriangleMesh,
    distance: f64,
) -> Result<Vec<SurfaceSample>, ContactError> {
    if !(distance.is_finite() && distance > 0.0) {
        return Err(ContactError::Distance { found: distance });
    }
    let flat = FLAT * mesh.bounds().size().max_element();
    let faces = merged(mesh.triangles(), mesh.vertices(), flat);
    let faces = (0..faces.len()).filter_map(|i| faces.get(i));
    let mut samples = Vec::new();
    surface_pieces(faces, distance, |_, s| samples.push(s))?;
    match samples.is_empty() {
        true => Err(ContactError::EmptyMesh),
        false => Ok(samples),
    }
}
