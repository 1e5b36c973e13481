//! Sixteen points about a common centre, and a face as they see it.

use fearless_simd::{f32x16, prelude::*};
use glam::{DVec3, Vec3};

use super::{LANES, Lanes};
use crate::bvh::Node;
use crate::face::Face;
use crate::moments::Moments;

/// Sixteen normalized positions: the middle of their box, and where they lie from it.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct Points {
    places: [Lanes; 3],
    pub(crate) centre: DVec3,
    /// Half the size of the box, a little more: rounding must not lose a point.
    half: Vec3,
}

impl Points {
    pub(crate) fn new(points: &[DVec3; LANES]) -> Self {
        let low = points.iter().fold(points[0], |a, p| a.min(*p));
        let high = points.iter().fold(points[0], |a, p| a.max(*p));
        let centre = 0.5 * (low + high);
        let place = |k: usize| points.map(|p| (p[k] - centre[k]) as f32);
        Self {
            places: [0, 1, 2].map(place),
            centre,
            half: (0.5 * (high - low)).as_vec3() * 1.000_001,
        }
    }

    /// Half the diagonal of their box.
    pub(crate) fn half_diagonal(&self) -> f32 {
        self.half.length()
    }
}

/// Points as vectors.
pub(crate) struct Packet<S: Simd> {
    pub(crate) simd: S,
    pub(crate) centre: DVec3,
    pub(crate) x: f32x16<S>,
    pub(crate) y: f32x16<S>,
    pub(crate) z: f32x16<S>,
    /// Half the size of the box of points.
    pub(crate) half: Vec3,
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, points: &Points) -> Self {
        let [x, y, z] = &points.places;
        Self {
            simd,
            centre: points.centre,
            x: f32x16::simd_from(simd, *x),
            y: f32x16::simd_from(simd, *y),
            z: f32x16::simd_from(simd, *z),
            half: points.half,
        }
    }

    /// Of sixteen times the same point.
    #[inline(always)]
    pub(crate) fn of_one(simd: S, point: DVec3) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        Self {
            simd,
            centre: point,
            x: zero,
            y: zero,
            z: zero,
            half: Vec3::ZERO,
        }
    }

    #[inline(always)]
    pub(crate) fn splat(&self, value: f32) -> f32x16<S> {
        f32x16::splat(self.simd, value)
    }

    /// `base + p . v` for every point `p`.
    #[inline(always)]
    pub(crate) fn dot_add(&self, v: Vec3, base: f32) -> f32x16<S> {
        let z = self.z.mul_add(self.splat(v.z), self.splat(base));
        self.x
            .mul_add(self.splat(v.x), self.y.mul_add(self.splat(v.y), z))
    }

    /// Distance of coordinates from an interval, zero in it.
    #[inline(always)]
    fn gap(&self, p: f32x16<S>, lo: f32, hi: f32) -> f32x16<S> {
        (self.splat(lo) - p)
            .max(p - self.splat(hi))
            .max(self.splat(0.0))
    }

    /// Whether some point may be nearer to what is in a disc than `best`, its squared distance from something
    /// else.
    #[inline(always)]
    pub(crate) fn disc_may_be_nearer(&self, disc: &Disc, best: f32x16<S>) -> bool {
        let middle = (disc.centre - self.centre).as_vec3();
        let (x, y, z) = (self.x - middle.x, self.y - middle.y, self.z - middle.z);
        let squared = x.mul_add(x, y.mul_add(y, z * z));
        let height = self.dot_add(disc.axis, -disc.axis.dot(middle));
        let zero = self.splat(0.0);
        let over = (height.abs() - disc.thickness).max(zero);
        // With `a` across the axis and `b` left of `best`, `a - r < sqrt(b)`, squared twice: no root is taken.
        let left = over.mul_add(-over, best);
        let r2 = disc.radius * disc.radius;
        let room = r2 * (1.0 + SQUARED_ROUNDING);
        let across = height.mul_add(-height, squared);
        let more = (across.mul_add(self.splat(1.0 - SQUARED_ROUNDING), -left) - room).max(zero);
        // Of tiny faces both sides may vanish: those are looked at.
        (more * more).simd_le(left * (4.0 * r2)).any_true()
    }

    /// Squared distance of every point from a box.
    #[inline(always)]
    pub(crate) fn box_distance_squared(&self, [lo, hi]: [Vec3; 2]) -> f32x16<S> {
        let x = self.gap(self.x, lo.x, hi.x);
        let y = self.gap(self.y, lo.y, hi.y);
        let z = self.gap(self.z, lo.z, hi.z);
        x.mul_add(x, y.mul_add(y, z * z))
    }
}

/// What searches see of a node, in one cache line; where its faces are nearly flat and oblique, that is all.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Hull {
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

/// What holds the faces of a node: all lies within `radius` of `centre` and within `thickness` of the plane
/// through it that is normal to `axis`. Where faces are nearly flat and oblique that is much thinner than
/// their box.
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
    pub(crate) fn is_thick(&self) -> bool {
        self.thickness == f32::INFINITY
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

/// A face seen from every point of a packet: signed height above the plane and, for each edge,
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
