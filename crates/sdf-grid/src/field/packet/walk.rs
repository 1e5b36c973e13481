//! The walk over the tree: far clusters by their moments, near faces by edge integrals.

use fearless_simd::{f32x16, prelude::*};

use super::cluster::Cluster;
use super::glance::{Glance, Limits};
use super::groups::{Below, Group, WIDTH};
use super::near::NearFaces;
use super::points::Packet;
use super::query::Query;
use super::tree::PacketTree;
use super::waiting::WaitingClusters;
use crate::support::prefetch::fetch_value;

/// Working memory of the walk. Reused from packet to packet.
#[derive(Debug, Default)]
pub(crate) struct Walk {
    pub(super) path: Path,
    /// Clusters to add for a lone point.
    pub(super) clusters: WaitingClusters,
    /// Whether clusters cancelled at the packet before.
    pub(super) cancelled: bool,
}

impl Walk {
    /// Forgets the packet before: what it leaves changes results by what the tolerance allows.
    pub(crate) fn restart(&mut self) {
        self.cancelled = false;
    }
}

/// What the walk has yet to look at.
#[derive(Debug, Default)]
pub(crate) struct Path {
    groups: Vec<u32>,
    near: NearFaces,
}

/// Where clusters add up to this many times their sum they cancel, and their errors weigh more.
pub(crate) const CANCELLING: f32 = 1.1;

/// A cluster that the walk meets.
pub(crate) struct Met<'a> {
    pub(crate) group: &'a Group,
    /// Its place in the group.
    pub(crate) place: usize,
    pub(crate) cluster: &'a Cluster,
    /// Sine of the angle between its axis and the line from the packet's centre.
    pub(crate) sine: f32,
}

/// What a walk adds up.
pub(crate) trait Sums<S: Simd> {
    /// Adds a cluster that is perhaps far; false if it is not, and nothing is added.
    fn add_if_far(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        met: &Met<'_>,
    ) -> bool;

    /// Where near faces are added.
    fn near(&mut self) -> &mut [f32x16<S>; 2];
}

impl Path {
    /// Adds all clusters that are far and all near faces to `sums`.
    #[inline(always)]
    pub(crate) fn walk<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        limits: &Limits<'_>,
        sums: &mut impl Sums<S>,
    ) {
        let glance = Glance::new(tree, packet, query, limits);
        self.near.prepare(tree.bvh.faces.len());
        self.groups.clear();
        self.groups.push(0);
        while let Some(id) = self.groups.pop() {
            let group = &tree.groups[id as usize];
            let clusters = &tree.clusters[id as usize];
            let ([reached, perhaps_far], sines) = glance.at(packet.simd, group);
            if tree.is_large {
                ask_for(tree, group, clusters, reached, perhaps_far);
            }
            let mut members = group.top & reached;
            while members != 0 {
                let place = members.trailing_zeros() as usize;
                members &= members - 1;
                if perhaps_far >> place & 1 == 1 {
                    let met = Met {
                        group,
                        place,
                        cluster: &clusters[place],
                        sine: sines[place],
                    };
                    if sums.add_if_far(tree, packet, query, &met) {
                        continue;
                    }
                }
                match group.below[place] {
                    Below::Face(face) => {
                        let near = &mut self.near;
                        near.add(tree, packet, query, face as usize, sums.near());
                    }
                    Below::Members(below) => members |= below & reached,
                    Below::Group(below) => self.groups.push(below),
                }
            }
        }
        self.near.add_waiting(tree, packet, query, sums.near());
    }
}

/// Asks for what the walk will most likely take of a group, ahead of its use: of large meshes it
/// lies in distant caches.
#[inline(always)]
fn ask_for(
    tree: &PacketTree<'_>,
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
            fetch_value(&clusters[place]);
            continue;
        }
        match group.below[place] {
            Below::Face(face) => fetch_value(&tree.bvh.faces[face as usize]),
            Below::Members(below) => members |= below & reached,
            Below::Group(below) => fetch_value(&tree.groups[below as usize]),
        }
    }
}
