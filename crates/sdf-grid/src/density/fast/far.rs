//! The walk over the tree: far clusters by their moments, near faces by edge integrals.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};

use super::near::{Query, add_face};
use super::packet::Packet;
use super::{Lanes, PacketDensity, Points};
use crate::bvh::{Node, Stack};
use crate::face::Face;
use crate::mesh::Aabb;
use crate::moments::Moments;

/// What the walk needs of a node or face before it is added: one cache line.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Outline {
    pub(crate) min: Vec3,
    pub(crate) max: Vec3,
    centre: Vec3,
    axis: Vec3,
    radius: f32,
    spread: f32,
    /// See [`crate::bvh::Node::second`].
    second: u32,
    count: u32,
}

impl Outline {
    pub(crate) fn of_node(n: &Node) -> Self {
        let outline = Self::new(&n.moments, n.bounds);
        Self {
            second: n.second,
            count: n.count,
            ..outline
        }
    }

    pub(crate) fn of_face(t: &Face, moments: &Moments) -> Self {
        Self::new(moments, Aabb::around(t.outline().iter().copied()))
    }

    fn new(m: &Moments, bounds: Aabb) -> Self {
        // Rounding to single precision must not lose a face: normalized coordinates are below 2.
        let room = DVec3::splat(2.5e-7);
        Self {
            min: (bounds.min - room).as_vec3(),
            max: (bounds.max + room).as_vec3(),
            centre: m.centre.as_vec3(),
            axis: m.area_vector.try_normalize().unwrap_or(DVec3::Z).as_vec3(),
            radius: m.radius as f32,
            spread: m.spread as f32,
            second: 0,
            count: 1,
        }
    }
}

/// Moments of a cluster ([`Moments`]) in single precision, centre in double.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    centre: DVec3,
    area_vector: Vec3,
    normal_moment: [f32; 6],
    trace: f32,
    cubic: [f32; 10],
    vector: Vec3,
}

impl Cluster {
    pub(crate) fn new(m: &Moments) -> Self {
        let [xx, yy, zz, xy, xz, yz] = m.normal_moment;
        Self {
            centre: m.centre,
            area_vector: m.area_vector.as_vec3(),
            normal_moment: [xx, yy, zz, 2.0 * xy, 2.0 * xz, 2.0 * yz].map(|v| v as f32),
            trace: (xx + yy + zz) as f32,
            cubic: m.cubic.map(|v| v as f32),
            vector: m.vector.as_vec3(),
        }
    }
}

/// See [`PacketDensity::integrals`].
#[simd]
pub(crate) fn integrals<S: Simd>(
    simd: S,
    density: &PacketDensity<'_>,
    points: &Points,
    distances: &Lanes,
) -> [Lanes; 2] {
    let packet = Packet::new(simd, points);
    let kernel = &density.kernel;
    let xi = f32x16::simd_from(simd, *distances);
    let reach = xi * (1.0 + kernel.reach * kernel.sigma);
    let query = Query {
        xi,
        inverse: 1.0 / xi.max(1e-12),
        reach_squared: reach * reach,
    };
    let farthest = query.reach_squared.reduce_max();
    let glance = Glance::new(density, &packet, xi);
    let mut sum = [packet.splat(0.0); 2];
    let mut stack = Stack::new();
    stack.push(0u32);
    while let Some(id) = stack.pop() {
        let outline = &density.outlines[id as usize];
        if glance.gap_squared(outline) >= farthest {
            continue;
        }
        if outline.count > 1 && glance.may_be_far(outline) {
            let cluster = &density.clusters[id as usize];
            let seen = Seen::new(&packet, &query, cluster);
            if seen.is_far(density, outline, &query) {
                seen.add(density, cluster, &query, &mut sum);
                continue;
            }
        }
        if outline.second != 0 {
            stack.push(outline.second);
            stack.push(id + 1);
            continue;
        }
        for i in density.bvh.nodes[id as usize].range() {
            let outline = &density.face_outlines[i];
            if glance.gap_squared(outline) >= farthest {
                continue;
            }
            if glance.may_be_far(outline) {
                let single = &density.singles[i];
                let seen = Seen::new(&packet, &query, single);
                if seen.is_far(density, outline, &query) {
                    seen.add(density, single, &query, &mut sum);
                    continue;
                }
            }
            add_face(density, &packet, &query, i, &mut sum);
        }
    }
    [sum[0].into(), sum[1].into()]
}

