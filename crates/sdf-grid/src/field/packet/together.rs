//! The integral at sixteen points: one cluster at a time for all of them.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;

use super::glance::Limits;
use super::lanes::Lanes;
use super::points::{Packet, Points};
use super::query::Query;
use super::seen::Seen;
use super::tree::PacketTree;
use super::walk::{CANCELLING, Met, Sums, Walk};

/// See [`super::density::PacketDensity::integrals`].
#[simd]
pub(crate) fn integrals<S: Simd>(
    simd: S,
    tree: &PacketTree<'_>,
    points: &Points,
    distances: &Lanes,
    walk: &mut Walk,
) -> [Lanes; 2] {
    let packet = Packet::new(simd, points);
    let query = Query::new(tree, f32x16::simd_from(simd, *distances));
    let limits = |cancelled| Limits::new(&tree.settings, cancelled);
    let first = walk.cancelled;
    let (mut sum, mut cancelled) = accumulate(tree, &packet, &query, &limits(first), walk);
    if cancelled && !first {
        (sum, cancelled) = accumulate(tree, &packet, &query, &limits(true), walk);
    }
    // Neighbours are alike: mostly saves the first of two attempts.
    walk.cancelled = cancelled;
    let zero = packet.splat(0.0);
    // Lanes to leave out hold numbers without meaning.
    sum.map(|s| query.counts.select(s, zero).into())
}

/// The sum over clusters that are far and near faces, and whether clusters cancel.
#[inline(always)]
fn accumulate<S: Simd>(
    tree: &PacketTree<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    walk: &mut Walk,
) -> ([f32x16<S>; 2], bool) {
    let zero = packet.splat(0.0);
    let mut sums = Together {
        limits,
        sum: [zero; 2],
        magnitude: zero,
    };
    walk.path.walk(tree, packet, query, limits, &mut sums);
    let Together { sum, magnitude, .. } = sums;
    let total = sum[0].abs() + sum[1].abs();
    let cancels = magnitude.simd_gt(total * CANCELLING) & query.counts;
    (sum, cancels.any_true())
}

/// The sums of sixteen points.
struct Together<'a, S: Simd> {
    limits: &'a Limits<'a>,
    /// Over clusters and faces.
    sum: [f32x16<S>; 2],
    /// Over the sizes of what clusters add.
    magnitude: f32x16<S>,
}

impl<S: Simd> Sums<S> for Together<'_, S> {
    #[inline(always)]
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        met: &Met<'_>,
    ) -> bool {
        let cluster = met.cluster;
        let seen = Seen::new(packet, query, cluster);
        let axis = (met.group.axis_of(met.place), met.sine);
        let is_far = seen.is_far(tree, cluster, axis, query, self.limits.of(cluster));
        if is_far {
            let (sum, magnitude) = (&mut self.sum, &mut self.magnitude);
            seen.add(tree, &cluster.terms, query, sum, magnitude);
        }
        is_far
    }

    #[inline(always)]
    fn near(&mut self) -> &mut [f32x16<S>; 2] {
        &mut self.sum
    }
}
