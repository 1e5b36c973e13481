//! Nearest distance of a packet.

use fearless_simd::prelude::*;
use fearless_simd_macros::simd;

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
    let faces = &distance.bvh.faces;
    let facets = &distance.facets;
    let first = View::new(&packet, &faces[*hint], &facets[*hint]);
    let mut best = first.distance_squared(&packet);
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
                if !packet.face_may_be_nearer(&distance.face_discs[i], best) {
                    continue;
                }
                let view = View::new(&packet, &faces[i], &facets[i]);
                let found = view.distance_squared(&packet);
                best = best.min(found);
                let least = found.reduce_min();
                if least < closest {
                    (closest, *hint) = (least, i);
                }
            }
            worst = best.reduce_max();
            continue;
        }
        let mut near = [(id + 1, 0f32, 0f32), (node.second, 0.0, 0.0)];
        for (id, gap, from_centre) in &mut near {
            let disc = &distance.discs[*id as usize];
            let child = &distance.bvh.nodes[*id as usize];
            *gap = packet.box_gap_squared(child);
            // Gaps of neighbouring boxes are often both zero: order by distance from the centre.
            *from_centre = child.distance_squared(packet.centre) as f32;
            if *gap >= worst {
                continue;
            }
            if packet.may_be_nearer(child, disc, best) {
                distance.ask_below(*id, child);
            } else {
                *gap = f32::INFINITY;
            }
        }
        let (first, second) = if near[0].2 <= near[1].2 {
            (near[0], near[1])
        } else {
            (near[1], near[0])
        };
        for child in [second, first] {
            if child.1 < worst {
                stack.push((child.0, child.1));
            }
        }
    }
    best.sqrt().into()
}