/// What tells whether a cluster may be far from a packet, or out of reach, without a look at its points.
struct Glance {
    centre: Vec3,
    /// Half the size of the points' box, and half its diagonal.
    box_half: Vec3,
    half: f32,
    /// One over the least distance from the boundary, and over the mean one.
    inverse: [f32; 2],
    inverse_sigma: f32,
    /// One over the length, in distances, over which the kernel varies.
    inverse_width: f32,
    size: f32,
    bend: f32,
}

impl Glance {
    #[inline(always)]
    fn new<S: Simd>(density: &PacketDensity<'_>, packet: &Packet<S>, xi: f32x16<S>) -> Self {
        let counts = xi.simd_gt(0.0);
        let least = counts.select(xi, packet.splat(f32::INFINITY)).reduce_min();
        let most = xi.reduce_max();
        let inverse_sigma = 1.0 / density.kernel.sigma;
        Self {
            centre: packet.centre.as_vec3(),
            box_half: packet.half + 2.5e-7,
            half: packet.half.length(),
            inverse: [1.0 / least, 2.0 / (least + most)],
            inverse_sigma,
            // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
            inverse_width: (inverse_sigma * inverse_sigma + 25.0).sqrt(),
            size: density.settings.size as f32,
            bend: density.settings.bend as f32,
        }
    }

    /// A least squared distance between the box of points and the outline's box.
    #[inline(always)]
    fn gap_squared(&self, outline: &Outline) -> f32 {
        let lo = outline.min - self.centre - self.box_half;
        let hi = self.centre - outline.max - self.box_half;
        lo.max(hi).max(Vec3::ZERO).length_squared()
    }

    /// Whether [`Seen::is_far`] is likely, by the same rule for the packet as a whole. Saves most of
    /// the tests that fail.
    #[inline(always)]
    fn may_be_far(&self, cluster: &Outline) -> bool {
        // No larger cluster can be.
        let relative = cluster.radius * self.inverse[0];
        if relative > 8.0 * self.size / self.inverse_sigma {
            return false;
        }
        let from = self.centre - cluster.centre;
        let eta = from.length();
        let nearest = (eta - self.half).max(1.0 / self.inverse[0]);
        // One division for two: the next steps wait for it.
        let both = 1.0 / (eta * nearest);
        let angular = cluster.radius * eta * both;
        let cosine = from.dot(cluster.axis) * nearest * both;
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let tilt = (sine + cluster.spread + 0.5 * angular).min(1.0);
        let extent = tilt * relative;
        let x = ((eta * self.inverse[1] - extent - 1.0) * self.inverse_sigma).max(0.0);
        let tail = 1.0 + x * x * (0.17 + 0.014 * x * x);
        let size = extent * self.inverse_width;
        size < self.size * tail && size * angular * cluster.spread < self.bend * tail
    }
}

