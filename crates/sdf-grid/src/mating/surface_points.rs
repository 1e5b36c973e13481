//! Points on a surface that stand for its area, some of them on every smooth patch.

use glam::DVec3;

use super::features::{SMOOTH_COSINE, corner_normals, normal};
use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Points of every patch, if there are enough.
const OF_A_PATCH: usize = 8;

/// Patches with less than this share of the area have one point each.
const SMALL: f64 = 2e-4;

/// A point on a surface.
///
/// See the example of [`surface_points`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Where it lies, metres, in the part's frame.
    pub position: DVec3,
    /// Normal of the surface there, outwards, unit length.
    pub normal: DVec3,
    /// Normal of the curved surface that facets stand for; elsewhere the same.
    pub smooth_normal: DVec3,
    /// Share of the surface's area that it stands for; all points together stand for 1.
    pub weight: f64,
    /// The smooth patch it lies on.
    pub patch: usize,
}

/// About `count` points on the surface of a part, in proportion to the area of its smooth patches but
/// a few on each: small faces, such as the sides of a notch, have some too. Always the same ones.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{shapes, surface_points};
///
/// let points = surface_points(&shapes::cuboid(DVec3::ONE).unwrap(), 600);
/// let sum: f64 = points.iter().map(|p| p.weight).sum();
/// assert!((sum - 1.0).abs() < 1e-12 && points.iter().map(|p| p.patch).max() == Some(5));
/// ```
pub fn surface_points(mesh: &TriangleMesh, count: usize) -> Vec<SurfacePoint> {
    let normals: Vec<DVec3> = mesh.faces().map(normal).collect();
    let smooth = corner_normals(mesh);
    let areas: Vec<f64> = mesh.faces().map(face_area).collect();
    let total: f64 = areas.iter().sum();
    let (patch_of, patches) = mesh.topology().smooth_patches(&normals, SMOOTH_COSINE);
    let mut members: Vec<Vec<usize>> = vec![Vec::new(); patches];
    for (face, patch) in patch_of.iter().enumerate() {
        members[*patch].push(face);
    }
    let least = (count / 4 / patches.max(1)).clamp(1, OF_A_PATCH);
    let mut points = Vec::with_capacity(count);
    for (patch, faces) in members.iter().enumerate() {
        let area: f64 = faces.iter().map(|f| areas[*f]).sum();
        let share = area / total;
        let least = if share > SMALL { least } else { 1 };
        let wanted = ((count as f64 * share).round() as usize).max(least);
        // Equal steps of area along the patch's faces; in each face Roberts' sequence R2, which
        // fills the unit square evenly.
        let mut passed = 0.0;
        let mut done = 0;
        for &face in faces {
            passed += areas[face];
            while done < wanted && (done as f64 + 0.5) * area / (wanted as f64) < passed {
                let k = done as f64 + 0.37;
                let (s, t) = ((k * 0.754_877_666_2).fract(), (k * 0.569_840_291).fract());
                let [a, b, c] = mesh.corners(face);
                let u = s.sqrt();
                let at = |[a, b, c]: [DVec3; 3]| (1.0 - u) * a + u * (1.0 - t) * b + u * t * c;
                points.push(SurfacePoint {
                    position: at([a, b, c]),
                    normal: normals[face],
                    smooth_normal: at(smooth[face]).normalize_or_zero(),
                    weight: share / wanted as f64,
                    patch,
                });
                done += 1;
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::cuboid;

    #[test]
    fn small_faces_have_points_and_weights_are_areas() {
        // Four sides have a hundredth of the area each of the two large ones.
        let plate = cuboid(DVec3::new(1.0, 1.0, 0.01)).unwrap();
        let points = surface_points(&plate, 256);
        for patch in 0..6 {
            let of: Vec<_> = points.iter().filter(|p| p.patch == patch).collect();
            let weight: f64 = of.iter().map(|p| p.weight).sum();
            let expected = if of[0].normal.z.abs() > 0.5 {
                1.0
            } else {
                0.01
            } / 2.04;
            assert!(
                of.len() >= 8 && (weight - expected).abs() < 1e-12,
                "{patch}"
            );
            let flat = of.iter().all(|p| p.normal.dot(of[0].normal) > 0.999);
            assert!(flat);
        }
    }
}
