//! Inscribed-sphere bound: a sphere inside the part would have to come out, too.
//!
//! The sphere's centre has three coordinates, whatever the part does, so that all its positions can be
//! checked. In a lattice of cells a sphere with its centre anywhere in a cell overlaps the fixed part by at
//! least its radius, less the distance of the cell's centre from the surface, less half the cell's
//! diagonal. A flood fill enters the cells of least overlap first until one is outside: the highest overlap
//! on its path is the least with which the sphere, and the part, can come out. Coarse cells give too low a
//! bound, never too high.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, HashSet};

use fft_correlate::Pose;
use glam::{DVec3, IVec3};
use sdf_grid::Aabb;

use crate::collision::body::Body;
use crate::collision::checker::CollisionChecker;

/// Edges of cells, in radii of the ball, the coarsest first.
const CELLS: [f64; 3] = [1.0 / 8.0, 1.0 / 16.0, 1.0 / 32.0];

/// Most cells that are entered at each.
const MOST_CELLS: usize = 50_000;

/// Steps of the search for the deepest point, in radii of the part: the first, halved so often.
const FIRST: f64 = 0.25;
const HALVINGS: u32 = 8;

/// A sphere inside the moving part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InscribedSphere {
    /// In the part's frame, metres.
    centre: DVec3,
    radius: f64,
}

impl InscribedSphere {
    /// A sphere about a deep point of the part; none if the centroid is outside.
    pub(crate) fn new(checker: &CollisionChecker) -> Option<Self> {
        let mut deepest = Self {
            centre: checker.frame.centre,
            radius: depth(&checker.moving, checker.frame.centre),
        };
        for halving in 0..=HALVINGS {
            let step = checker.frame.radius * FIRST * 0.5f64.powi(halving as i32);
            let around = DVec3::AXES.into_iter().flat_map(|e| [e, -e]);
            let around = around.map(|e| deepest.centre + step * e);
            let balls = around.map(|centre| Self {
                centre,
                radius: depth(&checker.moving, centre),
            });
            let better = balls.max_by(|a, b| a.radius.total_cmp(&b.radius));
            deepest = better
                .filter(|b| b.radius > deepest.radius)
                .unwrap_or(deepest);
        }
        (deepest.radius > 0.0).then_some(deepest)
    }

    /// A lower bound of the penetration that an exit from a pose needs, metres; `free` if no greater one is
    /// known.
    pub(crate) fn lower_bound(&self, checker: &CollisionChecker, pose: &Pose, free: f64) -> f64 {
        let start = pose.apply(self.centre);
        let bounds = checker.fixed.bounds().grown(self.radius);
        let flood =
            |cell: &f64| self.flood_cells(&checker.fixed, start, &bounds, cell * self.radius, free);
        CELLS.iter().map(flood).fold(free, f64::max)
    }

    /// The lower bound in cells of one size, `cell` metres.
    fn flood_cells(&self, fixed: &Body, start: DVec3, bounds: &Aabb, cell: f64, free: f64) -> f64 {
        let half_diagonal = 0.5 * 3f64.sqrt() * cell;
        let middle = |at: IVec3| start + cell * at.as_dvec3();
        let overlap = |p: DVec3| {
            let reach = self.radius - half_diagonal;
            reach - fixed.unsigned_distance(p, reach)
        };
        let outwards = |p: DVec3| {
            let beyond = (p - bounds.min).min(bounds.max - p);
            beyond.min_element()
        };
        // Flood fill from the start: of the cells at the front, the one of least overlap is next.
        let mut reached = HashSet::from([IVec3::ZERO]);
        let mut front = BinaryHeap::from([Reverse(Cell {
            level: free.max(overlap(start)),
            left: outwards(start),
            at: IVec3::ZERO,
        })]);
        let mut entered = 0;
        while let Some(Reverse(lowest)) = front.pop() {
            entered += 1;
            if lowest.left < 0.0 || entered > MOST_CELLS {
                return lowest.level;
            }
            for axis in IVec3::AXES.into_iter().flat_map(|e| [e, -e]) {
                let at = lowest.at + axis;
                if reached.insert(at) {
                    let p = middle(at);
                    front.push(Reverse(Cell {
                        level: lowest.level.max(overlap(p)),
                        left: outwards(p),
                        at,
                    }));
                }
            }
        }
        free
    }
}

/// How deep a point lies in one of a body's solids, metres; 0 outside.
fn depth(body: &Body, p: DVec3) -> f64 {
    let probes = body.probes(p, f64::INFINITY);
    probes.map(|probe| -probe.distance).fold(0.0, f64::max)
}

/// A cell at the front of the flood fill.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cell {
    /// The highest overlap on the path there, metres.
    level: f64,
    /// How far it is to the outside, metres; negative there.
    left: f64,
    at: IVec3,
}

impl Eq for Cell {}

impl Ord for Cell {
    /// The lowest first, of these the one nearest to the outside.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_place = || self.at.to_array().cmp(&other.at.to_array());
        let levels = self.level.total_cmp(&other.level);
        levels
            .then(self.left.total_cmp(&other.left))
            .then_with(by_place)
    }
}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DQuat;
    use pegfit_fixtures as shapes;
    use sdf_grid::TriangleMesh;

    use super::*;

    fn checker_of((fixed, moving): (TriangleMesh, TriangleMesh)) -> CollisionChecker {
        let [fixed, moving] = [fixed, moving].map(|mesh| Body::of_mesh(Arc::new(mesh)));
        CollisionChecker::new(fixed, moving, 2e-4)
    }

    /// A ball behind a lip is held by as much as the mouth is narrower, to within a cell, in frames of
    /// its own; one that passes is not held.
    #[test]
    fn a_ball_is_held_by_its_lip() {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.7, -1.2, 0.4));
        for clearance in [2e-5, 6e-5, 2e-4, 5e-4] {
            for lip in [2e-4, 3e-4, 5e-4, 1e-3] {
                let (fixed, ball) = shapes::captive_ball(clearance, lip).unwrap();
                let moved = fixed.transformed(turn, DVec3::new(0.3, -0.1, 0.2));
                let place = Pose::new(turn, DVec3::new(0.3, -0.1, 0.2));
                let checker = checker_of((moved, ball));
                let sphere = InscribedSphere::new(&checker).unwrap();
                assert!((sphere.radius / 0.004 - 1.0).abs() < 0.01, "{sphere:?}");
                let held = sphere.lower_bound(&checker, &place, 4e-6);
                let least = lip - 2.2 * sphere.radius * 3f64.sqrt() / 64.0;
                assert!(
                    held >= least.max(4e-6) && held <= lip,
                    "{clearance} {lip}: {held}"
                );
            }
        }
    }

    /// Parts that come out are never held, however long the path.
    #[test]
    fn what_comes_out_is_not_held() {
        let pegs = (0..6).map(|seed| {
            let fit = shapes::random_fit(seed).unwrap();
            (fit.fixed, fit.moving)
        });
        let others = [
            shapes::bayonet(2e-5).unwrap(),
            shapes::dovetail(2e-5).unwrap(),
            shapes::spool_in_slot(2e-5).unwrap(),
        ];
        for pair in pegs.chain(others) {
            let checker = checker_of(pair);
            let Some(sphere) = InscribedSphere::new(&checker) else {
                continue;
            };
            let held = sphere.lower_bound(&checker, &Pose::IDENTITY, 1e-9);
            assert!(held <= 1e-9, "{sphere:?}: {held}");
        }
    }
}
