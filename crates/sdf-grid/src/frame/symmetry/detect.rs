//! The search for axes.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use super::axis::{MAX_ORDER, SymmetryAxis, SymmetryOrder};
use super::candidates;
use super::samples::Samples;
use crate::frame::principal_axes::principal_axes;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// The rotational symmetry axes of `mesh`, highest order first.
///
/// A turn counts if it carries every sample of the surface to within `tolerance` (metres) of the
/// surface. So a cylinder of n facets is continuous for a tolerance above `r (1 - cos(pi / n))`,
/// and of order n below it. A part with one continuous axis and a symmetric front and back has a
/// twofold axis in every direction across it: one of them stands for all. A sphere's axes are
/// represented by three.
pub fn detect(mesh: &TriangleMesh, tolerance: f64) -> Vec<SymmetryAxis> {
    let centroid = mesh.centroid();
    let part = Part {
        bvh: Bvh::build(mesh),
        samples: Samples::of(mesh, centroid),
        centroid,
        tolerance,
    };
    let mut axes: Vec<SymmetryAxis> = Vec::new();
    let principal = principal_axes(mesh, centroid);
    for direction in principal {
        if part.is_round(direction) {
            part.add(&mut axes, direction);
        }
    }
    if axes.is_empty() {
        for turn in candidates::vertex_turns(mesh, centroid, tolerance) {
            // Most candidates fail here after a few samples; finding an order takes far longer.
            if part.knows(&axes, turn.axis) || !part.maps_onto_itself(turn.axis, turn.angle) {
                continue;
            }
            part.add(&mut axes, turn.axis);
        }
        // Last, because principal axes of equal moments lie anywhere between the true ones.
        for direction in principal {
            part.add(&mut axes, direction);
        }
    }
    let continuous: Vec<DVec3> = continuous(&axes).collect();
    if let &[direction] = continuous.as_slice() {
        // Whatever else was found is a turn across the axis, like any other one.
        axes.retain(|a| a.order == SymmetryOrder::Continuous);
        part.add(&mut axes, direction.any_orthonormal_vector());
    } else if continuous.len() > 1 {
        axes = [DVec3::Z, DVec3::Y, DVec3::X]
            .map(|d| part.axis(d, SymmetryOrder::Continuous))
            .to_vec();
    }
    axes.sort_by_key(|a| match a.order {
        SymmetryOrder::Continuous => 0,
        SymmetryOrder::Finite(n) => u32::MAX - n,
    });
    axes
}

fn continuous(axes: &[SymmetryAxis]) -> impl Iterator<Item = DVec3> + '_ {
    axes.iter()
        .filter(|a| a.order == SymmetryOrder::Continuous)
        .map(|a| a.direction)
}

/// A part ready to be turned.
struct Part {
    bvh: Bvh,
    samples: Samples,
    centroid: DVec3,
    tolerance: f64,
}

impl Part {
    /// Adds the axis along `direction` if it is one and not there yet.
    fn add(&self, axes: &mut Vec<SymmetryAxis>, direction: DVec3) {
        if self.knows(axes, direction) {
            return;
        }
        if let Some(order) = self.order(direction) {
            axes.push(self.axis(direction, order));
        }
    }

    /// True if `direction` is one of `axes` as far as the tolerance can tell.
    fn knows(&self, axes: &[SymmetryAxis], direction: DVec3) -> bool {
        let blur = (2.0 * self.tolerance / self.samples.radius + 1e-9).min(0.1);
        axes.iter()
            .any(|a| a.direction.cross(direction).length() <= blur)
    }

    fn axis(&self, direction: DVec3, order: SymmetryOrder) -> SymmetryAxis {
        let size = direction.abs();
        let largest = (0..3).fold(0, |k, i| if size[i] > size[k] + 1e-9 { i } else { k });
        SymmetryAxis {
            point: self.centroid,
            direction: if direction[largest] < 0.0 {
                -direction
            } else {
                direction
            },
            order,
        }
    }

    /// How often a turn about `direction` brings the part onto itself; `None` if never.
    fn order(&self, direction: DVec3) -> Option<SymmetryOrder> {
        if self.is_round(direction) {
            return Some(SymmetryOrder::Continuous);
        }
        (2..=MAX_ORDER)
            .rev()
            .find(|&n| self.has_order(direction, n))
            .map(SymmetryOrder::Finite)
    }

    /// True if turns about `direction` by any angle are symmetries.
    fn is_round(&self, direction: DVec3) -> bool {
        // No turn of a low order is near these angles, so that only round parts pass.
        [0.618, 1.0, 1.414, 2.236, 3.0]
            .iter()
            .all(|&angle| self.maps_onto_itself(direction, angle))
    }

    /// True if all multiples of the turn of order `n` are symmetries: the turn alone may just be
    /// too small to leave the tolerance.
    fn has_order(&self, direction: DVec3, n: u32) -> bool {
        let maps = |k: u32| {
            let angle = 2.0 * PI * f64::from(k) / f64::from(n);
            self.maps_onto_itself(direction, angle)
        };
        // A multiple far from the turns of low order tells soonest.
        maps((0.382 * f64::from(n)).ceil() as u32) && (1..=n / 2).all(maps)
    }

    fn maps_onto_itself(&self, direction: DVec3, angle: f64) -> bool {
        let turn = DQuat::from_axis_angle(direction, angle);
        self.samples
            .offsets
            .iter()
            .all(|&q| self.bvh.nearest(self.centroid + turn * q).distance <= self.tolerance)
    }
}
