//! What a patch's boundary edges subtract from the kernel's integral over the whole plane, for
//! sixteen samples.
//!
//! # Softening
//!
//! A boundary edge adds `x L + |h| Λ / 2` and more to `2π` times the integral over a patch, where
//! `x` is the distance of the edge's line from the sample's foot, `h` the height, `n = x² + h²`,
//! and `l` runs along the line. `L = ½ ∫ dl / R` has a pole on the line, and the angle `Λ` at which
//! the edge is seen from above has a step there if `h` is small. A sample that is wider than its
//! distance from the line would take both from its middle alone. Therefore, where `n < w`, with `w`
//! a share of the square of the sample's side, `L` uses `(w + n² / w) / 2` for `n`, and `Λ` uses
//! `h² + (w - n)² / 2w` for `h²`. The differences are those of an infinite line, and an edge takes
//! its share of them, so that they add up over the pieces of a line. Values away from the line do
//! not change, so the total impulse of a sample that crosses it is unchanged.

use fearless_simd::prelude::*;
use fearless_simd::{f32x16, mask32x16};
use glam::Vec2;

use super::curved::{Circle, circle_coordinates};
use super::kernel::{Quotients, coarse_angle, half_ln, splat};
use super::patches::BoundaryEdge;

/// A boundary edge's line relative to sixteen samples.
struct LineIntegrals<S: Simd> {
    /// Above or below, and its square.
    pub(super) height: f32x16<S>,
    pub(super) square: f32x16<S>,
    /// Distance of the line from the feet, and its square.
    pub(super) across: f32x16<S>,
    pub(super) flat: f32x16<S>,
    /// Squared distance of the line.
    pub(super) near: f32x16<S>,
}

/// For a piece of the line: half of `∫ dl / R`, and the angles that it subtends in the plane and
/// from above, `across ∫ dl / (across² + l²)` and `across |h| ∫ dl / ((across² + l²) R)`.
type LineTerms<S> = [f32x16<S>; 3];

impl<S: Simd> LineIntegrals<S> {
    /// From end to end, where the squared distances are as given.
    #[inline(always)]
    pub(super) fn piece(
        &self,
        [a, b]: [f32x16<S>; 2],
        [far_a, far_b]: [f32x16<S>; 2],
    ) -> LineTerms<S> {
        let (ra, rb) = (far_a.sqrt(), far_b.sqrt());
        let (pa, pb) = (ra + a.abs(), rb + b.abs());
        let product = a * b;
        let beside = product.simd_lt(0.0);
        // From the end at which nothing cancels.
        let above = beside.select(pa * pb, pa.max(pb)).max(1e-30);
        let below = beside.select(self.near, pa.min(pb)).max(1e-30);
        let wide = self.across.abs() * (b - a);
        let rise = self.height * self.across.abs() * b.mul_sub(ra, a * rb).max(0.0);
        self.newtonian(
            above / below,
            [wide, self.flat + product],
            [rise, self.flat.mul_add(ra * rb, self.square * product)],
        )
    }

    /// All of it in reach, so far to either side.
    #[inline(always)]
    fn chord(&self, side: f32x16<S>) -> LineTerms<S> {
        let above = side + 1.0;
        let wide = self.across.abs() * (side + side);
        let square = side * side;
        self.newtonian(
            above * above / self.near.min(1.0).max(1e-30),
            [wide, self.flat - square],
            [self.height * wide, self.flat - self.square * square],
        )
    }

    /// Of the argument of a logarithm, and of sines and cosines of angles.
    #[inline(always)]
    fn newtonian(
        &self,
        ratio: f32x16<S>,
        angle: [f32x16<S>; 2],
        lifted: [f32x16<S>; 2],
    ) -> LineTerms<S> {
        [
            half_ln(ratio),
            coarse_angle(angle[0], angle[1]).copysign(self.across),
            coarse_angle(lifted[0], lifted[1]).copysign(self.across),
        ]
    }
}

/// `w` in units of the square of half a sample's side: least errors of pairs in contact. More blurs
/// what crosses the boundary edge at an angle.
const SOFTENING: f32 = 0.8;

