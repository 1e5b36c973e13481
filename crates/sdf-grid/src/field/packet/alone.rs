//! The walk for one point that hardly any face or cluster has in common with its neighbours: sixteen clusters at a
//! time, instead of one cluster for sixteen points.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};

use super::far::{CANCELLING, Cluster, Glance, Limits, Seen, TERMS, Walk, ask_for};
use super::groups::Below;
use super::near::Query;
use super::packet::Packet;
use super::{LANES, Lanes, PacketDensity};

/// Clusters waiting to be added for one point. Reused from point to point.
#[derive(Debug, Default)]
#[repr(align(64))]
pub(crate) struct FarClusters {
    /// The point from their centres.
    from: [Lanes; 3],
    terms: [Lanes; TERMS],
    len: usize,
}

impl FarClusters {
    #[inline(always)]
    fn push(&mut self, point: DVec3, cluster: &Cluster) {
        // One check for all.
        let place = self.len % LANES;
        let from: Vec3 = (point - cluster.centre).as_vec3();
        for k in 0..3 {
            self.from[k][place] = from[k];
        }
        for k in 0..TERMS {
            self.terms[k][place] = cluster.terms[k];
        }
        self.len += 1;
    }

    /// Adds those that wait.
    #[inline(always)]
    fn add_to<S: Simd>(
        &mut self,
        density: &PacketDensity<'_>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
        magnitude: &mut f32x16<S>,
    ) {
        // In places where none waits it is out of reach.
        for k in 0..3 {
            self.from[k][self.len..].fill(1e9);
        }
        self.len = 0;
        let simd = query.xi.token();
        let mut r = [query.inverse; 3];
        for (r, from) in r.iter_mut().zip(self.from) {
            *r *= f32x16::simd_from(simd, from);
        }
        Seen::at(r).add(density, &self.terms, query, sum, magnitude);
    }
}

/// See [`PacketDensity::integral`].
#[simd]
pub(crate) fn integral<S: Simd>(
    simd: S,
    density: &PacketDensity<'_>,
    point: DVec3,
    distance: f32,
    walk: &mut Walk,
) -> [f32; 2] {
    let packet = Packet::of_one(simd, point);
    let query = Query::new(density, packet.splat(distance));
    let limits = |cancelled| Limits::new(&density.settings, cancelled);
    let first = walk.cancelled;
    let (mut sum, mut cancelled) = accumulate(density, &packet, &query, &limits(first), walk);
    if cancelled && !first {
        (sum, cancelled) = accumulate(density, &packet, &query, &limits(true), walk);
    }
    walk.cancelled = cancelled;
    sum
}

/// The sum over clusters that are far and near faces, and whether clusters cancel. For one point a
/// glance tells which clusters are far.
#[inline(always)]
fn accumulate<S: Simd>(
    density: &PacketDensity<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    walk: &mut Walk,
) -> ([f32; 2], bool) {
    let glance = Glance::new(density, packet, query, limits);
    let zero = packet.splat(0.0);
    let (mut far, mut magnitude, mut near) = ([zero; 2], zero, [zero; 2]);
    walk.near.prepare(density.bvh.faces.len());
    walk.waiting.clear();
    walk.waiting.push(0);
    while let Some(id) = walk.waiting.pop() {
        let group = &density.groups[id as usize];
        let clusters = &density.clusters[id as usize];
        let ([reached, is_far], _) = glance.at(packet.simd, group);
        if density.is_large {
            ask_for(density, group, clusters, reached, is_far);
        }
        let mut members = group.top & reached;
        while members != 0 {
            let place = members.trailing_zeros() as usize;
            members &= members - 1;
            if is_far >> place & 1 == 1 {
                walk.far.push(packet.centre, &clusters[place]);
                if walk.far.len == LANES {
                    walk.far.add_to(density, query, &mut far, &mut magnitude);
                }
                continue;
            }
            match group.below[place] {
                Below::Face(face) => {
                    let faces = &mut walk.near;
                    faces.add(density, packet, query, face as usize, &mut near);
                }
                Below::Members(below) => members |= below & reached,
                Below::Group(below) => walk.waiting.push(below),
            }
        }
    }
    walk.far.add_to(density, query, &mut far, &mut magnitude);
    walk.near.add_waiting(density, packet, query, &mut near);
    // Every lane has the faces, each its clusters.
    let sum = [
        far[0].reduce_sum() + near[0][0],
        far[1].reduce_sum() + near[1][0],
    ];
    let total = sum[0].abs() + sum[1].abs();
    (sum, magnitude.reduce_sum() > CANCELLING * total)
}
