//! Traversal of the tree: far clusters by their moments, near faces by edge integrals.
//!
//! A packet traversal adds one cluster at a time to sixteen points. Where faces are so small that
//! neighbouring points have hardly any cluster in common, a single traversal collects clusters and
//! adds sixteen at a time to one point.

use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x16};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};

use super::acceptance::{AcceptanceTest, FarFieldView, Limits};
use super::near_faces::NearFaces;
use super::points::{LANES, Lanes, Packet, Points};
use super::tree::{Child, Cluster, PacketTree, Query, TERMS, WIDTH, WideNode};
use crate::dispatch_lanes;
use crate::field::kernel::CumulativeKernel;
use crate::support::level;
use crate::support::prefetch::fetch_value;
use crate::surface::bvh::tree::Bvh;

/// Working memory of the traversal. Reused from packet to packet.
#[derive(Debug, Default)]
pub(crate) struct Traversal {
    path: TraversalStack,
    /// Clusters to add for a lone point.
    clusters: PendingClusters,
    /// Whether clusters cancelled at the packet before.
    cancelled: bool,
}

impl Traversal {
    /// Forgets the packet before: what it leaves changes results by what the tolerance allows.
    pub(crate) fn restart(&mut self) {
        self.cancelled = false;
    }
}

/// Wide nodes still to visit, and near faces still to add.
#[derive(Debug, Default)]
struct TraversalStack {
    wide_nodes: Vec<u32>,
    near: NearFaces,
}

/// Where clusters add up to this many times their sum they cancel, and their errors weigh more.
const CANCELLING: f32 = 1.1;

/// A cluster that the traversal visits.
struct ClusterVisit<'a> {
    pub(crate) wide_node: &'a WideNode,
    /// Its place in the wide node.
    pub(crate) place: usize,
    pub(crate) cluster: &'a Cluster,
    /// Sine of the angle between its axis and the line from the packet's centre.
    pub(crate) sine: f32,
}

/// The sums of a traversal.
trait Sums<S: Simd> {
    /// Adds a cluster that is perhaps far; false if it is not, and nothing is added.
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        visit: &ClusterVisit<'_>,
    ) -> bool;

    /// Where near faces are added.
    fn near_sums(&mut self) -> &mut [f32x16<S>; 2];
}

impl TraversalStack {
    /// Adds all clusters that are far and all near faces to `sums`.
    #[inline(always)]
    fn traverse<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        limits: &Limits<'_>,
        sums: &mut impl Sums<S>,
    ) {
        let acceptance = AcceptanceTest::new(tree, packet, query, limits);
        self.near.prepare(tree.bvh.faces.len());
        self.wide_nodes.clear();
        self.wide_nodes.push(0);
        while let Some(id) = self.wide_nodes.pop() {
            let wide_node = &tree.wide_nodes[id as usize];
            let clusters = &tree.clusters[id as usize];
            // Acceptance test of all members of a wide node at once.
            let ([reached, perhaps_far], sines) = acceptance.evaluate(packet.simd, wide_node);
            if tree.is_large {
                prefetch_wide_node(tree, wide_node, clusters, reached, perhaps_far);
            }
            let mut members = wide_node.top & reached;
            while members != 0 {
                let place = members.trailing_zeros() as usize;
                members &= members - 1;
                // Far members by their expansion.
                if perhaps_far >> place & 1 == 1 {
                    let visit = ClusterVisit {
                        wide_node,
                        place,
                        cluster: &clusters[place],
                        sine: sines[place],
                    };
                    if sums.add_if_far(tree, packet, query, &visit) {
                        continue;
                    }
                }
                // Near members: a face, or further down.
                match wide_node.children[place] {
                    Child::Face(face) => {
                        let near = &mut self.near;
                        near.add(tree, packet, query, face as usize, sums.near_sums());
                    }
                    Child::Members(child) => members |= child & reached,
                    Child::WideNode(child) => self.wide_nodes.push(child),
                }
            }
        }
        self.near.add_pending(tree, packet, query, sums.near_sums());
    }
}

/// Prefetches the clusters, faces and wide nodes that the traversal will most likely use: those of
/// large meshes lie in distant caches.
#[inline(always)]
fn prefetch_wide_node(
    tree: &PacketTree<'_>,
    wide_node: &WideNode,
    clusters: &[Cluster; WIDTH],
    reached: u32,
    perhaps_far: u32,
) {
    let mut members = wide_node.top & reached;
    while members != 0 {
        let place = members.trailing_zeros() as usize;
        members &= members - 1;
        if perhaps_far >> place & 1 == 1 {
            fetch_value(&clusters[place]);
            continue;
        }
        match wide_node.children[place] {
            Child::Face(face) => fetch_value(&tree.bvh.faces[face as usize]),
            Child::Members(child) => members |= child & reached,
            Child::WideNode(child) => fetch_value(&tree.wide_nodes[child as usize]),
        }
    }
}

