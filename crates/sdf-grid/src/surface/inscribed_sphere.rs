//! The largest sphere that fits into a part: how wide the part is, however it lies.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec3;

use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// A radius is good enough once no ball is larger by more than this.
const TOLERANCE: f64 = 0.003;

/// Distances may be too large by this share: from the axis of what is round in many facets all of
/// them are nearly as far, and to find the nearest takes them all.
const ROUGH: f64 = 0.001;

/// Most cubes that are evaluated.
const MOST: usize = 50_000;

/// A cube of centres of spheres, none of which has a radius above `bound`.
struct Cube {
    middle: DVec3,
    half: f64,
    /// How deep the middle lies in the part, negative outside.
    depth: f64,
    bound: f64,
}

/// The radius of the largest sphere found so far inside a part.
struct Search {
    tree: Bvh,
    largest: f64,
}

/// The radius, metres, of the largest sphere inside `mesh` (where the winding number exceeds a half),
/// to 0.3 %; for parts so long or flat that this takes more than 50 000 evaluations, the largest radius
/// found. None if no radius above `least` is found, as in an open sheet.
pub fn inscribed_sphere_radius(mesh: &TriangleMesh, least: f64) -> Option<f64> {
    let bounds = mesh.bounds();
    let mut search = Search {
        tree: Bvh::build(mesh),
        largest: least,
    };
    let whole = search.cube(bounds.center(), 0.5 * bounds.size().max_element(), None);
    let mut cubes = BinaryHeap::from_iter(whole);
    for _ in 0..MOST / 8 {
        let Some(cube) = cubes.pop().filter(|cube| search.may_improve(cube.bound)) else {
            break;
        };
        let half = 0.5 * cube.half;
        for octant in 0..8 {
            let side = |bit: u8| if octant & bit == 0 { -half } else { half };
            let middle = cube.middle + DVec3::new(side(1), side(2), side(4));
            cubes.extend(search.cube(middle, half, Some(cube.depth)));
        }
    }
    (search.largest > least).then_some(search.largest)
}

impl Search {
    fn may_improve(&self, radius: f64) -> bool {
        radius > (1.0 + TOLERANCE) * self.largest
    }

    /// The cube with that middle, if a larger ball may lie about one of its points; an eighth of one
    /// whose middle is so deep.
    fn cube(&mut self, middle: DVec3, half: f64, whole: Option<f64>) -> Option<Cube> {
        let distance = self.tree.distance_about(middle, ROUGH);
        let away = 3f64.sqrt() * half;
        if !self.may_improve(distance + away) {
            return None;
        }
        let inside = match whole {
            // No boundary on the way: the side costs more than the distance.
            Some(depth) if depth.abs() > (1.0 + ROUGH) * away => depth > 0.0,
            _ => (self.tree).inside_normalized(self.tree.normalized(middle)),
        };
        let depth = match inside {
            true => distance,
            false => -distance / (1.0 + ROUGH),
        };
        self.largest = self.largest.max(depth);
        let bound = depth + away;
        self.may_improve(bound).then_some(Cube {
            middle,
            half,
            depth,
            bound,
        })
    }
}

impl Ord for Cube {
    fn cmp(&self, other: &Self) -> Ordering {
        self.bound.total_cmp(&other.bound)
    }
}

impl PartialOrd for Cube {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Cube {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Cube {}

#[cfg(test)]
mod tests {
    use glam::{DQuat, dvec2};
    use rand::{Rng, SeedableRng, rngs::SmallRng};

    use super::*;
    use crate::mesh::shapes;

    fn turned(mesh: &TriangleMesh) -> TriangleMesh {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.9, 0.4));
        mesh.transformed(turn, DVec3::new(3.0, -0.2, 0.05))
    }

    #[test]
    fn known_balls_are_found_however_parts_lie() {
        let cross = [(1.0, 0.2), (0.2, 0.2), (0.2, 1.0)];
        let turns = [
            dvec2(1.0, 0.0),
            dvec2(0.0, 1.0),
            dvec2(-1.0, 0.0),
            dvec2(0.0, -1.0),
        ];
        let outline = turns
            .iter()
            .flat_map(|t| cross.map(|(x, y)| t.rotate(dvec2(x, y))));
        let outline: Vec<_> = outline.collect();
        // Facets of a curved part touch the ball in their middles.
        let within = |segments: f64, radius: f64| radius * (std::f64::consts::PI / segments).cos();
        let known = [
            (
                "block",
                shapes::cuboid(DVec3::new(0.01, 0.02, 0.07)).unwrap(),
                0.005,
            ),
            ("plate", shapes::plate(0.1, 0.002).unwrap(), 0.001),
            (
                "peg",
                shapes::cylinder(0.004, 0.05, 90).unwrap(),
                within(90.0, 0.004),
            ),
            // Inscribed in the square between the inner corners, whose diagonal is its diameter.
            (
                "cross",
                shapes::prism(&outline, &[], 9.0).unwrap(),
                0.2 * 2f64.sqrt(),
            ),
        ];
        for (name, mesh, radius) in known {
            for mesh in [&mesh, &turned(&mesh)] {
                let found = inscribed_sphere_radius(mesh, 0.0).unwrap();
                let error = found / radius - 1.0;
                assert!(
                    (-TOLERANCE..ROUGH).contains(&error),
                    "{name}: {found} for {radius}"
                );
                assert_eq!(
                    inscribed_sphere_radius(mesh, 1.004 * radius),
                    None,
                    "{name}"
                );
                let above = inscribed_sphere_radius(mesh, 0.9 * radius).unwrap();
                assert!((above / radius - 1.0).abs() < TOLERANCE, "{name}: {above}");
            }
        }
    }

    /// Against the deepest of many points.
    #[test]
    fn no_ball_is_larger() {
        let mut rng = SmallRng::seed_from_u64(5);
        for seed in 0..12 {
            let mesh = turned(&shapes::random_solid(seed).unwrap());
            let (tree, bounds) = (Bvh::build(&mesh), mesh.bounds());
            let point = |rng: &mut SmallRng| {
                let share = DVec3::from_array(std::array::from_fn(|_| rng.random()));
                bounds.min + share * bounds.size()
            };
            let depths = (0..4000).map(|_| -tree.signed_distance(point(&mut rng)));
            let deepest = depths.fold(0.0, f64::max);
            let found = inscribed_sphere_radius(&mesh, 0.0).unwrap();
            assert!(
                found > (1.0 - TOLERANCE) * deepest,
                "{seed}: {found} {deepest}"
            );
            assert!(found <= (1.0 + ROUGH) * 0.5 * bounds.size().min_element());
        }
    }
}
