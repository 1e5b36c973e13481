//! Acceptance test of the tree code: which clusters are far enough for their expansion; and the
//! expansion itself at the points of a packet.

use fearless_simd::prelude::*;
use fearless_simd::{f32x8, f32x16, mask32x16};
use glam::Vec3;

use super::accuracy::{AcceptanceLimit, Accuracy};
use super::points::{Lanes, Packet};
use super::tree::{
    CUBIC, Cluster, Members, NORMAL_MOMENT, PacketTree, Query, TERMS, TRACE, VECTOR, WideNode,
};

/// Limits beyond which clusters are far.
pub(crate) struct Limits<'a> {
    /// Of those whose normals spread little.
    open: &'a AcceptanceLimit,
    /// Of the others, in which front and back may cancel unseen.
    folded: &'a AcceptanceLimit,
}

/// The sine of the angle between a cluster's normals and their mean from which on it is folded.
const FOLDED: f32 = 0.7;

impl<'a> Limits<'a> {
    /// Limits where clusters cancel, or do not.
    pub(crate) fn new(accuracy: &'a Accuracy, cancelled: bool) -> Self {
        let Accuracy {
            far,
            far_cancelling,
            ..
        } = accuracy;
        Self {
            open: if cancelled { far_cancelling } else { far },
            folded: far_cancelling,
        }
    }

    pub(crate) fn limit_for(&self, cluster: &Cluster) -> &AcceptanceLimit {
        if cluster.spread < FOLDED {
            self.open
        } else {
            self.folded
        }
    }
}

/// Test of a packet's bounding box against wide nodes: which members may be far, or are out of
/// reach.
pub(crate) struct AcceptanceTest {
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
    /// [`AcceptanceLimit`] of open and of folded clusters.
    size: [f32; 2],
    front: [f32; 2],
    bend: [f32; 2],
}

impl AcceptanceTest {
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