/// Clusters pending for one point. Reused from point to point.
#[derive(Debug, Default)]
#[repr(align(64))]
struct PendingClusters {
    /// The point from their centres.
    from: [Lanes; 3],
    terms: [Lanes; TERMS],
    len: usize,
}

impl PendingClusters {
    /// To be called only where there is room.
    #[inline(always)]
    pub(crate) fn push(&mut self, point: DVec3, cluster: &Cluster) {
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

    /// Whether there is room for no more.
    #[inline(always)]
    fn is_full(&self) -> bool {
        self.len == LANES
    }

    /// Adds the pending clusters.
    #[inline(always)]
    pub(crate) fn add_to<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
        magnitude: &mut f32x16<S>,
    ) {
        // Unused lanes are out of reach.
        for k in 0..3 {
            self.from[k][self.len..].fill(1e9);
        }
        self.len = 0;
        let simd = query.xi.token();
        let mut r = [query.inverse; 3];
        for (r, from) in r.iter_mut().zip(self.from) {
            *r *= f32x16::simd_from(simd, from);
        }
        FarFieldView::from_ratio(r).add(tree, &self.terms, query, sum, magnitude);
    }
}

/// See [`PacketDensity::integral`].
#[simd]
pub(crate) fn integral<S: Simd>(
    simd: S,
    tree: &PacketTree<'_>,
    point: DVec3,
    distance: f32,
    traversal: &mut Traversal,
) -> [f32; 2] {
    let packet = Packet::of_one(simd, point);
    let query = Query::new(tree, packet.splat(distance));
    let limits = |cancelled| Limits::new(&tree.accuracy, cancelled);
    let first = traversal.cancelled;
    let (mut sum, mut cancelled) =
        accumulate_single(tree, &packet, &query, &limits(first), traversal);
    if cancelled && !first {
        (sum, cancelled) = accumulate_single(tree, &packet, &query, &limits(true), traversal);
    }
    traversal.cancelled = cancelled;
    sum
}

/// The sum over clusters that are far and near faces, and whether clusters cancel.
#[inline(always)]
fn accumulate_single<S: Simd>(
    tree: &PacketTree<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    traversal: &mut Traversal,
) -> ([f32; 2], bool) {
    let zero = packet.splat(0.0);
    let mut sums = SingleSums {
        clusters: &mut traversal.clusters,
        far: [zero; 2],
        magnitude: zero,
        near: [zero; 2],
    };
    traversal
        .path
        .traverse(tree, packet, query, limits, &mut sums);
    sums.add_pending(tree, query);
    let SingleSums {
        far,
        magnitude,
        near,
        ..
    } = sums;
    // Every lane has the faces, each its clusters.
    let sum = [
        far[0].reduce_sum() + near[0][0],
        far[1].reduce_sum() + near[1][0],
    ];
    let total = sum[0].abs() + sum[1].abs();
    (sum, magnitude.reduce_sum() > CANCELLING * total)
}

/// The sums of one point.
struct SingleSums<'a, S: Simd> {
    clusters: &'a mut PendingClusters,
    /// Over clusters, lane by lane.
    far: [f32x16<S>; 2],
    /// Over the sizes of what clusters add.
    magnitude: f32x16<S>,
    /// Over faces, the same in every lane.
    near: [f32x16<S>; 2],
}

impl<S: Simd> SingleSums<'_, S> {
    #[inline(always)]
    fn add_pending(&mut self, tree: &PacketTree<'_>, query: &Query<S>) {
        let (far, magnitude) = (&mut self.far, &mut self.magnitude);
        self.clusters.add_to(tree, query, far, magnitude);
    }
}

impl<S: Simd> Sums<S> for SingleSums<'_, S> {
    /// For one point the acceptance test of the wide node suffices.
    #[inline(always)]
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        visit: &ClusterVisit<'_>,
    ) -> bool {
        self.clusters.push(packet.centre, visit.cluster);
        if self.clusters.is_full() {
            self.add_pending(tree, query);
        }
        true
    }

    #[inline(always)]
    fn near_sums(&mut self) -> &mut [f32x16<S>; 2] {
        &mut self.near
    }
}