/// Corrections that soften an edge: to two of its terms, and the slopes of the gain in `2π` times
/// the value.
struct Softening<S: Simd> {
    /// Added to the logarithm and to the angle.
    pub(super) terms: [f32x16<S>; 2],
    /// Slopes of the gain with the squared height, the distance of the line, and the position along
    /// it.
    pub(super) rise: f32x16<S>,
    pub(super) across: f32x16<S>,
    pub(super) along: f32x16<S>,
}

/// Softening width: `w`, and the inverse of its root.
struct SofteningWidth<S: Simd> {
    pub(super) square: f32x16<S>,
    scale: f32x16<S>,
}

impl<S: Simd> SofteningWidth<S> {
    /// For samples as large as squares of this half side.
    #[inline(always)]
    pub(super) fn new(half: f32x16<S>) -> Self {
        let square = (half * half * SOFTENING).max(1e-12);
        Self {
            square,
            scale: splat(half.token(), 1.0) / square.sqrt(),
        }
    }
}

impl<S: Simd> Softening<S> {
    /// Softening of a line between two ends.
    #[inline(always)]
    pub(super) fn new(
        integrals: &LineIntegrals<S>,
        ends: [f32x16<S>; 2],
        wide: &SofteningWidth<S>,
    ) -> Self {
        let simd = wide.square.token();
        let (scale, per_wide, wide) = (wide.scale, wide.scale * wide.scale, wide.square);
        let zero = splat(simd, 0.0);
        let (across, height) = (integrals.across, integrals.height);
        // Of every product of two of the lengths that are divided by, one quotient is enough.
        let near = integrals.near.max(1e-15);
        let soft = (near * near * per_wide + wide) * 0.5;
        let both = splat(simd, 1.0) / (near * soft);
        let per_near = soft * both;
        let ratio = near * near * both;
        let logarithm = half_ln(ratio);
        let slope = (per_near - ratio * per_wide) * 0.5;
        // Of the angle.
        let left = (wide - near).max(zero);
        let square = left * left * 0.5 * per_wide + integrals.square;
        let high = square.max(1e-15).sqrt();
        let rise = across.abs() * (high - height).max(zero);
        let half_angle = coarse_angle(rise, height.mul_add(high, integrals.flat));
        let angle = (half_angle + half_angle).copysign(across);
        let less = left * per_wide * -1.0;
        let per_far = splat(simd, 1.0) / (high * (integrals.flat + square).max(1e-15));
        let up = (less + 1.0) * height * per_far - per_near;
        let out = less * integrals.flat * per_far - square * per_far + height * per_near;
        // The share between the ends, only where the line is near.
        let [(a, da), (b, db)] = ends.map(
            #[inline(always)]
            |end| smooth_step(end * scale),
        );
        let counts = integrals.near.simd_lt(wide);
        let taper = counts.select(b - a, zero);
        let along = counts.select((da - db) * scale, zero);
        let gain = across * logarithm + height * angle * 0.5;
        Self {
            terms: [logarithm * taper, angle * taper],
            rise: across * (up * 0.5 + slope) * taper,
            across: (integrals.flat * slope * 2.0 + height * out) * taper,
            along: gain * along,
        }
    }
}

/// Rises smoothly from a half below zero at -1 to a half at 1, and its slope.
#[inline(always)]
fn smooth_step<S: Simd>(t: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
    let t = t.max(-1.0).min(1.0);
    let square = t * t;
    (t * (0.75 - square * 0.25), 0.75 - square * 0.75)
}

/// A boundary edge relative to the foot of a cluster's centre.
pub(super) struct EdgeView<'a> {
    edge: &'a BoundaryEdge,
    foot: Vec2,
    /// Distance of the boundary edge's line, positive if the foot is inside.
    across: f32,
    /// Positions of its ends on the line, from the line's nearest point.
    ends: [f32; 2],
}

/// Sixteen samples above a patch.
pub(super) struct LocalSamples<S: Simd> {
    /// Signed, of each.
    pub(super) height: f32x16<S>,
    /// Its square, at most one.
    pub(super) square: f32x16<S>,
    /// Their feet, from that of the cluster's middle.
    pub(super) feet: [f32x16<S>; 2],
    /// Half the side of squares of their area, and the width by which they soften an edge.
    pub(super) half: f32x16<S>,
    wide: SofteningWidth<S>,
}

