//! The walk over the tree: far clusters by their moments, near faces by edge integrals.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};

use super::near::{Query, add_face};
use super::packet::Packet;
use super::{Lanes, PacketDensity, Points};
use crate::bvh::Stack;
use crate::face::Face;
use crate::moments::Moments;

/// Moments of a cluster ([`Moments`]) in single precision, centre in double.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    centre: DVec3,
    area_vector: Vec3,
    axis: Vec3,
    normal_moment: [f32; 6],
    trace: f32,
    cubic: [f32; 10],
    vector: Vec3,
    radius: f32,
    spread: f32,
}

impl Cluster {
    pub(crate) fn new(m: &Moments) -> Self {
        let [xx, yy, zz, xy, xz, yz] = m.normal_moment;
        Self {
            centre: m.centre,
            area_vector: m.area_vector.as_vec3(),
            axis: m.area_vector.try_normalize().unwrap_or(DVec3::Z).as_vec3(),
            normal_moment: [xx, yy, zz, 2.0 * xy, 2.0 * xz, 2.0 * yz].map(|v| v as f32),
            trace: (xx + yy + zz) as f32,
            cubic: m.cubic.map(|v| v as f32),
            vector: m.vector.as_vec3(),
            radius: m.radius as f32,
            spread: m.spread as f32,
        }
    }

    pub(crate) fn of_face(t: &Face) -> Self {
        Self::new(&Moments::of(std::slice::from_ref(t)))
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
    // No larger cluster can be far: saves its test.
    let largest = 8.0 * xi.reduce_max() * kernel.sigma * density.settings.size as f32;
    let mut sum = [packet.splat(0.0); 2];
    let mut stack = Stack::new();
    stack.push(0u32);
    while let Some(id) = stack.pop() {
        let node = &density.bvh.nodes[id as usize];
        if packet.box_gap_squared(node) >= farthest
            || !packet
                .box_distance_squared(node)
                .simd_lt(query.reach_squared)
                .any_true()
        {
            continue;
        }
        let cluster = &density.clusters[id as usize];
        if node.count > 1 && cluster.radius < largest {
            let seen = Seen::new(&packet, &query, cluster);
            if seen.is_far(density, cluster, &query) {
                seen.add(density, cluster, &query, &mut sum);
                continue;
            }
        }
        if !node.is_leaf() {
            stack.push(node.second);
            stack.push(id + 1);
            continue;
        }
        for i in node.range() {
            let single = &density.singles[i];
            if single.radius < largest {
                let seen = Seen::new(&packet, &query, single);
                if seen.is_far(density, single, &query) {
                    seen.add(density, single, &query, &mut sum);
                    continue;
                }
            }
            add_face(density, &packet, &query, i, &mut sum);
        }
    }
    [sum[0].into(), sum[1].into()]
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
    fn is_far(&self, density: &PacketDensity<'_>, cluster: &Cluster, query: &Query<S>) -> bool {
        let inverse_sigma = 1.0 / density.kernel.sigma;
        let zero = f32x16::splat(self.u.token(), 0.0);
        let angular = query.inverse * self.inverse_u * cluster.radius;
        let cosine = self.dot(cluster.axis) * self.inverse_u;
        let sine = (1.0 - cosine * cosine).max(zero).sqrt();
        let tilt = (sine + cluster.spread + angular * 0.5).min(1.0);
        let extent = tilt * query.inverse * cluster.radius;
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
            && (cluster.spread == 0.0
                || (size * angular * cluster.spread).reduce_max() < settings.bend as f32)
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