/// See [`PacketDensity::integrals`].
#[simd]
pub(crate) fn integrals<S: Simd>(
    simd: S,
    tree: &PacketTree<'_>,
    points: &Points,
    distances: &Lanes,
    traversal: &mut Traversal,
) -> [Lanes; 2] {
    let packet = Packet::new(simd, points);
    let query = Query::new(tree, f32x16::simd_from(simd, *distances));
    let limits = |cancelled| Limits::new(&tree.accuracy, cancelled);
    let first = traversal.cancelled;
    let (mut sum, mut cancelled) =
        accumulate_packet(tree, &packet, &query, &limits(first), traversal);
    if cancelled && !first {
        (sum, cancelled) = accumulate_packet(tree, &packet, &query, &limits(true), traversal);
    }
    // Neighbours are alike: mostly saves the first of two attempts.
    traversal.cancelled = cancelled;
    let zero = packet.splat(0.0);
    // Lanes to leave out hold numbers without meaning.
    sum.map(|s| query.counts.select(s, zero).into())
}

/// The sum over clusters that are far and near faces, and whether clusters cancel.
#[inline(always)]
fn accumulate_packet<S: Simd>(
    tree: &PacketTree<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    limits: &Limits<'_>,
    traversal: &mut Traversal,
) -> ([f32x16<S>; 2], bool) {
    let zero = packet.splat(0.0);
    let mut sums = PacketSums {
        limits,
        sum: [zero; 2],
        magnitude: zero,
    };
    traversal
        .path
        .traverse(tree, packet, query, limits, &mut sums);
    let PacketSums { sum, magnitude, .. } = sums;
    let total = sum[0].abs() + sum[1].abs();
    let cancels = magnitude.simd_gt(total * CANCELLING) & query.counts;
    (sum, cancels.any_true())
}

/// The sums of sixteen points.
struct PacketSums<'a, S: Simd> {
    limits: &'a Limits<'a>,
    /// Over clusters and faces.
    sum: [f32x16<S>; 2],
    /// Over the sizes of what clusters add.
    magnitude: f32x16<S>,
}

impl<S: Simd> Sums<S> for PacketSums<'_, S> {
    #[inline(always)]
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        visit: &ClusterVisit<'_>,
    ) -> bool {
        let cluster = visit.cluster;
        let view = FarFieldView::new(packet, query, cluster);
        let axis = (visit.wide_node.axis_of(visit.place), visit.sine);
        let is_far = view.is_far(tree, cluster, axis, query, self.limits.limit_for(cluster));
        if is_far {
            let (sum, magnitude) = (&mut self.sum, &mut self.magnitude);
            view.add(tree, &cluster.terms, query, sum, magnitude);
        }
        is_far
    }

    #[inline(always)]
    fn near_sums(&mut self) -> &mut [f32x16<S>; 2] {
        &mut self.sum
    }
}

/// Distances and density integrals of packets.
pub(crate) struct PacketDensity<'a> {
    tree: PacketTree<'a>,
    pub(super) level: Level,
}

impl<'a> PacketDensity<'a> {
    /// Prepares for a relative L2 error of `tolerance`.
    pub(crate) fn new(bvh: &'a Bvh, table: &CumulativeKernel, tolerance: f64) -> Self {
        Self {
            tree: PacketTree::new(bvh, table, tolerance),
            level: level::native(),
        }
    }

    /// Largest distance of a corner of a face (leaf order) from its centroid.
    pub(crate) fn size_of_face(&self, index: usize) -> f32 {
        self.tree.distance.facet(index).disc.radius
    }

    /// In units of the faces near, the distance up to which few of them are in far clusters: less
    /// of the surface is far at smaller tolerances.
    pub(crate) fn fine(&self) -> f32 {
        (15.0 / self.tree.accuracy.far.size) as f32
    }

    /// See `PacketDistance::find_nearest`.
    pub(crate) fn distances(&self, points: &Points, hint: &mut usize) -> Lanes {
        self.tree.distance.find_nearest(points, hint)
    }

    /// Real and imaginary part of the integral of the unit kernel over the solid angle, at points
    /// with these distances. Points of distance zero are left out (zero).
    pub(crate) fn integrals(
        &self,
        points: &Points,
        distances: &Lanes,
        traversal: &mut Traversal,
    ) -> [Lanes; 2] {
        dispatch_lanes!(self.level, simd => integrals(simd, &self.tree, points, distances, traversal))
    }

    /// The same at one point whose distance is not zero: where faces are so small that neighbouring
    /// points have hardly any clusters in common.
    pub(crate) fn integral(
        &self,
        point: DVec3,
        distance: f32,
        traversal: &mut Traversal,
    ) -> [f32; 2] {
        dispatch_lanes!(self.level, simd => integral(simd, &self.tree, point, distance, traversal))
    }
}