    /// Which members of a wide node are within reach of the box of points, and of which
    /// [`FarFieldView::is_far`] is likely, by the same rule for the packet as a whole. Saves
    /// most of the tests that fail. And the sines between the members' axes and the line from the
    /// packet's centre.
    #[inline(always)]
    pub(crate) fn evaluate<S: Simd>(&self, simd: S, wide_node: &WideNode) -> ([u32; 2], Members) {
        let load = |members: &Members| f32x8::simd_from(simd, *members);
        let splat = |value: f32| f32x8::splat(simd, value);
        let zero = splat(0.0);
        let (mut gap_squared, mut eta_squared, mut along) = (zero, zero, zero);
        for k in 0..3 {
            let low = load(&wide_node.min[k]) - (self.centre[k] + self.box_half[k]);
            let high = splat(self.centre[k] - self.box_half[k]) - load(&wide_node.max[k]);
            let gap = low.max(high).max(zero);
            gap_squared = gap.mul_add(gap, gap_squared);
            let from = splat(self.centre[k]) - load(&wide_node.centre[k]);
            eta_squared = from.mul_add(from, eta_squared);
            along = from.mul_add(load(&wide_node.axis[k]), along);
        }
        // Members within reach of the box.
        let reached = gap_squared.simd_lt(splat(self.farthest));
        let (radius, spread) = (load(&wide_node.radius), load(&wide_node.spread));
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

/// The terms of one cluster for all points, or of one cluster per point.
pub(crate) trait Terms<S: Simd> {
    fn get(&self, simd: S, term: usize) -> f32x16<S>;
}

impl<S: Simd> Terms<S> for [f32; TERMS] {
    #[inline(always)]
    fn get(&self, simd: S, term: usize) -> f32x16<S> {
        f32x16::splat(simd, self[term])
    }
}

impl<S: Simd> Terms<S> for [Lanes; TERMS] {
    #[inline(always)]
    fn get(&self, simd: S, term: usize) -> f32x16<S> {
        f32x16::simd_from(simd, self[term])
    }
}

/// Tangents to the root in [`FarFieldView::is_far`] touch it at the square of this or more: at zero
/// they are vertical.
const LEAST_SINE: f32 = 0.1;

/// A cluster relative to the points of a packet, in units of their distances.
pub(crate) struct FarFieldView<S: Simd> {
    /// `r = (p - c) / xi`.
    r: [f32x16<S>; 3],
    /// `|r|`.
    u: f32x16<S>,
    inverse_u: f32x16<S>,
    /// `1 / (1 + u^2)`.
    w: f32x16<S>,
}

impl<S: Simd> FarFieldView<S> {
    #[inline(always)]
    pub(crate) fn new(packet: &Packet<S>, query: &Query<S>, cluster: &Cluster) -> Self {
        let from = (cluster.centre - packet.centre).as_vec3();
        Self::from_ratio([
            (packet.x - from.x) * query.inverse,
            (packet.y - from.y) * query.inverse,
            (packet.z - from.z) * query.inverse,
        ])
    }

    /// From `r`.
    #[inline(always)]
    pub(crate) fn from_ratio(r: [f32x16<S>; 3]) -> Self {
        let squared = r[0].mul_add(r[0], r[1].mul_add(r[1], r[2] * r[2]));
        let u = squared.max(1e-30).sqrt();
        // One division for two.
        let more = squared + 1.0;
        let both = 1.0 / (u * more);
        Self {
            r,
            u,
            inverse_u: both * more,
            w: both * u,
        }
    }

    #[inline(always)]
    fn dot(&self, v: Vec3) -> f32x16<S> {
        let z = self.r[2] * v.z;
        self.r[0].mul_add(v.x, self.r[1].mul_add(v.y, z))
    }

    /// Whether the second-order expansion is good enough for every point within reach: the spread
    /// of `u` over the cluster, in kernel widths, must be small; less so in the kernel's tail.
    #[inline(always)]
    pub(crate) fn is_far(
        &self,
        tree: &PacketTree<'_>,
        cluster: &Cluster,
        (axis, sine): (Vec3, f32),
        query: &Query<S>,
        far: &AcceptanceLimit,
    ) -> bool {
        let inverse_sigma = 1.0 / tree.kernel.sigma;
        let zero = f32x16::splat(self.u.token(), 0.0);
        let angular = query.inverse * self.inverse_u * cluster.radius;
        let cosine = self.dot(axis) * self.inverse_u;
        // A root lies below its tangents, of which the packet's centre names a close one.
        let sine = sine.max(LEAST_SINE);
        let tilt = cosine * cosine * (-0.5 / sine) + (0.5 / sine + 0.5 * sine + cluster.spread);
        let tilt = (tilt + angular * 0.5).min(1.0);
        let extent = tilt * query.inverse * cluster.radius;
        let x = ((self.u - extent - 1.0) * inverse_sigma).max(zero);
        let x2 = x * x;
        let tail = x2.mul_add(x2 * 0.014 + 0.17, f32x16::splat(self.u.token(), 1.0));
        // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
        let inverse_width = (inverse_sigma * inverse_sigma + 25.0).sqrt();
        let front = angular * query.inverse * (cluster.radius * far.front as f32);
        let size = (extent + front) * inverse_width;
        let small = size.simd_lt(tail * far.size as f32);
        let straight = (size * angular * cluster.spread).simd_lt(tail * far.bend as f32);
        let counts = x.simd_lt(tree.kernel.reach) & query.counts;
        !(counts & !(small & straight)).any_true()
    }

    /// Adds the cluster's second-order expansion ([`crate::surface::moments::Moments::far_field`]),
    /// and its size to `magnitude`.
    #[inline(always)]
    pub(crate) fn add(
        &self,
        tree: &PacketTree<'_>,
        terms: &impl Terms<S>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
        magnitude: &mut f32x16<S>,
    ) {
        // Lanes within reach.
        let distance = (self.u - 1.0) * (1.0 / tree.kernel.sigma);
        let counts: mask32x16<S> = distance.simd_lt(tree.kernel.reach) & query.counts;
        if !counts.any_true() {
            return;
        }
        let simd = self.u.token();
        // Contractions of the moments with powers of `r`.
        let [x, y, z] = self.r;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (xy, xz, yz) = (x * y, x * z, y * z);
        let scale = query.inverse * query.inverse;
        let sum_of = |first: usize, powers: &[f32x16<S>]| {
            let start = powers[0] * terms.get(simd, first);
            let add = |sum: f32x16<S>, (k, power): (usize, &f32x16<S>)| {
                power.mul_add(terms.get(simd, first + 1 + k), sum)
            };
            powers[1..].iter().enumerate().fold(start, add)
        };
        let tilt = sum_of(NORMAL_MOMENT, &[xx, yy, zz, xy, xz, yz]);
        let with_x = sum_of(CUBIC, &[xx, xy, xz, yy, yz, zz]);
        let with_y = sum_of(CUBIC + 6, &[yy, yz, zz]);
        let with_z = z * zz * terms.get(simd, CUBIC + 9);
        let cubic = x.mul_add(with_x, y.mul_add(with_y, with_z));
        let flat = sum_of(0, &self.r) - query.inverse * terms.get(simd, TRACE);
        let first = sum_of(VECTOR, &self.r) * scale - tilt * query.inverse;
        let bow = cubic * scale * (self.inverse_u * self.inverse_u * 0.5);
        // Times derivatives of the radial kernel.
        let zero = f32x16::splat(simd, 0.0);
        let view = [distance, self.u, self.inverse_u, self.w];
        let values = tree.kernel.expansion(view, [flat, first, bow]);
        for k in 0..2 {
            let value = counts.select(values[k] * scale, zero);
            sum[k] += value;
            *magnitude += value.abs();
        }
    }
}
