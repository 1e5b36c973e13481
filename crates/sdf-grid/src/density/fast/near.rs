//! Edge integrals of one face for a packet; the formulas are those of
//! [`crate::density::edge_integral`].

use fearless_simd::{f32x16, mask32x16, prelude::*};

use super::PacketDensity;
use super::kernel::{MAX_POINTS, PacketKernel, atan2};
use super::packet::{Packet, View};

/// What all faces share for one packet: distances and what follows from them.
pub(crate) struct Query<S: Simd> {
    /// Distances; zero in lanes to leave out.
    pub(crate) xi: f32x16<S>,
    /// `1 / xi`.
    pub(crate) inverse: f32x16<S>,
    /// The square of the distance within which boundary points count.
    pub(crate) reach_squared: f32x16<S>,
}

/// The kernel varies over `sqrt(sigma)` along an edge, and whatever sigma over about this to the
/// power of -1/2, in units of the distance.
const BROAD: f32 = 3.0;

/// Adds the integral over face `index` to `sum`.
#[inline(always)]
pub(crate) fn add_face<S: Simd>(
    density: &PacketDensity<'_>,
    packet: &Packet<S>,
    query: &Query<S>,
    index: usize,
    sum: &mut [f32x16<S>; 2],
) {
    let facet = density.distance.facet(index);
    let view = View::new(packet, &density.bvh.faces[index], facet);
    let active = view.distance_squared(packet).simd_lt(query.reach_squared);
    if !active.any_true() {
        return;
    }
    let kernel = &density.kernel;
    let k0 = kernel.rise_from_below(view.height.abs() * query.inverse);
    let plane = Plane {
        active,
        height_squared: view.height * view.height,
        beyond: [kernel.beyond[0] - k0[0], kernel.beyond[1] - k0[1]],
        k0,
        density: density.settings.density as f32 * (1.0 / kernel.sigma + BROAD).sqrt(),
    };
    let mut integral = [packet.splat(0.0); 2];
    // Where no edge is within reach the face is as good as the whole plane.
    let rest = query.reach_squared - plane.height_squared;
    let inner = view.innermost();
    let outside = active & (inner.simd_le(0.0) | (inner * inner).simd_lt(rest));
    if outside.any_true() {
        for k in 0..view.count {
            plane.add_edge(kernel, query, &view, k, &mut integral);
        }
    } else {
        let turn = 2.0 * std::f32::consts::PI;
        integral = [plane.beyond[0] * turn, plane.beyond[1] * turn];
    }
    let factor = view.height * query.inverse;
    for c in 0..2 {
        // Lanes out of reach hold numbers without meaning.
        sum[c] = active.select(integral[c].mul_add(factor, sum[c]), sum[c]);
    }
}

/// What the edges of a face share.
struct Plane<S: Simd> {
    active: mask32x16<S>,
    height_squared: f32x16<S>,
    /// `K(|h| / xi) - K(0)`.
    k0: [f32x16<S>; 2],
    /// `K(infinity) - K(|h| / xi)`.
    beyond: [f32x16<S>; 2],
    /// Gauss points per half length in units of `xi`.
    density: f32,
}

impl<S: Simd> Plane<S> {
    #[inline(always)]
    fn add_edge(
        &self,
        kernel: &PacketKernel,
        query: &Query<S>,
        view: &View<S>,
        k: usize,
        sum: &mut [f32x16<S>; 2],
    ) {
        let (d, start, end) = (view.d[k], view.start[k], view.end[k]);
        let zero = f32x16::splat(d.token(), 0.0);
        let rest = query.reach_squared - self.height_squared;
        let clip = (rest - d * d).max(zero).sqrt();
        let (from, to) = (start.max(-clip).min(clip), end.max(-clip).min(clip));
        let clipped = self.active & (start.simd_lt(-clip) | end.simd_gt(clip));
        if clipped.any_true() {
            let angle = outer_angle(d, [start, end], [from, to], clip);
            sum[0] = angle.mul_add(self.beyond[0], sum[0]);
            sum[1] = angle.mul_add(self.beyond[1], sum[1]);
        }
        let half = (to - from) * 0.5;
        let longest = self.active.select(half * query.inverse, zero).reduce_max();
        if longest > 0.0 {
            let count = (1.5 + self.density * longest).ceil() as usize;
            let integral = self.inner(kernel, query, d, [from, to], count.min(MAX_POINTS));
            for c in 0..2 {
                sum[c] = integral[c].mul_add(half * d, sum[c]);
            }
        }
    }

