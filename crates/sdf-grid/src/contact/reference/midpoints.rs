//! A part's surface as points, in rows.

use crate::contact::samples::{FLAT, SurfaceSample, surface_pieces};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces::merged;

/// The surface of `mesh` in pieces whose sides are at most `distance` long (metres), those of
/// coplanar triangles together.
pub(crate) fn surface_samples(mesh: &TriangleMesh, distance: f64) -> Vec<SurfaceSample> {
    let flat = FLAT * mesh.bounds().size().max_element();
    let faces = merged(mesh.triangles(), mesh.vertices(), flat);
    let faces = (0..faces.len()).filter_map(|i| faces.get(i));
    let mut samples = Vec::new();
    surface_pieces(faces, distance, |_, s| samples.push(s)).expect("few enough for a test");
    samples
}