/// A cluster as the points of a packet see it, in units of their distances.
struct Seen<S: Simd> {
    /// `r = (p - c) / xi`.
    r: [f32x16<S>; 3],
    /// `|r|`.
    u: f32x16<S>,
    inverse_u: f32x16<S>,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    fn new(packet: &Packet<S>, query: &Query<S>, cluster: &Cluster) -> Self {
        let from = (cluster.centre - packet.centre).as_vec3();
        let r = [
            (packet.x - from.x) * query.inverse,
            (packet.y - from.y) * query.inverse,
            (packet.z - from.z) * query.inverse,
        ];
        let squared = r[0].mul_add(r[0], r[1].mul_add(r[1], r[2] * r[2]));
        let u = squared.max(1e-30).sqrt();
        Self {
            r,
            u,
            inverse_u: 1.0 / u,
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
    fn is_far(&self, density: &PacketDensity<'_>, outline: &Outline, query: &Query<S>) -> bool {
        let inverse_sigma = 1.0 / density.kernel.sigma;
        let zero = f32x16::splat(self.u.token(), 0.0);
        let angular = query.inverse * self.inverse_u * outline.radius;
        let cosine = self.dot(outline.axis) * self.inverse_u;
        let sine = (1.0 - cosine * cosine).max(zero).sqrt();
        let tilt = (sine + outline.spread + angular * 0.5).min(1.0);
        let extent = tilt * query.inverse * outline.radius;
        let x = ((self.u - extent - 1.0) * inverse_sigma).max(zero);
        let x2 = x * x;
        let tail = x2.mul_add(x2 * 0.014 + 0.17, f32x16::splat(self.u.token(), 1.0));
        // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
        let inverse_width = (inverse_sigma * inverse_sigma + 25.0).sqrt();
        let size = extent * inverse_width / tail;
        let counts = x.simd_lt(density.kernel.reach) & query.xi.simd_gt(zero);
        let size = counts.select(size, zero);
        let settings = &density.settings;
        size.reduce_max() < settings.size as f32
            && (outline.spread == 0.0
                || (size * angular * outline.spread).reduce_max() < settings.bend as f32)
    }

    /// Adds the cluster's second-order expansion ([`Moments::far_field`]).
    #[inline(always)]
    fn add(
        &self,
        density: &PacketDensity<'_>,
        cluster: &Cluster,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
    ) {
        let x = (self.u - 1.0) * (1.0 / density.kernel.sigma);
        let counts: mask32x16<S> = x.simd_lt(density.kernel.reach) & query.xi.simd_gt(0.0);
        if !counts.any_true() {
            return;
        }
        let [g, g1, g2] = density.kernel.radial(self.u, self.inverse_u);
        let (m, s) = (&cluster.normal_moment, &cluster.cubic);
        let [x, y, z] = self.r;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (xy, xz, yz) = (x * y, x * z, y * z);
        let scale = query.inverse * query.inverse;
        let sum_of = |terms: &[(f32x16<S>, f32)]| {
            let first = terms[0].0 * terms[0].1;
            let add = |sum: f32x16<S>, t: &(f32x16<S>, f32)| t.0.mul_add(t.1, sum);
            terms[1..].iter().fold(first, add)
        };
        let tilt = sum_of(&[
            (xx, m[0]),
            (yy, m[1]),
            (zz, m[2]),
            (xy, m[3]),
            (xz, m[4]),
            (yz, m[5]),
        ]);
        let with_x = sum_of(&[
            (xx, s[0]),
            (xy, s[1]),
            (xz, s[2]),
            (yy, s[3]),
            (yz, s[4]),
            (zz, s[5]),
        ]);
        let with_y = sum_of(&[(yy, s[6]), (yz, s[7]), (zz, s[8])]);
        let cubic = x.mul_add(with_x, y.mul_add(with_y, z * zz * s[9]));
        let flat = self.dot(cluster.area_vector) - query.inverse * cluster.trace;
        let first = self.dot(cluster.vector) * scale - tilt * query.inverse;
        let bow = cubic * scale * (self.inverse_u * self.inverse_u * 0.5);
        let zero = f32x16::splat(self.u.token(), 0.0);
        for k in 0..2 {
            let slope = g1[k] * self.inverse_u;
            let second = slope.mul_add(first, (g2[k] - slope) * bow);
            let value = g[k].mul_add(flat, second);
            sum[k] += counts.select(value * scale, zero);
        }
    }
}
