//! Nearest distance of a packet.

use fearless_simd::{Level, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::Vec3;
use rayon::prelude::*;

use super::facet::{Facet, Hull, View};
use super::lanes::Lanes;
use super::points::{Packet, Points};
use crate::dispatch_lanes;
use crate::support::prefetch::fetch_value;
use crate::support::{large, level};
use crate::surface::bvh::build::Stack;
use crate::surface::bvh::tree::Bvh;

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
            level: level::native(),
        }
    }

    pub(super) fn facet(&self, index: usize) -> &Facet {
        &self.facets[index]
    }

    /// Asks for what the search looks at below a node, ahead of its use.
    #[inline(always)]
    fn ask_below(&self, id: u32, hull: &Hull) {
        if hull.is_leaf() {
            for i in hull.range() {
                fetch_value(&self.facets[i]);
            }
            return;
        }
        for child in [id + 1, hull.second] {
            fetch_value(&self.hulls[child as usize]);
        }
    }

    /// Distances of `points` from the boundary. `hint` is a leaf-order face to look at first,
    /// replaced by the nearest one found: it changes the time, not the result.
    pub(crate) fn at(&self, points: &Points, hint: &mut usize) -> Lanes {
        dispatch_lanes!(self.level, simd => distances(simd, self, points, hint))
    }
}

/// See [`PacketDistance::at`].
#[simd]
fn distances<S: Simd>(
    simd: S,
    distance: &PacketDistance<'_>,
    points: &Points,
    hint: &mut usize,
) -> Lanes {
    let packet = Packet::new(simd, points);
    let mut best = squared(distance, &packet, *hint);
    let mut worst = best.reduce_max();
    let mut closest = best.reduce_min();
    // How often something nearer was looked for.
    let mut looks = 0;
    let mut stack = Stack::new();
    stack.push(Waiting::default());
    while let Some(Waiting { id, gap, since }) = stack.pop() {
        let hull = &distance.hulls[id as usize];
        if gap >= worst {
            continue;
        }
        if since != looks && !hull.disc.is_thick() && !hull.disc.may_be_nearer(&packet, best) {
            continue;
        }
        if hull.is_leaf() {
            for i in hull.range() {
                if !distance.facets[i].disc.may_be_nearer(&packet, best) {
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
            looks += 1;
            continue;
        }
        let first = (id + 1, gaps(distance, &packet, id + 1, best, worst));
        let second = (
            hull.second,
            gaps(distance, &packet, hull.second, best, worst),
        );
        // Gaps of neighbouring boxes are often both zero: order by distance from the centre.
        let order = if first.1[1] <= second.1[1] {
            [second, first]
        } else {
            [first, second]
        };
        for (id, [gap, _]) in order {
            if gap < worst {
                let since = looks;
                stack.push(Waiting { id, gap, since });
            }
        }
    }
    best.sqrt().into()
}

/// A node to look at.
#[derive(Clone, Copy, Default)]
struct Waiting {
    id: u32,
    /// Squared distance between the boxes, zero if it was not asked for.
    gap: f32,
    /// When it was found.
    since: u32,
}

/// Squared distance of a node's box from the packet's (zero of those whose disc tells more),
/// infinite if none of the points may be nearer to what is in it than `best` (`worst` of them); and
/// from the packet's centre.
#[inline(always)]
fn gaps<S: Simd>(
    distance: &PacketDistance<'_>,
    packet: &Packet<S>,
    id: u32,
    best: f32x16<S>,
    worst: f32,
) -> [f32; 2] {
    let hull = &distance.hulls[id as usize];
    if !hull.disc.is_thick() {
        if !hull.disc.may_be_nearer(packet, best) {
            return [f32::INFINITY; 2];
        }
        distance.ask_below(id, hull);
        let from_centre = (hull.disc.centre - packet.centre).as_vec3();
        return [0.0, from_centre.length_squared()];
    }
    let bounds = &distance.bvh.nodes[id as usize].bounds;
    let low = (bounds.min - packet.centre).as_vec3();
    let high = (bounds.max - packet.centre).as_vec3();
    let outside = low.max(-high);
    let mut gap = (outside - packet.half).max(Vec3::ZERO).length_squared();
    let from_centre = outside.max(Vec3::ZERO).length_squared();
    if gap < worst {
        let squared = packet.box_distance_squared([low, high]);
        if squared.simd_lt(best).any_true() {
            distance.ask_below(id, hull);
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
