//! Distances and density integrals of packets.

use fearless_simd::Level;
use glam::DVec3;

use super::lanes::Lanes;
use super::points::Points;
use super::tree::PacketTree;
use super::walk::Walk;
use super::{alone, together};
use crate::dispatch_lanes;
use crate::field::kernel::CumulativeKernel;
use crate::support::level;
use crate::surface::bvh::tree::Bvh;

/// Distances and density integrals of packets.
pub(crate) struct PacketDensity<'a> {
    tree: PacketTree<'a>,
    pub(super) level: Level,
}

impl<'a> PacketDensity<'a> {
    /// Prepares for a relative L2 error of `tolerance`.
    pub(crate) fn new(bvh: &'a Bvh, table: &CumulativeKernel, tolerance: f64) -> Self {
        Self {
            tree: PacketTree::new(bvh, table, tolerance),
            level: level::native(),
        }
    }

    /// Largest distance of a corner of a face (leaf order) from its centroid.
    pub(crate) fn size_of_face(&self, index: usize) -> f32 {
        self.tree.distance.facet(index).disc.radius
    }

    /// In units of the faces near, the distance up to which few of them are in far clusters: less
    /// of the surface is far at smaller tolerances.
    pub(crate) fn fine(&self) -> f32 {
        (15.0 / self.tree.settings.far.size) as f32
    }

    /// See [`PacketDistance::at`].
    pub(crate) fn distances(&self, points: &Points, hint: &mut usize) -> Lanes {
        self.tree.distance.at(points, hint)
    }

    /// Real and imaginary part of the integral of the unit kernel over the solid angle, at points
    /// with these distances. Points of distance zero are left out (zero).
    pub(crate) fn integrals(
        &self,
        points: &Points,
        distances: &Lanes,
        walk: &mut Walk,
    ) -> [Lanes; 2] {
        dispatch_lanes!(self.level, simd => together::integrals(simd, &self.tree, points, distances, walk))
    }

    /// The same at one point whose distance is not zero: where faces are so small that neighbouring
    /// points have hardly any clusters in common.
    pub(crate) fn integral(&self, point: DVec3, distance: f32, walk: &mut Walk) -> [f32; 2] {
        dispatch_lanes!(self.level, simd => alone::integral(simd, &self.tree, point, distance, walk))
    }
}
