//! The volume terms of one cell.

use glam::DVec3;

use super::pieces::Which;
use super::walk::{Place, Walk};
use crate::geometry::plane::Plane;
use crate::geometry::tetrahedron::{Tetrahedron, centroid, of_cube, points, split, volume};
use crate::table::octree::Cell;
use crate::table::one_sided::Side;

/// Gauss points of order two, in half edges.
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// A tetrahedron and, a bit for a plane, before which planes it lies.
type Piece = (Tetrahedron, u32);

impl Walk<'_> {
    /// Adds a cell.
    pub(super) fn sum(&mut self, place: &Place<'_>) {
        let fixed = self.cutters(place, Which::Fixed);
        let moving = self.cutters(place, Which::Moving);
        let cell = place.cell;
        if fixed.planes.is_empty() && moving.planes.is_empty() {
            let at = |which, cutters| self.side(cell.centre, cutters, which);
            let sides = (at(Which::Fixed, &fixed), at(Which::Moving, &moving));
            if let (Some(a), Some(b)) = sides {
                self.whole(place, (a, b));
            }
            return;
        }
        // Only by sharp edges, where no rule of more points does better.
        let small = 2.0 * cell.half < self.truth.cells.smallest;
        let planes = [&fixed.planes[..], &moving.planes[..]].concat();
        for group in pieces(&cell, &planes, self.flat).chunk_by(|a, b| a.1 == b.1) {
            let by_volume = |a: &&Piece, b: &&Piece| volume(&a.0).total_cmp(&volume(&b.0));
            let Some(largest) = group.iter().max_by(by_volume) else {
                continue;
            };
            let inner = centroid(&largest.0);
            let a = self.side(inner, &fixed, Which::Fixed);
            let b = self.side(inner, &moving, Which::Moving);
            // A piece thinner than rounding has no volume.
            let (Some(a), Some(b)) = (a, b) else { continue };
            for (tetrahedron, _) in group {
                if small {
                    let middle = centroid(tetrahedron);
                    self.add(place, middle, (a, b), volume(tetrahedron));
                    continue;
                }
                let weight = 0.25 * volume(tetrahedron);
                for p in points(tetrahedron) {
                    self.add(place, p, (a, b), weight);
                }
            }
        }
        self.surfaces(place, &fixed, &moving);
    }

    fn whole(&mut self, place: &Place<'_>, sides: (Side, Side)) {
        let cell = place.cell;
        let weight = cell.half.powi(3);
        for index in 0..8 {
            let sign = |axis: usize| {
                if index >> axis & 1 == 1 {
                    GAUSS
                } else {
                    -GAUSS
                }
            };
            let p = cell.centre + DVec3::new(sign(0), sign(1), sign(2)) * cell.half;
            self.add(place, p, sides, weight);
        }
    }

    /// Adds a point that stands for `weight` cubic metres.
    fn add(&mut self, place: &Place<'_>, p: DVec3, (a, b): (Side, Side), weight: f64) {
        let weight = weight * self.truth.weights.of(a, b);
        if weight == 0.0 {
            return;
        }
        let fixed = self.truth.fixed.table.in_leaf(place.leaf, p, a);
        let moving = self.truth.moving.table.at(self.own(p), b);
        let blend = self.blend(place, p);
        let product = (fixed.value * moving.value).re;
        let own = fixed.slope(moving.value) * blend.fixed;
        let other = self.turn * moving.slope(fixed.value) * (1.0 - blend.fixed);
        let force = (own - other + blend.slope * product) * weight;
        self.sums.score += weight * product;
        self.sums.pull(p - self.pose.translation, force);
    }
}

/// The pieces into which planes cut a cell, those of one side of all together.
fn pieces(cell: &Cell, planes: &[Plane], flat: f64) -> Vec<Piece> {
    let least = (1e-5 * cell.half).powi(3);
    let mut pieces: Vec<Piece> = of_cube(cell.centre, cell.half).map(|t| (t, 0)).to_vec();
    for (bit, plane) in planes.iter().enumerate() {
        let mut next = Vec::with_capacity(3 * pieces.len());
        for (t, mask) in &pieces {
            let heights = t.map(|p| plane.height(p));
            split(t, heights, 1e-4 * flat, |part, before| {
                if volume(&part) > least {
                    next.push((part, mask | u32::from(before) << bit));
                }
            });
        }
        pieces = next;
    }
    pieces.sort_by_key(|p| p.1);
    pieces
}
