//! Volume and depth of the interference of two solids.

use glam::{DQuat, DVec3, Vec3Swizzles};

use super::bvh::tree::Bvh;
use crate::mesh::aabb::Aabb;
use crate::mesh::boolean::{ClosedSurface, Intersection};
use crate::mesh::measure::face_area;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Volume and depth of the interference of two solids at a pose.
///
/// See the example of [`InterferenceQuery`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Interference {
    /// Volume of the intersection, cubic metres.
    pub volume: f64,
    /// Penetration depth, metres: the greatest distance, from the other solid's surface, of a point
    /// of either surface that lies inside the other solid.
    pub depth: f64,
}

/// Two solids whose interference is asked for at many poses.
///
/// Where both surfaces are closed the volume is exact up to rounding: that of the boolean
/// intersection of the two meshes. Of a surface with open edges, or with more than two faces at an
/// edge, it is measured along 64 x 64 rays (to about 2 %). The depth is that of some 3000 points
/// spread over the surfaces, corners among them unless there are more than 10 000 of these.
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
        // Points that cannot lie deeper than the deepest so far need no exact distance.
        let deeper = |deepest: f64, p: DVec3| {
            let deepest = fixed.distance_above(p, deepest).unwrap_or(deepest);
            moving.distance_above(back(p), deepest).unwrap_or(deepest)
        };
        let deepest = |points: Vec<DVec3>| points.into_iter().fold(0.0, deeper);
        match self.common(&placed) {
            Some(Intersection::Nothing) => Interference::default(),
            Some(Intersection::Solid(common)) => {
                let middle = self.fixed.bounds().center();
                let (vertices, triangles) = common.mesh();
                let vertices: Vec<DVec3> = vertices.iter().map(|v| v + middle).collect();
                Interference {
                    volume: common.volume().max(0.0),
                    depth: deepest(points_on(&vertices, &triangles)),
                }
            }
            None => {
                // Points of one surface that lie inside the other solid.
                let (fixed_box, moving_box) = (self.fixed.bounds(), placed.bounds());
                let in_moving =
                    |p: &DVec3| moving_box.contains(*p) && moving.signed_distance(back(*p)) <= 0.0;
                let in_fixed =
                    |p: &DVec3| fixed_box.contains(*p) && fixed.signed_distance(*p) <= 0.0;
                let points = |part: &TriangleMesh| points_on(part.vertices(), part.triangles());
                let of_fixed = points(self.fixed).into_iter().filter(in_moving);
                let of_moving = points(&placed).into_iter().filter(in_fixed);
                let points = of_fixed.chain(of_moving).collect();
                Interference {
                    volume: shared_volume(self.fixed, &placed),
                    depth: deepest(points),
                }
            }
        }
    }

    /// The boolean intersection with the placed moving part; none if a surface is not closed.
    fn common(&self, placed: &TriangleMesh) -> Option<Intersection> {
        let middle = self.fixed.bounds().center();
        let vertices: Vec<DVec3> = placed.vertices().iter().map(|v| v - middle).collect();
        let moving = ClosedSurface::new(&vertices, placed.triangles())?;
        self.closed.as_ref()?.intersection(&moving)
    }
}

