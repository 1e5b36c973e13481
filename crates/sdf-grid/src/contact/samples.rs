//! A part's surface as points, for sums over it.

use glam::DVec3;

use super::error::ContactError;
#[cfg(test)]
use crate::mesh::triangle_mesh::TriangleMesh;
#[cfg(test)]
use crate::surface::coplanar::pieces::merge_coplanar;
use crate::surface::face::Piece;

/// What is flat, in units of the part's largest extent.
pub(crate) const FLAT: f64 = 1e-7;

/// Most pieces of one surface.
const MOST: usize = 1 << 24;

/// A piece of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceSample {
    /// Its centroid, metres, in the part's frame.
    pub(crate) position: DVec3,
    /// Its normal, outwards, times its area; square metres.
    pub(crate) area: DVec3,
}

/// Adds faces in pieces whose sides are at most `distance` long (metres), each with the number of
/// its face.
///
/// # Errors
/// If there would be too many pieces.
pub(crate) fn surface_pieces(
    faces: impl Iterator<Item = Piece> + Clone,
    distance: f64,
    mut add: impl FnMut(usize, SurfaceSample),
) -> Result<(), ContactError> {
    let parts = |f: Piece| f.count_parts(distance).into_iter().product::<f64>();
    let found: f64 = faces.clone().map(parts).sum();
    if found > MOST as f64 {
        return Err(ContactError::TooMany {
            what: "surface pieces",
            most: MOST,
            found,
        });
    }
    for (i, face) in faces.enumerate() {
        face.sample(distance, |s| add(i, s));
    }
    Ok(())
}

impl Piece {
    /// Its corners as a quadrangle: of a triangle the last two are one, opposite the shortest side,
    /// so that narrow ones are not cut along.
    fn four_corners(&self) -> [DVec3; 4] {
        let [a, b, c, d] = self.corners;
        if self.count() == 4 {
            return [a, b, c, d];
        }
        let sides = [
            a.distance_squared(b),
            b.distance_squared(c),
            c.distance_squared(a),
        ];
        match sides {
            [ab, bc, ca] if bc < ab && bc <= ca => [b, c, a, a],
            [ab, _, ca] if ca < ab => [c, a, b, b],
            _ => [a, b, c, c],
        }
    }

    /// Into how many parts it is divided along its first two sides.
    fn count_parts(&self, distance: f64) -> [f64; 2] {
        let [a, b, c, d] = self.four_corners();
        let along = a.distance(b).max(c.distance(d));
        let up = b.distance(c).max(d.distance(a));
        [along, up].map(|l| (l / distance).ceil().max(1.0))
    }

    /// Its parts: those between evenly spaced lines across it.
    fn sample(&self, distance: f64, mut found: impl FnMut(SurfaceSample)) {
        let [a, b, c, d] = self.four_corners();
        let at = |u: f64, v: f64| a.lerp(b, u).lerp(d.lerp(c, u), v);
        let [across, up] = self.count_parts(distance);
        for j in 0..up as usize {
            for i in 0..across as usize {
                let [u, v] = [i as f64 / across, j as f64 / up];
                let [u1, v1] = [(i + 1) as f64 / across, (j + 1) as f64 / up];
                let corners = [at(u, v), at(u1, v), at(u1, v1), at(u, v1)];
                SurfaceSample::from_quad(corners)
                    .into_iter()
                    .for_each(&mut found);
            }
        }
    }
}

impl SurfaceSample {
    /// A flat quadrangle; none if it has no area.
    fn from_quad([a, b, c, d]: [DVec3; 4]) -> Option<Self> {
        let halves = [(b - a).cross(c - a), (c - a).cross(d - a)];
        let areas = halves.map(DVec3::length);
        let all = areas[0] + areas[1];
        let middles = [(a + b + c) / 3.0, (a + c + d) / 3.0];
        (all > 0.0).then(|| Self {
            position: (middles[0] * areas[0] + middles[1] * areas[1]) / all,
            area: 0.5 * (halves[0] + halves[1]),
        })
    }
}

/// The surface of `mesh` in pieces whose sides are at most `distance` long (metres), those of
/// coplanar triangles together.
///
/// # Errors
/// If the distance is not positive and finite, there would be too many, or no triangle has an area.
#[cfg(test)]
pub(crate) fn surface_samples(
    mesh: &TriangleMesh,
    distance: f64,
) -> Result<Vec<SurfaceSample>, ContactError> {
    if !(distance.is_finite() && distance > 0.0) {
        return Err(ContactError::Distance { found: distance });
    }
    let flat = FLAT * mesh.bounds().size().max_element();
    let faces = merge_coplanar(mesh.triangles(), mesh.vertices(), flat);
    let faces = (0..faces.len()).filter_map(|i| faces.get(i));
    let mut samples = Vec::new();
    surface_pieces(faces, distance, |_, s| samples.push(s))?;
    match samples.is_empty() {
        true => Err(ContactError::EmptyMesh),
        false => Ok(samples),
    }
}
