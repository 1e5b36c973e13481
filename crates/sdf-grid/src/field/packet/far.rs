//! The walk over the tree: far clusters by their moments, near faces by edge integrals.

use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};

use super::alone::FarClusters;
use super::groups::{Below, Group, Members, WIDTH};
use super::near::{NearFaces, Query};
use super::packet::Packet;
use super::settings::{Far, Settings};
use super::{Lanes, PacketDensity, Points};
use crate::face::Face;
use crate::large::prefetch;
use crate::moments::Moments;

/// Moments of a cluster ([`Moments`]) in single precision, centre in double. Two cache lines.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct Cluster {
    pub(crate) centre: DVec3,
    pub(crate) radius: f32,
    pub(crate) spread: f32,
    /// Area vector, normal moment and its trace, cubic form, vector, from the indices below on.
    pub(crate) terms: [f32; TERMS],
}

/// Numbers in the expansion of a cluster, and where they begin.
pub(crate) const TERMS: usize = 23;
const NORMAL_MOMENT: usize = 3;
const TRACE: usize = 9;
const CUBIC: usize = 10;
const VECTOR: usize = 20;

impl Cluster {
    /// Of nothing.
    pub(crate) const EMPTY: Self = Self {
        centre: DVec3::ZERO,
        radius: 0.0,
        spread: 0.0,
        terms: [0.0; TERMS],
    };

    /// Of one face.
    pub(crate) fn of(face: &Face) -> Self {
        let faces = std::slice::from_ref(face);
        Self::new(&Moments::of(faces).bounded(faces))
    }

    /// Direction of the area vector.
    pub(crate) fn axis(&self) -> Vec3 {
        let area_vector = Vec3::from_slice(&self.terms[..3]);
        let axis = area_vector.as_dvec3().try_normalize();
        axis.unwrap_or(DVec3::Z).as_vec3()
    }

    pub(crate) fn new(m: &Moments) -> Self {
        let [xx, yy, zz, xy, xz, yz] = m.normal_moment;
        let mut terms = [0.0; TERMS];
        let mut set = |first: usize, values: &[f64]| {
            for (term, value) in terms[first..].iter_mut().zip(values) {
                *term = *value as f32;
            }
        };
        set(0, &m.area_vector.to_array());
        set(NORMAL_MOMENT, &[xx, yy, zz, 2.0 * xy, 2.0 * xz, 2.0 * yz]);
        set(TRACE, &[xx + yy + zz]);
        set(CUBIC, &m.cubic);
        set(VECTOR, &m.vector.to_array());
        Self {
            centre: m.centre,
            radius: m.radius as f32,
            spread: m.spread as f32,
            terms,
        }
    }
}

/// The terms of one cluster that all points see, or of one for each.
pub(crate) trait Terms<S: Simd> {
    fn get(&self, simd: S, term: usize) -> f32x16<S>;
}

impl<S: Simd> Terms<S> for [f32; TERMS] {
    #[inline(always)]
    fn get(&self, simd: S, term: usize) -> f32x16<S> {
        f32x16::splat(simd, self[term])
    }
}

impl<S: Simd> Terms<S> for [Lanes; TERMS] {
    #[inline(always)]
    fn get(&self, simd: S, term: usize) -> f32x16<S> {
        f32x16::simd_from(simd, self[term])
    }
}

/// Working memory of the walk. Reused from packet to packet.
#[derive(Debug, Default)]
pub(crate) struct Walk {
    /// Groups to look at.
    pub(crate) waiting: Vec<u32>,
    pub(crate) near: NearFaces,
    /// Clusters to add for a lone point.
    pub(crate) far: FarClusters,
    /// Whether clusters cancelled at the packet before.
    pub(crate) cancelled: bool,
}

impl Walk {
    /// Forgets the packet before: what it leaves changes results by what the tolerance allows.
    pub(crate) fn restart(&mut self) {
        self.cancelled = false;
    }
}

/// Where clusters add up to this many times their sum they cancel, and their errors weigh more.
pub(crate) const CANCELLING: f32 = 1.1;

