//! Nearest distance of a packet.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;

use super::packet::{Packet, View};
use super::{Lanes, PacketDistance, Points};
use crate::bvh::Stack;

/// See [`PacketDistance::at`].
#[simd]
pub(crate) fn distances<S: Simd>(
    simd: S,
    distance: &PacketDistance<'_>,
    points: &Points,
    hint: &mut usize,
) -> Lanes {
    let packet = Packet::new(simd, points);
    let mut best = squared(distance, &packet, *hint);
    let mut worst = best.reduce_max();
    let mut closest = best.reduce_min();
    let mut stack = Stack::new();
    stack.push((0u32, 0f32));
    while let Some((id, gap)) = stack.pop() {
        if gap >= worst {
            continue;
        }
        let node = &distance.bvh.nodes[id as usize];
        if node.is_leaf() {
            for i in node.range() {
                if !packet.disc_may_be_nearer(&distance.facets[i].disc, best) {
                    continue;
                }
                let found = squared(distance, &packet, i);
                best = best.min(found);
                let least = found.reduce_min();
                if least < closest {
                    (closest, *hint) = (least, i);
                }
            }
            worst = best.reduce_max();
            continue;
        }
        let first = (id + 1, gaps(distance, &packet, id + 1, best, worst));
        let second = (
            node.second,
            gaps(distance, &packet, node.second, best, worst),
        );
        // Gaps of neighbouring boxes are often both zero: order by distance from the centre.
        let order = if first.1[1] <= second.1[1] {
            [second, first]
        } else {
            [first, second]
        };
        for (id, [gap, _]) in order {
            if gap < worst {
                stack.push((id, gap));
            }
        }
    }
    best.sqrt().into()
}

/// Squared distance of a node's box from the packet's, infinite if none of the points may be nearer to what is in
/// it than `best` (`worst` of them); and from the packet's centre.
#[inline(always)]
fn gaps<S: Simd>(
    distance: &PacketDistance<'_>,
    packet: &Packet<S>,
    id: u32,
    best: f32x16<S>,
    worst: f32,
) -> [f32; 2] {
    let node = &distance.bvh.nodes[id as usize];
    let disc = &distance.discs[id as usize];
    let [low, high] = packet.ends(node);
    let outside = low.max(-high);
    let mut gap = (outside - packet.half).max(Vec3::ZERO).length_squared();
    let from_centre = outside.max(Vec3::ZERO).length_squared();
    if gap < worst {
        if packet.may_be_nearer([low, high], disc, best) {
            distance.ask_below(id, node);
        } else {
            gap = f32::INFINITY;
        }
    }
    [gap, from_centre]
}

/// Squared distances from a face.
#[inline(always)]
fn squared<S: Simd>(distance: &PacketDistance<'_>, packet: &Packet<S>, index: usize) -> f32x16<S> {
    let view = View::new(packet, &distance.bvh.faces[index], &distance.facets[index]);
    view.distance_squared(packet)
}
