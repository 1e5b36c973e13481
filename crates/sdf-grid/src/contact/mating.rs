//! On how much area two parts lie against each other.

use glam::{DQuat, DVec3};

use super::error::ContactError;
use super::samples::{FLAT, SurfaceSample, surface_samples};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;
use crate::surface::face::Face;

/// How far beside a face a line may pass and still meet it, normalized: what rounding leaves
/// between faces that share an edge.
const BESIDE: f64 = 1e-12;

/// Two parts, one of them as a surface, the other as samples of its own, to be asked for the area on
/// which they lie against each other.
#[derive(Debug, Clone)]
pub struct MatingSurfaces {
    surface: Bvh,
    samples: Vec<SurfaceSample>,
}

/// Which faces lie against each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatingLimits {
    /// They are at most this far apart, or in each other, along the normal of the sampled one,
    /// metres.
    pub clearance: f64,
    /// They turn from being opposite by at most this, radians, below a quarter turn.
    pub angle: f64,
}

impl MatingSurfaces {
    /// Of a part and one whose surface is divided into pieces at most `distance` wide, metres.
    ///
    /// # Errors
    /// If the distance is not positive and finite, there would be too many pieces, or no triangle
    /// of `sampled` has an area.
    pub fn new(
        surface: &TriangleMesh,
        sampled: &TriangleMesh,
        distance: f64,
    ) -> Result<Self, ContactError> {
        let flat = FLAT * surface.bounds().size().max_element();
        Ok(Self {
            surface: Bvh::merged(surface, flat, Leaves::Small),
            samples: surface_samples(sampled, distance)?,
        })
    }

    /// The area of the sampled part on which it lies against the surface, square metres, where `y`
    /// of its frame lies at `rotation * y + translation` of the surface's frame: that of the samples
    /// from which a line along their normal, forwards or backwards, meets an opposite face within
    /// the limits. Allocates nothing.
    pub fn area(&self, rotation: DQuat, translation: DVec3, limits: &MatingLimits) -> f64 {
        let reach = limits.clearance * self.surface.scale();
        let opposite = -limits.angle.cos();
        let mates = |sample: &&SurfaceSample| {
            let place = rotation * sample.position + translation;
            let normal = (rotation * sample.area).normalize_or_zero();
            self.meets(self.surface.normalized(place), normal, reach, opposite)
        };
        let mated = self.samples.iter().filter(mates);
        mated.map(|s| s.area.length()).sum()
    }

    /// Whether the line through `q` along `normal` meets, within `reach` of it, a face whose normal
    /// has at most `opposite` in common with it. Normalized.
    fn meets(&self, q: DVec3, normal: DVec3, reach: f64, opposite: f64) -> bool {
        let mut found = false;
        // Boxes of faces that touch the reach count.
        let radius = reach * (1.0 + 1e-9) + BESIDE;
        self.surface.visit_within(q, radius, |i| {
            let face = &self.surface.faces[i];
            let along = face.normal.dot(normal);
            if found || along > opposite {
                return;
            }
            let away = -face.height(q) / along;
            found = away.abs() <= reach + BESIDE && covers(face, q + away * normal);
        });
        found
    }
}

/// Whether a point of a face's plane lies on the face.
fn covers(face: &Face, p: DVec3) -> bool {
    let within = |k: usize| (p - face.corners[k]).dot(face.outward[k]) <= BESIDE;
    (0..face.count).all(within)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pegfit_fixtures::{Profile, profiled};

    use crate::mesh::shapes::{construction, cuboid};

    const LIMITS: MatingLimits = MatingLimits {
        clearance: 3e-4,
        angle: 0.1,
    };

    /// A rod of 6 x 4 x 10 mm 7 mm deep in a blind hole with this clearance, whose floor it touches;
    /// both moved.
    fn rod_in_hole(clearance: f64, [fixed, moving]: [(DQuat, DVec3); 2]) -> MatingSurfaces {
        let rectangle = |x: f64, y: f64| {
            let corners = [(-x, -y), (x, -y), (x, y), (-x, y)];
            corners.map(|(x, y)| glam::dvec2(x, y)).to_vec()
        };
        let block = Profile {
            outline: rectangle(0.008, 0.007),
            levels: vec![[-0.010, 0.0], [0.002, 0.0]],
        };
        let hole = Profile {
            outline: rectangle(0.003, 0.002),
            levels: vec![[0.002, clearance], [-0.005, clearance]],
        };
        let block = profiled(&block, Some(&hole)).unwrap();
        let (vertices, triangles) = (block.vertices().to_vec(), block.triangles().to_vec());
        let block = construction::finish("block", vertices, triangles).unwrap();
        let rod = cuboid(DVec3::new(0.006, 0.004, 0.010)).unwrap();
        let [block, rod] =
            [(block, fixed), (rod, moving)].map(|(part, (q, t))| part.transformed(q, t));
        // Half a millimetre, whichever way edges are rounded.
        MatingSurfaces::new(&block, &rod, 5.01e-4).unwrap()
    }

    fn motions() -> [(DQuat, DVec3); 2] {
        [
            (
                DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7)),
                DVec3::new(0.01, -0.02, 0.005),
            ),
            (
                DQuat::from_scaled_axis(DVec3::new(-2.0, 0.3, 0.9)),
                DVec3::new(-0.03, 0.02, 0.011),
            ),
        ]
    }

    #[test]
    fn a_rod_mates_on_its_floor_and_on_the_walls_beside_it() {
        let [(qf, tf), (qm, tm)] = motions();
        let seat = (qf * qm.conjugate(), tf - qf * (qm.conjugate() * tm));
        // The floor, and walls 7 mm deep: pieces of half a millimetre end at the mouth.
        let (floor, walls) = (0.006 * 0.004, 2.0 * (0.006 + 0.004) * 0.007);
        for (clearance, expected) in [(0.0, floor + walls), (2e-4, floor + walls), (4e-4, floor)] {
            let found = rod_in_hole(clearance, motions()).area(seat.0, seat.1, &LIMITS);
            // No line leaves the parallel faces, whatever the frame.
            assert!(
                (found / expected - 1.0).abs() < 1e-9,
                "{clearance}: {found} {expected}"
            );
        }
        // Drawn out by 2 mm: the walls of 5 mm are left.
        let parts = rod_in_hole(1e-4, motions());
        let out = tf - seat.0 * tm + qf * DVec3::Z * 0.002;
        let found = parts.area(seat.0, out, &LIMITS);
        let expected = walls * 5.0 / 7.0;
        assert!((found / expected - 1.0).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn faces_that_lean_or_look_the_same_way_do_not_mate() {
        let parts = rod_in_hole(0.0, [(DQuat::IDENTITY, DVec3::ZERO); 2]);
        let lean = DQuat::from_rotation_x(1.1 * LIMITS.angle);
        let found = parts.area(lean, DVec3::ZERO, &LIMITS);
        // The two walls that the axis of the turn is normal to.
        let turned_in_their_plane = 2.0 * 0.004 * 0.007;
        assert!(found <= 1.05 * turned_in_their_plane, "{found}");
        let far = parts.area(DQuat::IDENTITY, DVec3::X, &LIMITS);
        assert_eq!(far, 0.0);
        // Within the block, its walls behind those of the hole.
        let rod = cuboid(DVec3::splat(0.01)).unwrap();
        let same = MatingSurfaces::new(&rod, &rod, 1e-3).unwrap();
        assert_eq!(same.area(DQuat::IDENTITY, DVec3::ZERO, &LIMITS), 0.0);
        assert!(MatingSurfaces::new(&rod, &rod, f64::NAN).is_err());
    }
}
