//! How far two solids lie in one another.

use glam::{DQuat, DVec3};

use super::bvh::tree::Bvh;
use super::shared_length::shared_volume;
use crate::mesh::boolean::{ClosedSurface, Common};
use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// How far two solids lie in one another at a pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Interference {
    /// The volume that both fill, cubic metres.
    pub volume: f64,
    /// The greatest distance of a point of either surface that lies in the other solid from that
    /// solid's surface, metres: how far the parts have to give way.
    pub depth: f64,
}

/// Two solids whose interference is asked for at many poses.
///
/// Where both surfaces are closed the volume is exact up to rounding: that of the boolean
/// intersection of the two meshes. Of a surface with open edges, or with more than two faces at an
/// edge, it is measured along 64 x 64 rays (to about 2 %). The depth is that of some 3000 points
/// spread over the surfaces, corners among them.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{InterferenceQuery, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01)).unwrap();
/// let query = InterferenceQuery::new(&cube, &cube);
/// let found = query.at(DQuat::IDENTITY, DVec3::new(0.009, 0.0, 0.0));
/// assert!((found.volume - 1e-7).abs() < 1e-15);
/// assert!((found.depth - 1e-3).abs() < 1e-12);
/// ```
#[derive(Debug)]
pub struct InterferenceQuery<'a> {
    fixed: &'a TriangleMesh,
    moving: &'a TriangleMesh,
    /// Distances from the surfaces of both.
    trees: [Bvh; 2],
    /// The fixed part's surface, its middle at the origin; none if it is not closed.
    closed: Option<ClosedSurface>,
}

impl<'a> InterferenceQuery<'a> {
    /// Prepares the interference of `moving` with `fixed`.
    pub fn new(fixed: &'a TriangleMesh, moving: &'a TriangleMesh) -> Self {
        let middle = fixed.bounds().center();
        let vertices: Vec<DVec3> = fixed.vertices().iter().map(|v| v - middle).collect();
        Self {
            fixed,
            moving,
            trees: [Bvh::build(fixed), Bvh::build(moving)],
            closed: ClosedSurface::new(&vertices, fixed.triangles()),
        }
    }

    /// The interference where `y` of the moving part's frame lies at `rotation * y + translation` of
    /// the fixed part's.
    pub fn at(&self, rotation: DQuat, translation: DVec3) -> Interference {
        let placed = self.moving.transformed(rotation, translation);
        if !self.fixed.bounds().overlaps(&placed.bounds()) {
            return Interference::default();
        }
        let back = |p: DVec3| rotation.conjugate() * (p - translation);
        let [fixed, moving] = &self.trees;
        let depth = |p: DVec3| {
            let away = [fixed.nearest(p), moving.nearest(back(p))];
            away[0].distance.max(away[1].distance)
        };
        let deepest = |points: Vec<DVec3>| points.into_iter().map(depth).fold(0.0, f64::max);
        match self.common(&placed) {
            Some(Common::Nothing) => Interference::default(),
            Some(Common::Solid(common)) => {
                let middle = self.fixed.bounds().center();
                let (vertices, triangles) = common.mesh();
                let corner = |v: u32| vertices[v as usize] + middle;
                let faces = triangles.iter().map(|t| t.map(corner));
                Interference {
                    volume: common.volume().max(0.0),
                    depth: deepest(points_on(faces)),
                }
            }
            None => {
                let inside = |p: &DVec3| {
                    fixed
                        .signed_distance(*p)
                        .max(moving.signed_distance(back(*p)))
                };
                let mut points = points_on(self.fixed.faces());
                points.extend(points_on(placed.faces()));
                points.retain(|p| inside(p) <= 0.0);
                Interference {
                    volume: shared_volume(self.fixed, &placed),
                    depth: deepest(points),
                }
            }
        }
    }

