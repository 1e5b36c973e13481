//! The surface terms of one cell: densities jump across both surfaces.

use glam::DVec3;

use super::pieces::{Cutters, Which};
use super::walk::{Place, Walk};
use crate::geometry::polygon::Polygon;
use crate::table::one_sided::Side;

impl Walk<'_> {
    pub(super) fn surfaces(&mut self, place: &Place<'_>, fixed: &Cutters, moving: &Cutters) {
        for facet in place.fixed {
            let normal = self.truth.fixed.faces.planes[facet.plane as usize].normal;
            for piece in cut(&facet.polygon, moving, self.flat) {
                let side = self.side(piece.centroid(), moving, Which::Moving);
                self.on_fixed(place, &piece, normal, side);
            }
        }
        for facet in place.moving {
            let normal = self.moved.planes[facet.plane as usize].normal;
            for piece in cut(&facet.polygon, fixed, self.flat) {
                let side = self.side(piece.centroid(), fixed, Which::Fixed);
                self.on_moving(place, &piece, normal, side);
            }
        }
    }

    /// A piece of the fixed surface on one side of the moving one; where they coincide, the mean
    /// of both sides.
    fn on_fixed(&mut self, place: &Place<'_>, piece: &Polygon, normal: DVec3, side: Option<Side>) {
        let truth = self.truth;
        piece.quadrature(|p, area| {
            let own = Side::BOTH.map(|s| truth.fixed.table.in_leaf(place.leaf, p, s).value);
            let mut jump = 0.0;
            for (other, share) in shares(side) {
                let weight = |s| truth.weights.of(s, other);
                let step = own[0] * weight(Side::Out) - own[1] * weight(Side::In);
                let value = truth.moving.table.at(self.own(p), other).value;
                jump += share * (step * value).re;
            }
            let force = normal * (jump * area * self.blend(place, p).fixed);
            self.sums.pull(p - self.pose.translation, force);
        });
    }

    /// The same of the moving surface.
    fn on_moving(&mut self, place: &Place<'_>, piece: &Polygon, normal: DVec3, side: Option<Side>) {
        let truth = self.truth;
        piece.quadrature(|p, area| {
            let q = self.own(p);
            let own = Side::BOTH.map(|s| truth.moving.table.at(q, s).value);
            let mut jump = 0.0;
            for (other, share) in shares(side) {
                let weight = |s| truth.weights.of(other, s);
                let step = own[0] * weight(Side::Out) - own[1] * weight(Side::In);
                let value = truth.fixed.table.in_leaf(place.leaf, p, other).value;
                jump += share * (step * value).re;
            }
            let force = normal * (-jump * area * (1.0 - self.blend(place, p).fixed));
            self.sums.pull(p - self.pose.translation, force);
        });
    }
}

/// How much each side of the other surface counts.
fn shares(side: Option<Side>) -> impl Iterator<Item = (Side, f64)> {
    let share = move |s| side.map_or(0.5, |only| f64::from(u8::from(s == only)));
    Side::BOTH
        .into_iter()
        .map(move |s| (s, share(s)))
        .filter(|s| s.1 > 0.0)
}

fn cut(polygon: &Polygon, cutters: &Cutters, flat: f64) -> Vec<Polygon> {
    let mut pieces = vec![*polygon];
    for plane in &cutters.planes {
        let halves = |p: &Polygon| {
            let (a, b) = p.split(|p| plane.height(p), flat);
            [a, b].into_iter().flatten()
        };
        pieces = pieces.iter().flat_map(halves).collect();
    }
    pieces
}