/// Sums over boundary edges of what they subtract from a patch's integral, times `2π`.
pub(super) struct EdgeSums<S: Simd> {
    /// The angles that they subtend in the plane and from above it.
    pub(super) angle: f32x16<S>,
    pub(super) lifted: f32x16<S>,
    /// The rest, its slope with the squared height, and with both directions along the patch.
    pub(super) rest: f32x16<S>,
    pub(super) height_slope: f32x16<S>,
    pub(super) along: [f32x16<S>; 2],
}

impl<S: Simd> LocalSamples<S> {
    #[inline(always)]
    pub(super) fn new(height: f32x16<S>, feet: [f32x16<S>; 2], half: f32x16<S>) -> Self {
        Self {
            height,
            square: (height * height).min(1.0),
            feet,
            half,
            wide: SofteningWidth::new(half),
        }
    }
}

/// A boundary edge's line relative to the feet of sixteen samples.
pub(super) struct EdgeLine<S: Simd> {
    /// Distance of the feet, positive if they are inside.
    pub(super) across: f32x16<S>,
    /// Position of the edge's beginning on the line, from its nearest point.
    pub(super) start: f32x16<S>,
    /// Unit vectors along it and out of the patch, where it is nearest.
    pub(super) along: [f32x16<S>; 2],
    pub(super) outward: [f32x16<S>; 2],
}

impl BoundaryEdge {
    /// Distance of a place from the line, positive inside, and its position along it from the
    /// middle.
    #[inline(always)]
    pub(super) fn place(&self, p: Vec2) -> [f32; 2] {
        let from = p - self.middle;
        let (x, z) = (from.dot(self.along), from.perp_dot(self.along));
        match self.bend == 0.0 {
            true => [-z, x],
            false => {
                let [height, place] = circle_coordinates(x, z, self.bend);
                [-height, place]
            }
        }
    }
}

impl<'a> EdgeView<'a> {
    #[inline(always)]
    pub(super) fn new(edge: &'a BoundaryEdge, foot: Vec2) -> Self {
        let [across, place] = edge.place(foot);
        let half = 0.5 * edge.length;
        Self {
            edge,
            foot,
            across,
            ends: [-half - place, half - place],
        }
    }

    /// Squared distance of the foot.
    #[inline(always)]
    pub(super) fn distance_squared(&self) -> f32 {
        let beyond = self.ends[0].max(-self.ends[1]).max(0.0);
        self.across * self.across + beyond * beyond
    }

    /// Change of the winding number on the way from the patch's reference `from` to the foot.
    #[inline(always)]
    pub(super) fn winding_change(&self, from: Vec2) -> f32 {
        let before = self.edge.reference_outside;
        let after = self.across < 0.0;
        if before == after {
            return 0.0;
        }
        let way = self.foot - from;
        let a = (self.edge.from - from).perp_dot(way) < 0.0;
        let b = (self.edge.to - from).perp_dot(way) < 0.0;
        // Arcs extend beyond all that is visible.
        match a != b || self.edge.bend != 0.0 {
            true if after => -1.0,
            true => 1.0,
            false => 0.0,
        }
    }

    #[inline(always)]
    pub(super) fn line<S: Simd>(&self, local: &LocalSamples<S>) -> EdgeLine<S> {
        let (simd, [x, y]) = (local.height.token(), local.feet);
        let along = self.edge.along;
        let tangent = [splat(simd, along.x), splat(simd, along.y)];
        let normal = [splat(simd, along.y), splat(simd, -along.x)];
        // Straight edges.
        if self.edge.bend == 0.0 {
            let across = x.mul_add(-along.y, y.mul_add(along.x, splat(simd, self.across)));
            let start = x.mul_add(-along.x, y.mul_add(-along.y, splat(simd, self.ends[0])));
            return EdgeLine {
                // Without negative zeros, which are on the other side to some.
                across: across + 0.0,
                start,
                along: tangent,
                outward: normal,
            };
        }
        // Arcs: coordinates along the circle.
        let from = self.foot - self.edge.middle;
        let (x, y) = (x + from.x, y + from.y);
        let circle = Circle::new(
            x.mul_add(tangent[0], y * tangent[1]),
            x.mul_add(normal[0], y * normal[1]),
            self.edge.bend,
        );
        let zero = splat(simd, 0.0);
        let (c, s) = (circle.cosine, circle.sine);
        EdgeLine {
            across: zero - circle.height,
            start: zero - circle.place - 0.5 * self.edge.length,
            along: [
                c * tangent[0] - s * normal[0],
                c * tangent[1] - s * normal[1],
            ],
            outward: [
                c * normal[0] + s * tangent[0],
                c * normal[1] + s * tangent[1],
            ],
        }
    }

