//! Near faces of a packet: collected by the walk, then added edge by edge; the formulas are those
//! of [`crate::field::point::edge_integral`].
//!
//! The kernel along an edge is the same for both faces it belongs to: where both are near it is
//! evaluated once. Where both lie in one plane the edge does not count at all.

use fearless_simd::{f32x16, prelude::*};

use super::edge::{Line, Side};
use super::facet::View;
use super::lanes::Lanes;
use super::points::Packet;
use super::query::Query;
use super::tree::PacketTree;

/// Faces added at a time: what is kept of them should stay in the first-level cache.
const BATCH: usize = 48;

/// Near faces waiting to be added. Reused from packet to packet; 34 KB, and 4 bytes per face of the
/// mesh.
#[derive(Debug, Default)]
pub(crate) struct NearFaces {
    /// Waiting are the first `len`.
    faces: Vec<NearFace>,
    len: usize,
    /// By face: its place among those waiting, if it is there.
    places: Vec<u32>,
}

/// A face as the points of a packet see it.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
struct NearFace {
    height: Lanes,
    /// `K(|h| / xi) - K(0)`.
    k0: [Lanes; 2],
    /// As in [`View`].
    d: [Lanes; 4],
    start: [f32; 4],
    end: [f32; 4],
    index: u32,
}

impl NearFaces {
    /// Makes room for a mesh of `count` faces.
    pub(crate) fn prepare(&mut self, count: usize) {
        self.faces.resize_with(BATCH, Default::default);
        self.places.resize(count, 0);
    }

    /// The place of a face if it is waiting.
    fn place(&self, face: usize) -> Option<usize> {
        let place = self.places[face] as usize;
        (place < self.len && self.faces[place].index as usize == face).then_some(place)
    }

    /// Adds the integral over face `index` to `sum`, now or with [`NearFaces::add_waiting`].
    #[inline(always)]
    pub(crate) fn add<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        index: usize,
        sum: &mut [f32x16<S>; 2],
    ) {
        let face = &tree.bvh.faces[index];
        let view = View::new(packet, face, tree.distance.facet(index));
        let active = view.distance_squared(packet).simd_lt(query.reach_squared) & query.counts;
        if !active.any_true() {
            return;
        }
        let kernel = &tree.kernel;
        let mut k0 = kernel.rise_from_below(view.height.abs() * query.inverse);
        let within = (view.height * view.height).simd_lt(query.reach_squared);
        for (k0, whole) in k0.iter_mut().zip(kernel.beyond) {
            // Nothing is beyond a plane out of reach: not even what the kernel's polynomial leaves.
            *k0 = within.select(*k0, packet.splat(whole));
        }
        // Where no edge is within reach the face is as good as the whole plane.
        let rest = view.height.mul_add(-view.height, query.reach_squared);
        let inner = view.innermost();
        let outside = active & (inner.simd_le(0.0) | (inner * inner).simd_lt(rest));
        if !outside.any_true() {
            let turn = view.height * query.inverse * (2.0 * std::f32::consts::PI);
            for c in 0..2 {
                // Lanes out of reach hold numbers without meaning.
                let beyond = kernel.beyond[c] - k0[c];
                sum[c] = active.select(beyond.mul_add(turn, sum[c]), sum[c]);
            }
            return;
        }
        self.places[index] = self.len as u32;
        let waiting = &mut self.faces[self.len];
        waiting.index = index as u32;
        waiting.height = view.height.into();
        waiting.k0 = k0.map(Into::into);
        for k in 0..view.count {
            waiting.d[k] = view.d[k].into();
        }
        (waiting.start, waiting.end) = (view.first, view.last);
        self.len += 1;
        if self.len == BATCH {
            self.add_waiting(tree, packet, query, sum);
        }
    }

    /// Adds the faces that wait.
    #[inline(always)]
    pub(crate) fn add_waiting<S: Simd>(
        &mut self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        sum: &mut [f32x16<S>; 2],
    ) {
        for i in 0..self.len {
            let face = &self.faces[i];
            let index = face.index as usize;
            for k in 0..tree.bvh.faces[index].count {
                let twin = tree.twins[index][k].get();
                let twin = twin.and_then(|(j, l, flat)| Some((self.place(j)?, l, flat)));
                let other = match twin {
                    Some((_, _, true)) => continue,
                    // Done with the other face.
                    Some((j, _, false)) if j < i => continue,
                    Some((j, l, false)) => Some((&self.faces[j], l)),
                    None => None,
                };
                let along = tree.distance.facet(index).along(k);
                let along = packet.dot_add(-along, 0.0);
                let side = face.side(tree, packet, query, k);
                let line = Line::new(query, &side, [along + face.start[k], along + face.end[k]]);
                match other {
                    None => line.add(tree, query, [side], sum),
                    Some((other, l)) => {
                        let other = other.side(tree, packet, query, l);
                        line.add(tree, query, [side, other], sum);
                    }
                }
            }
        }
        self.len = 0;
    }
}

impl NearFace {
    #[inline(always)]
    fn side<S: Simd>(
        &self,
        tree: &PacketTree<'_>,
        packet: &Packet<S>,
        query: &Query<S>,
        k: usize,
    ) -> Side<S> {
        let load = |lanes: &Lanes| f32x16::simd_from(packet.simd, *lanes);
        let height = load(&self.height);
        let k0 = [load(&self.k0[0]), load(&self.k0[1])];
        let beyond = tree.kernel.beyond;
        Side {
            d: load(&self.d[k]),
            height,
            factor: height * query.inverse,
            k0,
            beyond: [beyond[0] - k0[0], beyond[1] - k0[1]],
        }
    }
}