    /// The boolean intersection with the placed moving part; none if a surface is not closed.
    fn common(&self, placed: &TriangleMesh) -> Option<Common> {
        let middle = self.fixed.bounds().center();
        let vertices: Vec<DVec3> = placed.vertices().iter().map(|v| v - middle).collect();
        let moving = ClosedSurface::new(&vertices, placed.triangles())?;
        self.closed.as_ref()?.intersection(&moving)
    }
}

/// Points on a surface: the corners and the middle of each face, and of large ones a grid, some 3000
/// in all.
fn points_on(faces: impl Iterator<Item = [DVec3; 3]>) -> Vec<DVec3> {
    const GRID: f64 = 3000.0;
    let faces: Vec<_> = faces.collect();
    let area: f64 = faces.iter().copied().map(face_area).sum();
    let mut points = Vec::new();
    for face in faces {
        let [a, b, c] = face;
        points.extend([a, b, c, (a + b + c) / 3.0]);
        // A triangle cut into n² alike has (n - 1) (n - 2) / 2 grid points inside it.
        let n = (2.0 * GRID * face_area(face) / area).sqrt() as u32 + 1;
        for i in 1..n {
            for j in 1..n - i {
                let [u, v] = [i, j].map(|k| f64::from(k) / f64::from(n));
                points.push(a + u * (b - a) + v * (c - a));
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::repair::report::RepairOptions;
    use crate::mesh::shapes;

    const SIDE: f64 = 0.01;

    /// A frame that nothing is parallel to.
    fn frame() -> (DQuat, DVec3) {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
        (turn, DVec3::new(0.3, -0.2, 0.1))
    }

    #[test]
    fn slivers_and_faces_that_touch_are_measured_exactly_in_any_frame() {
        let cube = shapes::cuboid(DVec3::splat(SIDE)).unwrap();
        let (turn, shift) = frame();
        let turned = cube.transformed(turn, shift);
        let query = InterferenceQuery::new(&turned, &cube);
        for axis in DVec3::AXES {
            for depth in [0.5 * SIDE, 4e-4, 1e-6, 0.0, -1e-6] {
                let found = query.at(turn, shift + turn * ((SIDE - depth) * axis));
                let expected = SIDE * SIDE * f64::max(depth, 0.0);
                assert!(
                    (found.volume - expected).abs() < 1e-17,
                    "{depth}: {found:?}"
                );
                // Half a side is reached in the middle of the face alone, beside the points.
                let deep = f64::max(depth, 0.0);
                let range = 0.9 * deep - 1e-12..=deep + 1e-12;
                assert!(range.contains(&found.depth), "{depth}: {found:?}");
            }
        }
        // A regular octagon of the square, turned by 45 degrees about z.
        let eighth = DQuat::from_rotation_z(0.25 * std::f64::consts::PI);
        let found = query.at(turn * eighth, shift);
        let expected = SIDE.powi(3) * 2.0 * (2f64.sqrt() - 1.0);
        assert!((found.volume / expected - 1.0).abs() < 1e-12, "{found:?}");
        assert_eq!(query.at(turn, shift + DVec3::X), Interference::default());
    }

    #[test]
    fn an_open_surface_is_measured_along_rays() {
        let cube = shapes::cuboid(DVec3::splat(SIDE)).unwrap();
        // One of the triangles of the far side is missing.
        let kept: Vec<_> = (cube.triangles().iter().copied().enumerate())
            .filter(|(i, _)| cube.corners(*i).iter().any(|c| c.x < 0.0) || *i % 2 == 0)
            .map(|(_, t)| t)
            .collect();
        assert!(kept.len() < cube.triangles().len());
        let options = RepairOptions::default();
        let (open, report) =
            TriangleMesh::clean("open", cube.vertices().to_vec(), kept, &options).unwrap();
        assert!(!report.watertight);
        let found = InterferenceQuery::new(&cube, &open).at(DQuat::IDENTITY, DVec3::X * 0.008);
        assert!((found.volume / 2e-7 - 1.0).abs() < 0.03, "{found:?}");
        assert!((found.depth - 2e-3).abs() < 1e-5, "{found:?}");
    }
}