    /// Changes of the winding number on the ways from the foot of the centre to the samples' feet.
    #[inline(always)]
    pub(super) fn winding_changes<S: Simd>(
        &self,
        local: &LocalSamples<S>,
        across: f32x16<S>,
    ) -> f32x16<S> {
        let simd = local.height.token();
        let zero = f32x16::splat(simd, 0.0);
        let apart = is_right_of(local, self.edge.from - self.foot)
            ^ is_right_of(local, self.edge.to - self.foot);
        let (other, change) = match self.across < 0.0 {
            true => (across.simd_ge(zero), 1.0),
            false => (across.simd_lt(zero), -1.0),
        };
        let crossed = match self.edge.bend == 0.0 {
            true => other & apart,
            // Arcs extend beyond all that is visible.
            false => other,
        };
        crossed.select(f32x16::splat(simd, change), zero)
    }

    /// Adds the edge's terms to the sums.
    #[inline(always)]
    pub(super) fn add_to<S: Simd>(
        &self,
        local: &LocalSamples<S>,
        kernel: &Quotients<S>,
        line: &EdgeLine<S>,
        edge_sums: &mut EdgeSums<S>,
    ) {
        // The piece of the line within reach.
        let (across, start) = (line.across, line.start);
        let zero = splat(across.token(), 0.0);
        let flat = across * across;
        let near = flat + local.square;
        let visible = (1.0 - near).max(zero).sqrt();
        let a = start.max(-visible);
        let b = (start + self.edge.length).min(visible);
        if !b.simd_gt(a).any_true() {
            return;
        }
        let integrals = LineIntegrals {
            height: local.height.abs(),
            square: local.square,
            across,
            flat,
            near,
        };
        // Whether an end of the edge is in reach of some sample.
        let parts = a.simd_gt(-visible) | b.simd_lt(visible);
        let parts = (parts & near.simd_lt(splat(across.token(), 1.0))).any_true();
        let ([logarithm, angle, lifted], [rest, height_slope, slope]) = match parts {
            false => (
                integrals.chord(visible),
                kernel.integrate_chord(near, visible),
            ),
            true => {
                let ends = [a, b.max(a)];
                let far = [a.mul_add(a, near), ends[1].mul_add(ends[1], near)];
                (
                    integrals.piece(ends, far),
                    kernel.integrate(near, ends, far),
                )
            }
        };
        // Softening next to the line.
        let (mut logarithm, mut lifted, mut out) = (logarithm, lifted, slope);
        if near.simd_lt(local.wide.square).any_true() {
            let softening =
                Softening::new(&integrals, [start, start + self.edge.length], &local.wide);
            logarithm += softening.terms[0];
            lifted += softening.terms[1];
            edge_sums.height_slope -= softening.rise;
            out -= softening.across;
            for k in 0..2 {
                edge_sums.along[k] = softening.along.mul_add(line.along[k], edge_sums.along[k]);
            }
        }
        // Sums.
        edge_sums.angle += angle;
        edge_sums.lifted += lifted;
        edge_sums.rest = across.mul_add(logarithm - rest, edge_sums.rest);
        edge_sums.height_slope = across.mul_add(height_slope, edge_sums.height_slope);
        let out = out - logarithm;
        for k in 0..2 {
            edge_sums.along[k] = out.mul_add(line.outward[k], edge_sums.along[k]);
        }
    }
}

/// Whether a corner lies to the right of the ways from the foot of the centre to the samples' feet.
#[inline(always)]
fn is_right_of<S: Simd>(local: &LocalSamples<S>, v: Vec2) -> mask32x16<S> {
    let [x, y] = local.feet;
    (y * v.x).simd_lt(x * v.y)
}
