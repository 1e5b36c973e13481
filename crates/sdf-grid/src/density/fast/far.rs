//! The walk over the tree: far clusters by their moments, near triangles by edge integrals.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DMat3, DVec3, Vec3};

use super::near::{Query, add_triangle};
use super::packet::Packet;
use super::{Lanes, PacketDensity, Points};
use crate::bvh::Stack;
use crate::moments::{Moments, triangle_covariance};
use crate::triangle::Triangle;

/// Moments of a cluster ([`Moments`]) in single precision, centre in double.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    centre: DVec3,
    area_vector: Vec3,
    axis: Vec3,
    /// xx, yy, zz, xy, xz, yz.
    covariance: [f32; 6],
    /// None for a flat cluster.
    normal_moment: Option<[f32; 6]>,
    radius: f32,
    spread: f32,
}

impl Cluster {
    pub(crate) fn new(m: &Moments) -> Self {
        Self {
            centre: m.centre,
            area_vector: m.area_vector.as_vec3(),
            axis: m.area_vector.try_normalize().unwrap_or(DVec3::Z).as_vec3(),
            covariance: symmetric(&m.covariance),
            normal_moment: Some(symmetric(&m.normal_moment)),
            radius: m.radius as f32,
            spread: m.spread as f32,
        }
    }

    pub(crate) fn of_triangle(t: &Triangle) -> Self {
        Self {
            centre: t.centroid,
            area_vector: (t.normal * t.area).as_vec3(),
            axis: t.normal.as_vec3(),
            covariance: symmetric(&triangle_covariance(t)),
            normal_moment: None,
            radius: t.radius as f32,
            spread: 0.0,
        }
    }
}

fn symmetric(m: &DMat3) -> [f32; 6] {
    [
        m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z,
    ]
    .map(|v| v as f32)
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
            add_triangle(density, &packet, &query, i, &mut sum);
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

    /// `m r` for a symmetric matrix.
    #[inline(always)]
    fn times(&self, m: &[f32; 6]) -> [f32x16<S>; 3] {
        [
            self.dot(Vec3::new(m[0], m[3], m[4])),
            self.dot(Vec3::new(m[3], m[1], m[5])),
            self.dot(Vec3::new(m[4], m[5], m[2])),
        ]
    }

    #[inline(always)]
    fn dot_with(&self, v: [f32x16<S>; 3]) -> f32x16<S> {
        self.r[0].mul_add(v[0], self.r[1].mul_add(v[1], self.r[2] * v[2]))
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
        let size = extent * inverse_sigma / tail;
        let counts = x.simd_lt(density.kernel.reach) & query.xi.simd_gt(zero);
        let settings = &density.settings;
        let size = counts.select(size, zero);
        if size.reduce_max() >= settings.size as f32 {
            return false;
        }
        cluster.spread == 0.0
            || (size * angular * cluster.spread).reduce_max() < settings.bend as f32
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
        let c = &cluster.covariance;
        let scale = query.inverse * query.inverse;
        let rn = self.dot(cluster.area_vector);
        let cr = self.times(c);
        let n = cluster.area_vector;
        let crn = cr[0] * n.x + cr[1] * n.y + cr[2] * n.z;
        let curvature = self.dot_with(cr) * rn * scale;
        let shape = (rn * (c[0] + c[1] + c[2]) + crn * 2.0) * scale;
        let zero = f32x16::splat(self.u.token(), 0.0);
        let (mut trace, mut tilt) = (zero, zero);
        if let Some(m) = &cluster.normal_moment {
            trace = query.inverse * (m[0] + m[1] + m[2]);
            tilt = self.dot_with(self.times(m)) * query.inverse;
        }
        for k in 0..2 {
            let slope = g1[k] * self.inverse_u;
            let bow = (g2[k] - slope) * self.inverse_u * self.inverse_u;
            let value =
                g[k] * (rn - trace) + (bow * curvature + slope * shape) * 0.5 - slope * tilt;
            sum[k] += counts.select(value * scale, zero);
        }
    }
}