/// Points on a surface: its vertices, the middle of each face, and of large ones a grid, some 3000 in
/// all. Of a finely cut surface, whose neighbours tell the same, every few of its vertices and faces.
fn points_on(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    const GRID: f64 = 3000.0;
    const MOST: usize = 10_000;
    let few = |count: usize| count.div_ceil(MOST).max(1);
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let area: f64 = triangles.iter().map(|t| face_area(corners(t))).sum();
    let mut points: Vec<DVec3> = (vertices.iter().copied())
        .step_by(few(vertices.len()))
        .collect();
    let triangles = triangles.iter().step_by(few(triangles.len()));
    for face in triangles.map(corners) {
        let [a, b, c] = face;
        points.push((a + b + c) / 3.0);
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

/// Rays along each axis.
const RAYS: usize = 64;

/// Volume shared by two meshes, cubic metres, to about 2 %: lengths that parallel rays have in both,
/// summed over 64 x 64 rays through the box in which they can overlap. Rays along each of the three
/// axes are tried, since thin slivers lie between the rays along two of them; the largest volume
/// counts.
pub(super) fn shared_volume(fixed: &TriangleMesh, moving: &TriangleMesh) -> f64 {
    let (a, b) = (fixed.bounds(), moving.bounds());
    let both = Aabb {
        min: a.min.max(b.min),
        max: a.max.min(b.max),
    };
    if both.size().min_element() <= 0.0 {
        return 0.0;
    }
    let along = |axis: usize| rays(fixed, moving, &both, axis);
    (0..3).map(along).fold(0.0, f64::max)
}

/// By rays along one axis.
fn rays(fixed: &TriangleMesh, moving: &TriangleMesh, within: &Aabb, axis: usize) -> f64 {
    // The axis becomes z; a cyclic exchange keeps orientations.
    let turned = |p: DVec3| match axis {
        0 => p.yzx(),
        1 => p.zxy(),
        _ => p,
    };
    let (low, size) = (turned(within.min), turned(within.size()));
    let cell = size.truncate() / RAYS as f64;
    let mut crossings = vec![[Vec::new(), Vec::new()]; RAYS * RAYS];
    for (side, mesh) in [fixed, moving].into_iter().enumerate() {
        for face in mesh.faces() {
            let [p, q, r] = face.map(|v| {
                let v = turned(v) - low;
                ((v.truncate() / cell) - 0.5).extend(v.z)
            });
            cross([p, q, r], |i, j, z, up| {
                crossings[i * RAYS + j][side].push((z, up))
            });
        }
    }
    let both: f64 = crossings.iter_mut().map(shared_length).sum();
    both * cell.x * cell.y
}

/// Calls `found` with every ray (at whole numbers of x and y) that meets a triangle, with the height
/// and whether the triangle faces upwards.
fn cross([p, q, r]: [DVec3; 3], mut found: impl FnMut(usize, usize, f64, bool)) {
    let area = (q - p).truncate().perp_dot((r - p).truncate());
    if area == 0.0 {
        return;
    }
    let [low, high] = [p.min(q).min(r), p.max(q).max(r)];
    let range = |low: f64, high: f64| {
        let last = (high.floor() + 1.0).clamp(0.0, RAYS as f64) as usize;
        (low.ceil().clamp(0.0, RAYS as f64) as usize)..last
    };
    for i in range(low.x, high.x) {
        for j in range(low.y, high.y) {
            // Off the middle by an odd amount: rays through shared edges meet one triangle.
            let at = glam::DVec2::new(i as f64 + 1.234_567e-7, j as f64 + 7.654_321e-8);
            let share = |a: DVec3, b: DVec3| (a.truncate() - at).perp_dot(b.truncate() - at) / area;
            let shares = [share(q, r), share(r, p), share(p, q)];
            if shares.iter().all(|s| *s >= 0.0) {
                let z = shares[0] * p.z + shares[1] * q.z + shares[2] * r.z;
                found(i, j, z, area > 0.0);
            }
        }
    }
}

/// Length of a ray that lies in both solids, from where it crosses their surfaces.
fn shared_length(crossings: &mut [Vec<(f64, bool)>; 2]) -> f64 {
    let [a, b] = crossings;
    let mut all: Vec<(f64, usize, i32)> = Vec::with_capacity(a.len() + b.len());
    for (side, list) in [&*a, &*b].into_iter().enumerate() {
        // A face that looks down is where the ray enters.
        all.extend(
            list.iter()
                .map(|(z, up)| (*z, side, if *up { -1 } else { 1 })),
        );
    }
    all.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut inside, mut length, mut last) = ([0i32; 2], 0.0, 0.0);
    for (z, side, change) in all {
        if inside[0] > 0 && inside[1] > 0 {
            length += z - last;
        }
        inside[side] += change;
        last = z;
    }
    length
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
