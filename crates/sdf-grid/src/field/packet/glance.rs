//! Which clusters are far, at a glance.

use fearless_simd::{f32x8, prelude::*};
use glam::Vec3;

use super::cluster::Cluster;
use super::groups::{Group, Members};
use super::points::Packet;
use super::query::Query;
use super::settings::{Far, Settings};
use super::tree::PacketTree;

/// Limits beyond which clusters are far.
pub(crate) struct Limits<'a> {
    /// Of those whose normals spread little.
    open: &'a Far,
    /// Of the others, in which front and back may cancel unseen.
    folded: &'a Far,
}

/// The sine of the angle between a cluster's normals and their mean from which on it is folded.
const FOLDED: f32 = 0.7;

impl<'a> Limits<'a> {
    /// Where clusters cancel, or perhaps do not.
    pub(crate) fn new(settings: &'a Settings, cancelled: bool) -> Self {
        let Settings {
            far,
            far_cancelling,
            ..
        } = settings;
        Self {
            open: if cancelled { far_cancelling } else { far },
            folded: far_cancelling,
        }
    }

    pub(crate) fn of(&self, cluster: &Cluster) -> &Far {
        if cluster.spread < FOLDED {
            self.open
        } else {
            self.folded
        }
    }
}

/// What tells whether a cluster may be far from a packet, or out of reach, without a look at its
/// points.
pub(crate) struct Glance {
    centre: Vec3,
    /// Half the size of the points' box, and half its diagonal.
    box_half: Vec3,
    half: f32,
    /// The square of the largest distance within which boundary points count.
    farthest: f32,
    /// Least and mean distance from the boundary.
    least: f32,
    inverse_mean: f32,
    inverse_sigma: f32,
    /// One over the length, in distances, over which the kernel varies.
    inverse_width: f32,
    /// [`Far`] of open and of folded clusters.
    size: [f32; 2],
    front: [f32; 2],
    bend: [f32; 2],
}

impl Glance {
    #[inline(always)]
    pub(crate) fn new<S: Simd>(
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        limits: &Limits<'_>,
    ) -> Self {
        let least = query
            .counts
            .select(query.xi, packet.splat(f32::INFINITY))
            .reduce_min();
        let most = query.xi.reduce_max();
        let inverse_sigma = 1.0 / tree.kernel.sigma;
        Self {
            centre: packet.centre.as_vec3(),
            box_half: packet.half + 2.5e-7,
            half: packet.half.length(),
            farthest: query.reach_squared.reduce_max(),
            least,
            inverse_mean: 2.0 / (least + most),
            inverse_sigma,
            // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
            inverse_width: (inverse_sigma * inverse_sigma + 25.0).sqrt(),
            size: [limits.open, limits.folded].map(|far| far.size as f32),
            front: [limits.open, limits.folded].map(|far| far.front as f32),
            bend: [limits.open, limits.folded].map(|far| far.bend as f32),
        }
    }

    /// Which members of a group are within reach of the box of points, and of which
    /// [`super::seen::Seen::is_far`] is likely, by the same rule for the packet as a whole. Saves
    /// most of the tests that fail. And the sines between the members' axes and the line from the
    /// packet's centre.
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&self, simd: S, group: &Group) -> ([u32; 2], Members) {
        let load = |members: &Members| f32x8::simd_from(simd, *members);
        let splat = |value: f32| f32x8::splat(simd, value);
        let zero = splat(0.0);
        let (mut gap_squared, mut eta_squared, mut along) = (zero, zero, zero);
        for k in 0..3 {
            let low = load(&group.min[k]) - (self.centre[k] + self.box_half[k]);
            let high = splat(self.centre[k] - self.box_half[k]) - load(&group.max[k]);
            let gap = low.max(high).max(zero);
            gap_squared = gap.mul_add(gap, gap_squared);
            let from = splat(self.centre[k]) - load(&group.centre[k]);
            eta_squared = from.mul_add(from, eta_squared);
            along = from.mul_add(load(&group.axis[k]), along);
        }
        let reached = gap_squared.simd_lt(splat(self.farthest));
        let (radius, spread) = (load(&group.radius), load(&group.spread));
        let eta = eta_squared.sqrt();
        let nearest = (eta - self.half).max(splat(self.least));
        // One division for two.
        let both = 1.0 / (eta * nearest);
        let angular = radius * eta * both;
        let cosine = along * nearest * both;
        let sine = (splat(1.0) - cosine * cosine).max(zero).sqrt();
        let tilt = angular.mul_add(splat(0.5), sine + spread).min(splat(1.0));
        let extent = tilt * radius * (1.0 / self.least);
        let x = ((eta * self.inverse_mean - extent - 1.0) * self.inverse_sigma).max(zero);
        let x2 = x * x;
        let tail = x2.mul_add(x2.mul_add(splat(0.014), splat(0.17)), splat(1.0));
        let open = spread.simd_lt(splat(FOLDED));
        let limit = |[a, b]: [f32; 2]| open.select(splat(a), splat(b));
        let front = angular * radius * (limit(self.front) * (1.0 / self.least));
        let size = (extent + front) * self.inverse_width;
        let bent = size * angular * spread;
        let far = size.simd_lt(tail * limit(self.size)) & bent.simd_lt(tail * limit(self.bend));
        let masks = [reached, far].map(|mask| mask.to_bitmask() as u32);
        (masks, sine.into())
    }
}
