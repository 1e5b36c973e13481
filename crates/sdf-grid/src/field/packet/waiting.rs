//! Clusters that wait to be added for one point.

use fearless_simd::{f32x16, prelude::*};
use glam::{DVec3, Vec3};

use super::cluster::{Cluster, TERMS};
use super::lanes::{LANES, Lanes};
use super::query::Query;
use super::seen::Seen;
use super::tree::PacketTree;

/// Clusters waiting to be added for one point. Reused from point to point.
#[derive(Debug, Default)]
#[repr(align(64))]
pub(crate) struct WaitingClusters {
    /// The point from their centres.
    from: [Lanes; 3],
    terms: [Lanes; TERMS],
    len: usize,
}

impl WaitingClusters {
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
    pub(crate) fn is_full(&self) -> bool {
        self.len == LANES
    }

    /// Adds those that wait.
    #[inline(always)]
    pub(crate) fn add_to<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
        magnitude: &mut f32x16<S>,
    ) {
        // In places where none waits it is out of reach.
        for k in 0..3 {
            self.from[k][self.len..].fill(1e9);
        }
        self.len = 0;
        let simd = query.xi.token();
        let mut r = [query.inverse; 3];
        for (r, from) in r.iter_mut().zip(self.from) {
            *r *= f32x16::simd_from(simd, from);
        }
        Seen::at(r).add(tree, &self.terms, query, sum, magnitude);
    }
}