/// See [`PacketDensity::integrals`].
#[simd]
pub(crate) fn integrals<S: Simd>(
    simd: S,
    density: &PacketDensity<'_>,
    points: &Points,
    distances: &Lanes,
    walk: &mut Walk,
) -> [Lanes; 2] {
    let packet = Packet::new(simd, points);
    let query = Query::new(density, f32x16::simd_from(simd, *distances));
    let limits = |cancelled| Limits::new(&density.settings, cancelled);
    let first = walk.cancelled;
    let (mut sum, mut cancelled) = accumulate(density, &packet, &query, &limits(first), walk);
    if cancelled && !first {
        (sum, cancelled) = accumulate(density, &packet, &query, &limits(true), walk);
    }
    // Neighbours are alike: mostly saves the first of two attempts.
    walk.cancelled = cancelled;
    let zero = packet.splat(0.0);
    // Lanes to leave out hold numbers without meaning.
    sum.map(|s| query.counts.select(s, zero).into())
}

/// Which clusters are far.
pub(crate) struct Limits<'a> {
    /// Of those whose normals spread little.
    open: &'a Far,
    /// Of the others, in which front and back may cancel unseen.
    folded: &'a Far,
}

/// The sine of the angle between a cluster's normals and their mean from which on it is folded.
const FOLDED: f32 = 0.7;

impl<'a> Limits<'a> {
    /// Where clusters cancel, or perhaps do not.
    pub(crate) fn new(settings: &'a Settings, cancelled: bool) -> Self {
        let Settings {
            far,
            far_cancelling,
            ..
        } = settings;
        Self {
            open: if cancelled { far_cancelling } else { far },
            folded: far_cancelling,
        }
    }

    fn of(&self, cluster: &Cluster) -> &Far {
        if cluster.spread < FOLDED {
            self.open
        } else {
            self.folded
        }
    }
}

/// The sum over clusters that are far and near faces, and whether clusters cancel.
#[inline(always)]
fn accumulate<S: Simd>(
    density: &PacketDensity<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    walk: &mut Walk,
) -> ([f32x16<S>; 2], bool) {
    let glance = Glance::new(density, packet, query, limits);
    let mut sum = [packet.splat(0.0); 2];
    let mut magnitude = packet.splat(0.0);
    walk.near.prepare(density.bvh.faces.len());
    walk.waiting.clear();
    walk.waiting.push(0);
    while let Some(id) = walk.waiting.pop() {
        let group = &density.groups[id as usize];
        let clusters = &density.clusters[id as usize];
        let ([reached, perhaps_far], sines) = glance.at(packet.simd, group);
        if density.is_large {
            ask_for(density, group, clusters, reached, perhaps_far);
        }
        let mut members = group.top & reached;
        while members != 0 {
            let place = members.trailing_zeros() as usize;
            members &= members - 1;
            if perhaps_far >> place & 1 == 1 {
                let cluster = &clusters[place];
                let seen = Seen::new(packet, query, cluster);
                let axis = (group.axis_of(place), sines[place]);
                if seen.is_far(density, cluster, axis, query, limits.of(cluster)) {
                    seen.add(density, &cluster.terms, query, &mut sum, &mut magnitude);
                    continue;
                }
            }
            match group.below[place] {
                Below::Face(face) => {
                    let near = &mut walk.near;
                    near.add(density, packet, query, face as usize, &mut sum);
                }
                Below::Members(below) => members |= below & reached,
                Below::Group(below) => walk.waiting.push(below),
            }
        }
    }
    walk.near.add_waiting(density, packet, query, &mut sum);
    let total = sum[0].abs() + sum[1].abs();
    let cancels = magnitude.simd_gt(total * CANCELLING) & query.counts;
    (sum, cancels.any_true())
}

/// Asks for what the walk will most likely take of a group, ahead of its use: of large meshes it lies in distant
/// caches.
#[inline(always)]
pub(crate) fn ask_for(
    density: &PacketDensity<'_>,
    group: &Group,
    clusters: &[Cluster; WIDTH],
    reached: u32,
    perhaps_far: u32,
) {
    let mut members = group.top & reached;
    while members != 0 {
        let place = members.trailing_zeros() as usize;
        members &= members - 1;
        if perhaps_far >> place & 1 == 1 {
            prefetch(&clusters[place]);
            continue;
        }
        match group.below[place] {
            Below::Face(face) => prefetch(&density.bvh.faces[face as usize]),
            Below::Members(below) => members |= below & reached,
            Below::Group(below) => prefetch(&density.groups[below as usize]),
        }
    }
}

/// What tells whether a cluster may be far from a packet, or out of reach, without a look at its points.
pub(crate) struct Glance {
    centre: Vec3,
    /// Half the size of the points' box, and half its diagonal.
    box_half: Vec3,
    half: f32,
    /// The square of the largest distance within which boundary points count.
    farthest: f32,
    /// Least and mean distance from the boundary.
    least: f32,
    inverse_mean: f32,
    inverse_sigma: f32,
    /// One over the length, in distances, over which the kernel varies.
    inverse_width: f32,
    /// [`Far`] of open and of folded clusters.
    size: [f32; 2],
    front: [f32; 2],
    bend: [f32; 2],
}

