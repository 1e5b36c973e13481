//! Points that lie on the boundary itself, where the density jumps.
//!
//! The density there is the mean of its limits from both sides: half the exterior limit and half
//! the interior one. Each limit is taken a small step from the boundary along the averaged normal.

use glam::DVec3;

use crate::surface::face::Face;

/// A point nearer than this, in units of the part's largest extent, lies on the boundary. Far
/// above the rounding of f64 coordinates, far below any length that matters.
pub(crate) const BAND: f64 = 1e-9;

/// Step to either side, in units of the lattice spacing.
pub(crate) const STEP: f64 = 1e-4;

/// The angle-weighted normal of the boundary at `p`, over the faces within `band`; a unit
/// vector.
pub(crate) fn averaged_normal<'a>(
    faces: impl Iterator<Item = &'a Face>,
    p: DVec3,
    band: f64,
) -> DVec3 {
    let (mut sum, mut first) = (DVec3::ZERO, None);
    for t in faces.filter(|t| t.distance_squared(p) <= band * band) {
        sum += t.normal * angle_at(t, p, band);
        first.get_or_insert(t.normal);
    }
    // Opposite faces of a sheet without thickness cancel: either normal then serves.
    let fallback = first.unwrap_or(DVec3::X);
    if sum.length() > 1e-6 {
        sum.normalize()
    } else {
        fallback
    }
}

/// The angle the face fills around `p`, a point on it: a full turn inside, half on an edge,
/// the corner's angle on a corner.
fn angle_at(t: &Face, p: DVec3, band: f64) -> f64 {
    use std::f64::consts::PI;
    if let Some(k) = (0..t.count).find(|&k| t.corners[k].distance(p) <= band) {
        return t.along[k].angle_between(-t.along[(k + t.count - 1) % t.count]);
    }
    let on_edge = (0..t.count).any(|k| (p - t.corners[k]).dot(t.outward[k]).abs() <= band);
    if on_edge { PI } else { 2.0 * PI }
}
