//! Far clusters as the points of a packet see them.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::Vec3;

use super::cluster::{CUBIC, Cluster, NORMAL_MOMENT, TERMS, TRACE, VECTOR};
use super::lanes::Lanes;
use super::points::Packet;
use super::query::Query;
use super::settings::Far;
use super::tree::PacketTree;

/// The terms of one cluster that all points see, or of one for each.
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

/// Tangents to the root in [`Seen::is_far`] touch it at the square of this or more: at zero they
/// are vertical.
const LEAST_SINE: f32 = 0.1;

/// A cluster as the points of a packet see it, in units of their distances.
pub(crate) struct Seen<S: Simd> {
    /// `r = (p - c) / xi`.
    r: [f32x16<S>; 3],
    /// `|r|`.
    u: f32x16<S>,
    inverse_u: f32x16<S>,
    /// `1 / (1 + u^2)`.
    w: f32x16<S>,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    pub(crate) fn new(packet: &Packet<S>, query: &Query<S>, cluster: &Cluster) -> Self {
        let from = (cluster.centre - packet.centre).as_vec3();
        Self::at([
            (packet.x - from.x) * query.inverse,
            (packet.y - from.y) * query.inverse,
            (packet.z - from.z) * query.inverse,
        ])
    }

    /// From `r`.
    #[inline(always)]
    pub(crate) fn at(r: [f32x16<S>; 3]) -> Self {
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
        far: &Far,
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
        let distance = (self.u - 1.0) * (1.0 / tree.kernel.sigma);
        let counts: mask32x16<S> = distance.simd_lt(tree.kernel.reach) & query.counts;
        if !counts.any_true() {
            return;
        }
        let simd = self.u.token();
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
        let zero = f32x16::splat(simd, 0.0);
        let seen = [distance, self.u, self.inverse_u, self.w];
        let values = tree.kernel.expansion(seen, [flat, first, bow]);
        for k in 0..2 {
            let value = counts.select(values[k] * scale, zero);
            sum[k] += value;
            *magnitude += value.abs();
        }
    }
}
