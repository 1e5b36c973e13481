//! The tree code on packets of sixteen points, in single precision through SIMD.
//!
//! Positions are normalized ([`Bvh::normalized`]). Everything is taken relative to the packet's
//! centre, subtracted in f64, so that single precision resolves lengths relative to the packet,
//! not to the part. Instruction sets are chosen at run time.

mod alone;
mod edge;
mod far;
mod groups;
mod kernel;
mod near;
mod nearest;
mod packet;
mod settings;
#[cfg(test)]
mod tests;
mod twins;

use fearless_simd::{Level, dispatch};
use glam::DVec3;
use rayon::prelude::*;

use self::far::Cluster;
pub(crate) use self::far::Walk;
use self::groups::{Group, WIDTH};
use self::kernel::PacketKernel;
pub(crate) use self::packet::Points;
use self::packet::{Facet, Hull};
use self::settings::Settings;
use self::twins::Twin;
use crate::bvh::Bvh;
use crate::kernel::CumulativeKernel;
use crate::large::{self, prefetch};

/// Points per packet. Fastest on compact groups such as 2 x 2 x 4 neighbours.
pub(crate) const LANES: usize = 16;

/// One number per point.
pub(crate) type Lanes = [f32; LANES];

/// Distances of packets.
pub(crate) struct PacketDistance<'a> {
    bvh: &'a Bvh,
    facets: Vec<Facet>,
    hulls: Vec<Hull>,
    level: Level,
}

impl<'a> PacketDistance<'a> {
    pub(crate) fn new(bvh: &'a Bvh) -> Self {
        Self {
            bvh,
            facets: large::collect(bvh.faces.par_iter().map(Facet::new)),
            hulls: large::collect(bvh.nodes.par_iter().map(Hull::new)),
            level: Level::new(),
        }
    }

    fn facet(&self, index: usize) -> &Facet {
        &self.facets[index]
    }

    /// Asks for what the search looks at below a node, ahead of its use.
    #[inline(always)]
    fn ask_below(&self, id: u32, hull: &Hull) {
        if hull.is_leaf() {
            for i in hull.range() {
                prefetch(&self.facets[i]);
            }
            return;
        }
        for child in [id + 1, hull.second] {
            prefetch(&self.hulls[child as usize]);
        }
    }

    /// Distances of `points` from the boundary. `hint` is a leaf-order face to look at first,
    /// replaced by the nearest one found: it changes the time, not the result.
    pub(crate) fn at(&self, points: &Points, hint: &mut usize) -> Lanes {
        dispatch!(self.level, simd => nearest::distances(simd, self, points, hint))
    }
}

/// Distances and density integrals of packets.
pub(crate) struct PacketDensity<'a> {
    bvh: &'a Bvh,
    distance: PacketDistance<'a>,
    groups: Vec<Group>,
    /// Far fields of the members of every group.
    clusters: Vec<[Cluster; WIDTH]>,
    twins: Vec<[Twin; 4]>,
    kernel: PacketKernel,
    settings: Settings,
    /// Whether all this is more than the nearest caches hold.
    is_large: bool,
    level: Level,
}

/// Faces of which, and of whose tree, the nearest caches hold no more: about two megabytes.
const MANY: usize = 3000;

impl<'a> PacketDensity<'a> {
    /// Prepares for a relative L2 error of `tolerance`.
    pub(crate) fn new(bvh: &'a Bvh, table: &CumulativeKernel, tolerance: f64) -> Self {
        let settings = Settings::new(tolerance, table.kernel().sigma());
        let near = || (twins::twins(&bvh.faces), PacketDistance::new(bvh));
        // Side by side: both have parts that one thread does.
        let far = || groups::groups(bvh);
        let ((groups, clusters), (twins, distance)) = rayon::join(far, near);
        Self {
            bvh,
            distance,
            clusters,
            groups,
            twins,
            kernel: PacketKernel::new(table, &settings, tolerance),
            settings,
            is_large: bvh.faces.len() > MANY,
            level: Level::new(),
        }
    }

    /// Largest distance of a corner of a face (leaf order) from its centroid.
    pub(crate) fn size_of_face(&self, index: usize) -> f32 {
        self.distance.facets[index].disc.radius
    }

    /// In units of the faces near, the distance up to which few of them are in far clusters: less of the surface
    /// is far at smaller tolerances.
    pub(crate) fn fine(&self) -> f32 {
        (15.0 / self.settings.far.size) as f32
    }

    /// See [`PacketDistance::at`].
    pub(crate) fn distances(&self, points: &Points, hint: &mut usize) -> Lanes {
        self.distance.at(points, hint)
    }

    /// Real and imaginary part of the integral of the unit kernel over the solid angle, at points
    /// with these distances. Points of distance zero are left out (zero).
    pub(crate) fn integrals(
        &self,
        points: &Points,
        distances: &Lanes,
        walk: &mut Walk,
    ) -> [Lanes; 2] {
        dispatch!(self.level, simd => far::integrals(simd, self, points, distances, walk))
    }

    /// The same at one point whose distance is not zero: where faces are so small that neighbouring points have
    /// hardly any clusters in common.
    pub(crate) fn integral(&self, point: DVec3, distance: f32, walk: &mut Walk) -> [f32; 2] {
        dispatch!(self.level, simd => alone::integral(simd, self, point, distance, walk))
    }
}