impl Glance {
    #[inline(always)]
    pub(crate) fn new<S: Simd>(
        density: &PacketDensity<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        limits: &Limits<'_>,
    ) -> Self {
        let least = query
            .counts
            .select(query.xi, packet.splat(f32::INFINITY))
            .reduce_min();
        let most = query.xi.reduce_max();
        let inverse_sigma = 1.0 / density.kernel.sigma;
        Self {
            centre: packet.centre.as_vec3(),
            box_half: packet.half + 2.5e-7,
            half: packet.half.length(),
            farthest: query.reach_squared.reduce_max(),
            least,
            inverse_mean: 2.0 / (least + most),
            inverse_sigma,
            // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
            inverse_width: (inverse_sigma * inverse_sigma + 25.0).sqrt(),
            size: [limits.open, limits.folded].map(|far| far.size as f32),
            front: [limits.open, limits.folded].map(|far| far.front as f32),
            bend: [limits.open, limits.folded].map(|far| far.bend as f32),
        }
    }

    /// Which members of a group are within reach of the box of points, and of which
    /// [`Seen::is_far`] is likely, by the same rule for the packet as a whole. Saves most of the tests
    /// that fail. And the sines between the members' axes and the line from the packet's centre.
    #[inline(always)]
    pub(crate) fn at<S: Simd>(&self, simd: S, group: &Group) -> ([u32; 2], Members) {
        let load = |members: &Members| f32x8::simd_from(simd, *members);
        let splat = |value: f32| f32x8::splat(simd, value);
        let zero = splat(0.0);
        let (mut gap_squared, mut eta_squared, mut along) = (zero, zero, zero);
        for k in 0..3 {
            let low = load(&group.min[k]) - (self.centre[k] + self.box_half[k]);
            let high = splat(self.centre[k] - self.box_half[k]) - load(&group.max[k]);
            let gap = low.max(high).max(zero);
            gap_squared = gap.mul_add(gap, gap_squared);
            let from = splat(self.centre[k]) - load(&group.centre[k]);
            eta_squared = from.mul_add(from, eta_squared);
            along = from.mul_add(load(&group.axis[k]), along);
        }
        let reached = gap_squared.simd_lt(splat(self.farthest));
        let (radius, spread) = (load(&group.radius), load(&group.spread));
        let eta = eta_squared.sqrt();
        let nearest = (eta - self.half).max(splat(self.least));
        // One division for two.
        let both = 1.0 / (eta * nearest);
        let angular = radius * eta * both;
        let cosine = along * nearest * both;
        let sine = (splat(1.0) - cosine * cosine).max(zero).sqrt();
        let tilt = angular.mul_add(splat(0.5), sine + spread).min(splat(1.0));
        let extent = tilt * radius * (1.0 / self.least);
        let x = ((eta * self.inverse_mean - extent - 1.0) * self.inverse_sigma).max(zero);
        let x2 = x * x;
        let tail = x2.mul_add(x2.mul_add(splat(0.014), splat(0.17)), splat(1.0));
        let open = spread.simd_lt(splat(FOLDED));
        let limit = |[a, b]: [f32; 2]| open.select(splat(a), splat(b));
        let front = angular * radius * (limit(self.front) * (1.0 / self.least));
        let size = (extent + front) * self.inverse_width;
        let bent = size * angular * spread;
        let far = size.simd_lt(tail * limit(self.size)) & bent.simd_lt(tail * limit(self.bend));
        let masks = [reached, far].map(|mask| mask.to_bitmask() as u32);
        (masks, sine.into())
    }
}

/// Tangents to the root in [`Seen::is_far`] touch it at the square of this or more: at zero they are vertical.
const LEAST_SINE: f32 = 0.1;

/// A cluster as the points of a packet see it, in units of their distances.
pub(crate) struct Seen<S: Simd> {
    /// `r = (p - c) / xi`.
    r: [f32x16<S>; 3],
    /// `|r|`.
    u: f32x16<S>,
    inverse_u: f32x16<S>,
    /// `1 / (1 + u^2)`.
    w: f32x16<S>,
}

impl<S: Simd> Seen<S> {
    #[inline(always)]
    fn new(packet: &Packet<S>, query: &Query<S>, cluster: &Cluster) -> Self {
        let from = (cluster.centre - packet.centre).as_vec3();
        Self::at([
            (packet.x - from.x) * query.inverse,
            (packet.y - from.y) * query.inverse,
            (packet.z - from.z) * query.inverse,
        ])
    }

