//! Near faces of a packet: collected by the traversal, then integrated edge by edge with the
//! formulas of [`crate::field::point::edge_integral`].
//!
//! The kernel along an edge is the same for both faces of the edge: where both are near it is
//! evaluated once. Where both lie in one plane the edge cancels.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;

use super::distance::View;
use super::kernel::{MAX_POINTS, PacketKernel};
use super::points::{Lanes, Packet};
use super::tree::{PacketTree, Query};
use crate::support::angle::upper_angle;

/// One of the faces of an edge, relative to every point.
#[derive(Clone, Copy)]
pub(crate) struct Side<S: Simd> {
    /// Distance of the foot from the edge's line, positive towards the face.
    pub(crate) d: f32x16<S>,
    /// Signed height above the plane.
    pub(crate) height: f32x16<S>,
    /// `h / xi`.
    pub(crate) factor: f32x16<S>,
    /// `K(|h| / xi) - K(0)`.
    pub(crate) k0: [f32x16<S>; 2],
    /// `K(infinity) - K(|h| / xi)`.
    pub(crate) beyond: [f32x16<S>; 2],
}

/// An edge relative to every point: positions along its line, from the point's own.
struct Line<S: Simd> {
    ends: [f32x16<S>; 2],
    /// The part within reach.
    inner: [f32x16<S>; 2],
    /// Half the length of all that is within reach of the infinite line.
    clip: f32x16<S>,
    /// Squared distance of the point from the line.
    apart: f32x16<S>,
}

impl<S: Simd> Line<S> {
    #[inline(always)]
    pub(crate) fn new(query: &Query<S>, side: &Side<S>, ends: [f32x16<S>; 2]) -> Self {
        let zero = f32x16::splat(side.d.token(), 0.0);
        let apart = side.d.mul_add(side.d, side.height * side.height);
        let clip = (query.reach_squared - apart).max(zero).sqrt();
        Self {
            ends,
            inner: [ends[0].max(-clip).min(clip), ends[1].max(-clip).min(clip)],
            clip,
            apart,
        }
    }

    /// Adds what the edge contributes to the integrals over its faces.
    #[inline(always)]
    pub(crate) fn add<const N: usize>(
        &self,
        tree: &PacketTree<'_>,
        query: &Query<S>,
        sides: [Side<S>; N],
        sum: &mut [f32x16<S>; 2],
    ) {
        let zero = f32x16::splat(self.clip.token(), 0.0);
        // Parts of the edge beyond the reach: angles.
        let [start, end] = self.ends;
        let clipped = query.counts & (start.simd_lt(-self.clip) | end.simd_gt(self.clip));
        if clipped.any_true() {
            for side in &sides {
                let angle = self.outer_angle(side.d) * side.factor;
                for (sum, beyond) in sum.iter_mut().zip(side.beyond) {
                    *sum = angle.mul_add(beyond, *sum);
                }
            }
        }
        // Number of Gauss points for the part within reach.
        let half = (self.inner[1] - self.inner[0]) * 0.5;
        let longest = query.counts.select(half * query.inverse, zero).reduce_max();
        if longest <= 0.0 {
            return;
        }
        let kernel = &tree.kernel;
        let count = ((1.5 + query.density * longest).ceil() as usize).min(MAX_POINTS);
        // Nearer to the foot than this, numerator and denominator are both rounding noise; the
        // quotient is smooth and hardly differs there.
        let least = query.xi * query.xi * (4e-4 * kernel.sigma);
        let mut near = zero.simd_lt(zero);
        for side in &sides {
            near |= (side.d * side.d).simd_lt(least);
        }
        // Quadrature, with a separate rule next to the foot.
        let middle = (self.inner[1] + self.inner[0]) * 0.5;
        let span = [middle, half];
        if (near & query.counts).any_true() {
            for side in &sides {
                let apart = side.height * side.height;
                let integral = near_foot(kernel, query, side, apart, span, least, count);
                add_integral(side, integral, half, sum);
            }
        } else {
            let integrals = self.away(kernel, query, &sides, span, count);
            for (side, integral) in sides.iter().zip(integrals) {
                add_integral(side, integral, half, sum);
            }
        }
    }

    /// The means over the edge of `2 (K(u) - K0) / (d^2 + t^2)`, where no point's foot is next to
    /// the edge's line.
    #[inline(always)]
    fn away<const N: usize>(
        &self,
        kernel: &PacketKernel,
        query: &Query<S>,
        sides: &[Side<S>; N],
        [middle, half]: [f32x16<S>; 2],
        count: usize,
    ) -> [[f32x16<S>; 2]; N] {
        let zero = f32x16::splat(half.token(), 0.0);
        let inverse_squared = query.inverse * query.inverse;
        let base = self.apart.mul_add(inverse_squared, zero - 1.0);
        let mut sums = [[zero; 2]; N];
        let mut squares = [zero; N];
        for n in 0..N {
            squares[n] = sides[n].d * sides[n].d;
        }
        // Gauss quadrature; the kernel is evaluated once for all sides.
        for [place, weight] in &kernel.rules[count] {
            let t = half.mul_add(*place, middle);
            let t2 = t * t;
            let [rise] = kernel.rise([t2.mul_add(inverse_squared, base)]);
            let mut w = [zero; N];
            for n in 0..N {
                w[n] = t2 + squares[n];
            }
            quotients(*weight, &mut w);
            for n in 0..N {
                for c in 0..2 {
                    sums[n][c] = (rise[c] - sides[n].k0[c]).mul_add(w[n], sums[n][c]);
                }
            }
        }
        sums
    }