    /// The mean over the edge of `2 (K(u) - K0) / (d^2 + t^2)` between `ends`.
    #[inline(always)]
    fn inner(
        &self,
        kernel: &PacketKernel,
        query: &Query<S>,
        d: f32x16<S>,
        ends: [f32x16<S>; 2],
        count: usize,
    ) -> [f32x16<S>; 2] {
        let inverse_squared = query.inverse * query.inverse;
        let edge = Edge {
            half: (ends[1] - ends[0]) * 0.5,
            middle: (ends[1] + ends[0]) * 0.5,
            d2: d * d,
            // Nearer to the foot than this, numerator and denominator are both rounding noise; the
            // quotient is smooth and hardly differs there.
            least: query.xi * query.xi * (4e-4 * kernel.sigma),
            inverse_squared,
            base: self.height_squared * inverse_squared - 1.0,
        };
        let mut sum = [f32x16::splat(d.token(), 0.0); 2];
        let (pairs, last) = kernel.rules[count].as_chunks::<2>();
        for pair in pairs {
            edge.add(kernel, *pair, self.k0, &mut sum);
        }
        for single in last {
            edge.add(kernel, [*single], self.k0, &mut sum);
        }
        sum
    }
}

/// The part of an edge within reach.
struct Edge<S: Simd> {
    half: f32x16<S>,
    middle: f32x16<S>,
    d2: f32x16<S>,
    least: f32x16<S>,
    inverse_squared: f32x16<S>,
    base: f32x16<S>,
}

impl<S: Simd> Edge<S> {
    /// Adds Gauss points, several at once, each a place in `-1 ..= 1` and a weight.
    #[inline(always)]
    fn add<const N: usize>(
        &self,
        kernel: &PacketKernel,
        points: [[f32; 2]; N],
        k0: [f32x16<S>; 2],
        sum: &mut [f32x16<S>; 2],
    ) {
        let simd = self.half.token();
        let (mut r2, mut y) = ([self.half; N], [self.half; N]);
        for i in 0..N {
            let place = f32x16::splat(simd, points[i][0]);
            let t = self.half.mul_add(place, self.middle);
            r2[i] = t.mul_add(t, self.d2).max(self.least);
            y[i] = r2[i].mul_add(self.inverse_squared, self.base);
        }
        let rise = kernel.rise(y);
        for i in 0..N {
            let w = points[i][1] / r2[i];
            for c in 0..2 {
                sum[c] = (rise[i][c] - k0[c]).mul_add(w, sum[c]);
            }
        }
    }
}

/// The angle that the parts of an edge beyond the reach fill about the foot, with the sign of `d`.
#[inline(always)]
fn outer_angle<S: Simd>(
    d: f32x16<S>,
    whole: [f32x16<S>; 2],
    inner: [f32x16<S>; 2],
    clip: f32x16<S>,
) -> f32x16<S> {
    let d2 = d * d;
    // The angle of an interval [a, b] is that of the complex number d^2 + a b + i d (b - a).
    let (x1, y1) = (whole[0].mul_add(whole[1], d2), d * (whole[1] - whole[0]));
    let (x2, y2) = (inner[0].mul_add(inner[1], d2), d * (inner[1] - inner[0]));
    let none = clip.simd_le(0.0);
    let x2 = none.select(f32x16::splat(d.token(), 1.0), x2);
    let y2 = none.select(f32x16::splat(d.token(), 0.0), y2);
    let (x, y) = (x1 * x2 + y1 * y2, y1 * x2 - x1 * y2);
    atan2(y.abs(), x).copysign(d)
}