    /// From `r`.
    #[inline(always)]
    pub(crate) fn at(r: [f32x16<S>; 3]) -> Self {
        let squared = r[0].mul_add(r[0], r[1].mul_add(r[1], r[2] * r[2]));
        let u = squared.max(1e-30).sqrt();
        // One division for two.
        let more = squared + 1.0;
        let both = 1.0 / (u * more);
        Self {
            r,
            u,
            inverse_u: both * more,
            w: both * u,
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
    fn is_far(
        &self,
        density: &PacketDensity<'_>,
        cluster: &Cluster,
        (axis, sine): (Vec3, f32),
        query: &Query<S>,
        far: &Far,
    ) -> bool {
        let inverse_sigma = 1.0 / density.kernel.sigma;
        let zero = f32x16::splat(self.u.token(), 0.0);
        let angular = query.inverse * self.inverse_u * cluster.radius;
        let cosine = self.dot(axis) * self.inverse_u;
        // A root lies below its tangents, of which the packet's centre names a close one.
        let sine = sine.max(LEAST_SINE);
        let tilt = cosine * cosine * (-0.5 / sine) + (0.5 / sine + 0.5 * sine + cluster.spread);
        let tilt = (tilt + angular * 0.5).min(1.0);
        let extent = tilt * query.inverse * cluster.radius;
        let x = ((self.u - extent - 1.0) * inverse_sigma).max(zero);
        let x2 = x * x;
        let tail = x2.mul_add(x2 * 0.014 + 0.17, f32x16::splat(self.u.token(), 1.0));
        // The Gaussian is not all that varies: the rest of the kernel does over about a fifth.
        let inverse_width = (inverse_sigma * inverse_sigma + 25.0).sqrt();
        let front = angular * query.inverse * (cluster.radius * far.front as f32);
        let size = (extent + front) * inverse_width;
        let small = size.simd_lt(tail * far.size as f32);
        let straight = (size * angular * cluster.spread).simd_lt(tail * far.bend as f32);
        let counts = x.simd_lt(density.kernel.reach) & query.counts;
        !(counts & !(small & straight)).any_true()
    }

    /// Adds the cluster's second-order expansion ([`Moments::far_field`]), and its size to `magnitude`.
    #[inline(always)]
    pub(crate) fn add(
        &self,
        density: &PacketDensity<'_>,
        terms: &impl Terms<S>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
        magnitude: &mut f32x16<S>,
    ) {
        let distance = (self.u - 1.0) * (1.0 / density.kernel.sigma);
        let counts: mask32x16<S> = distance.simd_lt(density.kernel.reach) & query.counts;
        if !counts.any_true() {
            return;
        }
        let simd = self.u.token();
        let [x, y, z] = self.r;
        let (xx, yy, zz) = (x * x, y * y, z * z);
        let (xy, xz, yz) = (x * y, x * z, y * z);
        let scale = query.inverse * query.inverse;
        let sum_of = |first: usize, powers: &[f32x16<S>]| {
            let start = powers[0] * terms.get(simd, first);
            let add = |sum: f32x16<S>, (k, power): (usize, &f32x16<S>)| {
                power.mul_add(terms.get(simd, first + 1 + k), sum)
            };
            powers[1..].iter().enumerate().fold(start, add)
        };
        let tilt = sum_of(NORMAL_MOMENT, &[xx, yy, zz, xy, xz, yz]);
        let with_x = sum_of(CUBIC, &[xx, xy, xz, yy, yz, zz]);
        let with_y = sum_of(CUBIC + 6, &[yy, yz, zz]);
        let with_z = z * zz * terms.get(simd, CUBIC + 9);
        let cubic = x.mul_add(with_x, y.mul_add(with_y, with_z));
        let flat = sum_of(0, &self.r) - query.inverse * terms.get(simd, TRACE);
        let first = sum_of(VECTOR, &self.r) * scale - tilt * query.inverse;
        let bow = cubic * scale * (self.inverse_u * self.inverse_u * 0.5);
        let zero = f32x16::splat(simd, 0.0);
        let seen = [distance, self.u, self.inverse_u, self.w];
        let values = density.kernel.expansion(seen, [flat, first, bow]);
        for k in 0..2 {
            let value = counts.select(values[k] * scale, zero);
            sum[k] += value;
            *magnitude += value.abs();
        }
    }
}
