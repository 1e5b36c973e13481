//! Where two parts may touch: at poses of a window, or in a box.

use glam::DVec3;
use sdf_grid::Aabb;

use crate::geometry::side::Side;

/// Poses whose displacement of the moving part's pivot lies in a box, in all rotations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseWindow {
    /// The pivot, metres, the moving part's frame.
    pub(crate) pivot: DVec3,
    /// Its displacements, metres.
    pub(crate) displacements: Aabb,
}

impl PoseWindow {
    /// Where a box of the other part gets to in one part's frame, metres.
    pub(crate) fn reached(&self, side: Side, other: &Aabb) -> Aabb {
        let places = [self.displacements.min, self.displacements.max].map(|d| self.pivot + d);
        let places = Aabb::around(places);
        let farthest = |from: &[DVec3]| {
            let corners = other.corners().into_iter();
            let distances = corners.flat_map(|c| from.iter().map(move |p| c.distance(*p)));
            distances.fold(0.0, f64::max)
        };
        match side {
            Side::Fixed => places.grown(farthest(&[self.pivot])),
            Side::Moving => Aabb::around([self.pivot]).grown(farthest(&places.corners())),
        }
    }
}

/// Where parts may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum ContactRegion {
    /// Wherever the parts touch.
    Everywhere,
    /// At poses at which the other part lies in a box of one part's frame, metres.
    Box(Side, Aabb),
    /// At the poses of a window.
    Window(PoseWindow),
}

impl ContactRegion {
    /// Where the other part, of these bounds in its own frame, may touch the surface of one part, in
    /// that one's frame, metres; none if anywhere.
    pub(crate) fn of(&self, side: Side, other: &Aabb) -> Option<Aabb> {
        match self {
            Self::Everywhere => None,
            // A box of one part says nothing about the other.
            Self::Box(part, region) => (*part == side).then_some(*region),
            Self::Window(window) => Some(window.reached(side, other)),
        }
    }
}
