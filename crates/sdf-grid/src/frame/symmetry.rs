//! Rotational symmetry axes of a part.
//!
//! Every axis passes through the centroid. Candidates come from two sources, each of which covers
//! what the other misses: the principal axes of inertia (all axes of a body with unequal moments,
//! the main axis of one that is tessellated unevenly), and the rotations that carry one pair of
//! far-out vertices to another (all axes of a body with equal moments, such as a cube). A candidate
//! counts if it carries sample points of the surface to within a tolerance of the surface.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};
use serde::Serialize;

use crate::frame::matching::{SurfaceSamples, vertex_rotations};
use crate::frame::principal_axes::principal_axes;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// The highest finite order that is tested.
const MAX_ORDER: u32 = 360;

/// How often a turn about an axis brings a part onto itself.
///
/// See the example of [`SymmetryAxis`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum SymmetryOrder {
    /// Every turn by a multiple of `2 pi / n` does, n = 2 .. 360, and none between.
    Finite(u32),
    /// Every turn does, within the tolerance.
    Continuous,
}

/// An axis about which a part can be turned onto itself.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{SymmetryOrder, shapes, symmetry};
///
/// // A square plate: four quarter turns about its normal.
/// let axes = symmetry::detect(&shapes::plate(0.02, 0.005)?, 1e-5);
/// assert_eq!(axes[0].order, SymmetryOrder::Finite(4));
/// assert!((axes[0].direction - DVec3::Z).length() < 1e-9);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SymmetryAxis {
    /// The part's centroid, metres.
    pub point: DVec3,
    /// Unit vector along the axis; as detected, its largest component is positive.
    pub direction: DVec3,
    /// How often a turn brings the part onto itself.
    pub order: SymmetryOrder,
}

impl SymmetryAxis {
    /// The axis of a part that is moved by `p -> rotation * p + translation`.
    #[must_use]
    pub fn moved(&self, rotation: DQuat, translation: DVec3) -> Self {
        Self {
            point: rotation * self.point + translation,
            direction: rotation * self.direction,
            order: self.order,
        }
    }
}

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
        samples: SurfaceSamples::new(mesh, centroid),
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
        for turn in part.turns(mesh) {
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
    samples: SurfaceSamples,
    centroid: DVec3,
    tolerance: f64,
}

impl Part {
    /// Turns that carry two vertices to two others.
    fn turns(&self, mesh: &TriangleMesh) -> Vec<Turn> {
        let own = (mesh, self.centroid);
        let rotations = vertex_rotations(own, own, self.tolerance);
        rotations.into_iter().filter_map(turn).collect()
    }

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
        // A multiple far from the turns of low order fails soonest.
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

/// A rotation that may be a symmetry.
struct Turn {
    /// Unit vector along the axis.
    axis: DVec3,
    /// Angle, radians.
    angle: f64,
}

/// Axis and angle of a rotation; `None` below the turn of the highest order that is tested.
fn turn(rotation: DQuat) -> Option<Turn> {
    let (axis, angle) = rotation.to_axis_angle();
    let angle = angle.min(2.0 * PI - angle);
    (angle > PI / f64::from(MAX_ORDER)).then_some(Turn { axis, angle })
}
