//! The integral at one point that hardly any face or cluster has in common with its neighbours:
//! sixteen clusters at a time, instead of one cluster for sixteen points.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::DVec3;

use super::glance::Limits;
use super::points::Packet;
use super::query::Query;
use super::tree::PacketTree;
use super::waiting::WaitingClusters;
use super::walk::{CANCELLING, Met, Sums, Walk};

/// See [`super::density::PacketDensity::integral`].
#[simd]
pub(crate) fn integral<S: Simd>(
    simd: S,
    tree: &PacketTree<'_>,
    point: DVec3,
    distance: f32,
    walk: &mut Walk,
) -> [f32; 2] {
    let packet = Packet::of_one(simd, point);
    let query = Query::new(tree, packet.splat(distance));
    let limits = |cancelled| Limits::new(&tree.settings, cancelled);
    let first = walk.cancelled;
    let (mut sum, mut cancelled) = accumulate(tree, &packet, &query, &limits(first), walk);
    if cancelled && !first {
        (sum, cancelled) = accumulate(tree, &packet, &query, &limits(true), walk);
    }
    walk.cancelled = cancelled;
    sum
}

/// The sum over clusters that are far and near faces, and whether clusters cancel.
#[inline(always)]
fn accumulate<S: Simd>(
    tree: &PacketTree<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    walk: &mut Walk,
) -> ([f32; 2], bool) {
    let zero = packet.splat(0.0);
    let mut sums = Alone {
        clusters: &mut walk.clusters,
        far: [zero; 2],
        magnitude: zero,
        near: [zero; 2],
    };
    walk.path.walk(tree, packet, query, limits, &mut sums);
    sums.add_waiting(tree, query);
    let Alone {
        far,
        magnitude,
        near,
        ..
    } = sums;
    // Every lane has the faces, each its clusters.
    let sum = [
        far[0].reduce_sum() + near[0][0],
        far[1].reduce_sum() + near[1][0],
    ];
    let total = sum[0].abs() + sum[1].abs();
    (sum, magnitude.reduce_sum() > CANCELLING * total)
}

/// The sums of one point.
struct Alone<'a, S: Simd> {
    clusters: &'a mut WaitingClusters,
    /// Over clusters, lane by lane.
    far: [f32x16<S>; 2],
    /// Over the sizes of what clusters add.
    magnitude: f32x16<S>,
    /// Over faces, the same in every lane.
    near: [f32x16<S>; 2],
}

impl<S: Simd> Alone<'_, S> {
    #[inline(always)]
    fn add_waiting(&mut self, tree: &PacketTree<'_>, query: &Query<S>) {
        let (far, magnitude) = (&mut self.far, &mut self.magnitude);
        self.clusters.add_to(tree, query, far, magnitude);
    }
}

impl<S: Simd> Sums<S> for Alone<'_, S> {
    /// For one point a glance tells which clusters are far.
    #[inline(always)]
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        met: &Met<'_>,
    ) -> bool {
        self.clusters.push(packet.centre, met.cluster);
        if self.clusters.is_full() {
            self.add_waiting(tree, query);
        }
        true
    }

    #[inline(always)]
    fn near(&mut self) -> &mut [f32x16<S>; 2] {
        &mut self.near
    }
}