    /// The angle that the parts of the edge beyond the reach fill about the foot, with the sign of
    /// `d`.
    #[inline(always)]
    fn outer_angle(&self, d: f32x16<S>) -> f32x16<S> {
        let d2 = d * d;
        let (whole, inner) = (self.ends, self.inner);
        // The angle of an interval [a, b] is that of the complex number d^2 + a b + i d (b - a).
        let (x1, y1) = (whole[0].mul_add(whole[1], d2), d * (whole[1] - whole[0]));
        let (x2, y2) = (inner[0].mul_add(inner[1], d2), d * (inner[1] - inner[0]));
        let none = self.clip.simd_le(0.0);
        let x2 = none.select(f32x16::splat(d.token(), 1.0), x2);
        let y2 = none.select(f32x16::splat(d.token(), 0.0), y2);
        let (x, y) = (x1 * x2 + y1 * y2, y1 * x2 - x1 * y2);
        upper_angle(y.abs(), x).copysign(d)
    }
}

/// Replaces one or two denominators by the quotients of `weight` and each, with one division.
#[inline(always)]
fn quotients<S: Simd, const N: usize>(weight: f32, denominators: &mut [f32x16<S>; N]) {
    match denominators.as_mut_slice() {
        [a, b] => {
            let both = weight / (*a * *b);
            (*a, *b) = (both * *b, both * *a);
        }
        others => {
            for d in others {
                *d = weight / *d;
            }
        }
    }
}

#[inline(always)]
fn add_integral<S: Simd>(
    side: &Side<S>,
    integral: [f32x16<S>; 2],
    half: f32x16<S>,
    sum: &mut [f32x16<S>; 2],
) {
    let factor = half * side.d * side.factor;
    for c in 0..2 {
        sum[c] = integral[c].mul_add(factor, sum[c]);
    }
}

/// The same mean for one face where feet may lie next to the line.
#[inline(always)]
fn near_foot<S: Simd>(
    kernel: &PacketKernel,
    query: &Query<S>,
    side: &Side<S>,
    height_squared: f32x16<S>,
    [middle, half]: [f32x16<S>; 2],
    least: f32x16<S>,
    count: usize,
) -> [f32x16<S>; 2] {
    let inverse_squared = query.inverse * query.inverse;
    let base = height_squared * inverse_squared - 1.0;
    let d2 = side.d * side.d;
    let mut sum = [f32x16::splat(half.token(), 0.0); 2];
    for [place, weight] in &kernel.rules[count] {
        let t = half.mul_add(*place, middle);
        let r2 = t.mul_add(t, d2).max(least);
        let [rise] = kernel.rise([r2.mul_add(inverse_squared, base)]);
        let w = *weight / r2;
        for c in 0..2 {
            sum[c] = (rise[c] - side.k0[c]).mul_add(w, sum[c]);
        }
    }
    sum
}

/// Faces added at a time: what is kept of them should stay in the first-level cache.
const BATCH: usize = 48;

/// Near faces pending. Reused from packet to packet; 34 KB, and 4 bytes per face of the
/// mesh.
#[derive(Debug, Default)]
pub(crate) struct NearFaces {
    /// The first `len` are pending.
    faces: Vec<NearFace>,
    len: usize,
    /// By face: its place among the pending ones, if it is there.
    places: Vec<u32>,
}

/// A face relative to the points of a packet.
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

    /// The place of a face if it is pending.
    fn place(&self, face: usize) -> Option<usize> {
        let place = self.places[face] as usize;
        (place < self.len && self.faces[place].index as usize == face).then_some(place)
    }

    /// Adds the integral over face `index` to `sum`, now or with [`NearFaces::add_pending`].
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
        let pending = &mut self.faces[self.len];
        pending.index = index as u32;
        pending.height = view.height.into();
        pending.k0 = k0.map(Into::into);
        for k in 0..view.count {
            pending.d[k] = view.d[k].into();
        }
        (pending.start, pending.end) = (view.first, view.last);
        self.len += 1;
        if self.len == BATCH {
            self.add_pending(tree, packet, query, sum);
        }
    }

    /// Adds the pending faces.
    #[inline(always)]
    pub(crate) fn add_pending<S: Simd>(
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
                // Edges shared by two coplanar faces cancel; others are evaluated once.
                let twin = tree.shared_edges[index][k].get();
                let twin = twin.and_then(|(j, l, flat)| Some((self.place(j)?, l, flat)));
                let other = match twin {
                    Some((_, _, true)) => continue,
                    // Done with the other face.
                    Some((j, _, false)) if j < i => continue,
                    Some((j, l, false)) => Some((&self.faces[j], l)),
                    None => None,
                };
                // The edge as the points see it.
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
