//! Faces and nodes relative to a packet, and the nearest distance of its points.

use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x16};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::points::{Lanes, Packet, Points};
use crate::dispatch_lanes;
use crate::support::large;
use crate::support::level;
use crate::support::prefetch::fetch_value;
use crate::surface::bvh::build::{Node, Stack};
use crate::surface::bvh::tree::Bvh;
use crate::surface::face::Face;
use crate::surface::moments::Moments;

/// What searches see of a node, in one cache line; where its faces are nearly flat and oblique,
/// that is all.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
struct Hull {
    pub(crate) disc: Disc,
    /// As in [`Node`].
    pub(crate) second: u32,
    first: u32,
    count: u32,
}

impl Hull {
    pub(crate) fn new(node: &Node) -> Self {
        Self {
            disc: Disc::new(node),
            second: node.second,
            first: node.first,
            count: node.count,
        }
    }

    pub(crate) fn is_leaf(&self) -> bool {
        self.second == 0
    }

    pub(crate) fn range(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// What holds the faces of a node: all lies within `radius` of `centre` and within `thickness` of
/// the plane through it that is normal to `axis`. Where faces are nearly flat and oblique that is
/// much thinner than their box.
#[derive(Debug, Clone)]
pub(crate) struct Disc {
    pub(crate) centre: DVec3,
    axis: Vec3,
    pub(crate) radius: f32,
    /// Infinite where the box is thin enough.
    thickness: f32,
}

/// A disc is looked at only where it is thinner than the box by this factor.
const THINNER: f64 = 0.5;

/// Rounding of axes and heights in single precision, in units of the radius, must not lose a face.
const ROUNDING: f64 = 5e-7;

/// Rounding of squares, relative.
const SQUARED_ROUNDING: f32 = 5e-7;

impl Disc {
    /// Whether it is no better than the box.
    #[inline(always)]
    fn is_thick(&self) -> bool {
        self.thickness == f32::INFINITY
    }

    /// Whether some point of a packet may be nearer to what is in the disc than `best`, its squared
    /// distance from something else.
    #[inline(always)]
    pub(crate) fn may_be_nearer<S: Simd>(&self, packet: &Packet<S>, best: f32x16<S>) -> bool {
        let middle = (self.centre - packet.centre).as_vec3();
        let (x, y, z) = (
            packet.x - middle.x,
            packet.y - middle.y,
            packet.z - middle.z,
        );
        let squared = x.mul_add(x, y.mul_add(y, z * z));
        let height = packet.dot_add(self.axis, -self.axis.dot(middle));
        let zero = packet.splat(0.0);
        let over = (height.abs() - self.thickness).max(zero);
        // With `a` across the axis and `b` left of `best`, `a - r < sqrt(b)`, squared twice: no
        // root is taken.
        let left = over.mul_add(-over, best);
        let r2 = self.radius * self.radius;
        let room = r2 * (1.0 + SQUARED_ROUNDING);
        let across = height.mul_add(-height, squared);
        let more = (across.mul_add(packet.splat(1.0 - SQUARED_ROUNDING), -left) - room).max(zero);
        // Of tiny faces both sides may vanish: those are looked at.
        (more * more).simd_le(left * (4.0 * r2)).any_true()
    }

    fn new(node: &Node) -> Self {
        let Moments {
            centre,
            radius,
            thickness,
            ..
        } = node.moments;
        let axis = node.moments.axis();
        let box_thickness = (0.5 * node.bounds.size() * axis).abs().element_sum();
        let thickness = if thickness < THINNER * box_thickness {
            thickness + ROUNDING * radius
        } else {
            f64::INFINITY
        };
        Self {
            centre,
            axis: axis.as_vec3(),
            radius: radius as f32 * 1.000_001,
            thickness: thickness as f32,
        }
    }
}

/// The disc of a face, and its directions in single precision.
#[derive(Debug, Clone)]
#[repr(C)]
pub(crate) struct Facet {
    pub(crate) disc: Disc,
    along: [Vec3; 4],
    outward: [Vec3; 4],
}

impl Facet {
    pub(crate) fn new(t: &Face) -> Self {
        let from = |corner: &DVec3| (*corner - t.centroid).length();
        let radius = t.outline().iter().map(from).fold(0.0, f64::max);
        Self {
            disc: Disc {
                centre: t.centroid,
                axis: t.normal.as_vec3(),
                radius: radius as f32 * 1.000_001,
                thickness: (ROUNDING * radius) as f32,
            },
            along: t.along.map(DVec3::as_vec3),
            outward: t.outward.map(DVec3::as_vec3),
        }
    }

    /// Direction of edge `k`.
    pub(crate) fn along(&self, k: usize) -> Vec3 {
        self.along[k]
    }
}

/// A face relative to every point of a packet: signed height above the plane and, for each edge,
/// the foot's distance `d` from its line (positive towards the face) and the places of its ends
/// along the line, from the foot.
pub(crate) struct View<S: Simd> {
    pub(crate) count: usize,
    pub(crate) height: f32x16<S>,
    pub(crate) d: [f32x16<S>; 4],
    pub(crate) start: [f32x16<S>; 4],
    pub(crate) end: [f32x16<S>; 4],
    /// The places of the ends from the foot of the packet's centre.
    pub(crate) first: [f32; 4],
    pub(crate) last: [f32; 4],
}

impl<S: Simd> View<S> {
    /// Offsets from the packet's centre are taken in f64: a point near a face, an edge or a corner
    /// sees it to single precision of that small distance.
    #[inline(always)]
    pub(crate) fn new(packet: &Packet<S>, t: &Face, f: &Facet) -> Self {
        let first = t.corners[0] - packet.centre;
        let zero = packet.splat(0.0);
        let mut view = Self {
            count: t.count,
            height: packet.dot_add(f.disc.axis, -first.dot(t.normal) as f32),
            d: [zero; 4],
            start: [zero; 4],
            end: [zero; 4],
            first: [0.0; 4],
            last: [0.0; 4],
        };
        for (k, corner) in t.outline().iter().enumerate() {
            let from = *corner - packet.centre;
            let along = packet.dot_add(-f.along[k], 0.0);
            let start = from.dot(t.along[k]);
            view.d[k] = packet.dot_add(-f.outward[k], from.dot(t.outward[k]) as f32);
            (view.first[k], view.last[k]) = (start as f32, (start + t.length[k]) as f32);
            view.start[k] = along + view.first[k];
            view.end[k] = along + view.last[k];
        }
        view
    }

    /// Squared distance of every point from the face.
    #[inline(always)]
    pub(crate) fn distance_squared(&self, packet: &Packet<S>) -> f32x16<S> {
        let zero = packet.splat(0.0);
        let mut best = packet.splat(f32::INFINITY);
        for k in 0..self.count {
            let beyond = self.start[k].max(-self.end[k]).max(zero);
            best = best.min(self.d[k].mul_add(self.d[k], beyond * beyond));
        }
        let innermost = self.innermost();
        let in_plane = innermost.simd_ge(zero).select(zero, best);
        self.height.mul_add(self.height, in_plane)
    }

    /// How far inside all edges the feet lie; negative outside the face.
    #[inline(always)]
    pub(crate) fn innermost(&self) -> f32x16<S> {
        let least = self.d[0].min(self.d[1]).min(self.d[2]);
        if self.count == 4 {
            least.min(self.d[3])
        } else {
            least
        }
    }
}

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

    /// Prefetches what the search uses below a node.
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
    pub(crate) fn find_nearest(&self, points: &Points, hint: &mut usize) -> Lanes {
        dispatch_lanes!(self.level, simd => distances(simd, self, points, hint))
    }
}

/// See [`PacketDistance::find_nearest`].
#[simd]
fn distances<S: Simd>(
    simd: S,
    distance: &PacketDistance<'_>,
    points: &Points,
    hint: &mut usize,
) -> Lanes {
    let packet = Packet::new(simd, points);
    // The hinted face bounds the distance from above.
    let mut best = squared(distance, &packet, *hint);
    let mut worst = best.reduce_max();
    let mut closest = best.reduce_min();
    // How often something nearer was looked for.
    let mut looks = 0;
    let mut stack = Stack::new();
    stack.push(PendingNode::default());
    while let Some(PendingNode { id, gap, since }) = stack.pop() {
        let hull = &distance.hulls[id as usize];
        // Prunes by box, then by disc.
        if gap >= worst {
            continue;
        }
        if since != looks && !hull.disc.is_thick() && !hull.disc.may_be_nearer(&packet, best) {
            continue;
        }
        // Faces of a leaf.
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
        // Children, the nearer one on top of the stack.
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
                stack.push(PendingNode { id, gap, since });
            }
        }
    }
    best.sqrt().into()
}

/// A node still to search.
#[derive(Clone, Copy, Default)]
struct PendingNode {
    id: u32,
    /// Squared distance between the boxes, zero if it was not computed.
    gap: f32,
    /// When it was found.
    since: u32,
}

/// Squared distance of a node's box from the packet's (zero for those whose disc is thinner),
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
