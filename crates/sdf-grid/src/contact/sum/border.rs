//! What a border takes from the integral of the kernel over a sheet, for sixteen samples.

use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::Vec2;

use super::lanes::{ln, upper_angle};
use super::sheet::Border;
use super::smooth::Taylor;

/// A border as it is seen from the foot of a cluster's middle.
pub(super) struct Seen<'a> {
    border: &'a Border,
    /// Of the border's beginning and end.
    from: Vec2,
    to: Vec2,
    /// Distance of the border's line, positive if the foot is inside.
    across: f32,
    /// Where on the line it begins and ends, from where the line is nearest.
    ends: [f32; 2],
}

/// Sixteen samples above a sheet.
pub(super) struct Above<S: Simd> {
    /// Signed, of each.
    pub(super) height: f32x16<S>,
    /// Its square, at most one.
    pub(super) square: f32x16<S>,
    /// Their feet, from that of the cluster's middle.
    pub(super) feet: [f32x16<S>; 2],
}

/// A function of place, and its slopes with the height and along the sheet's two directions.
pub(super) struct Slopes<S: Simd> {
    pub(super) value: f32x16<S>,
    pub(super) height: f32x16<S>,
    pub(super) along: [f32x16<S>; 2],
    /// What the normal is multiplied with for the moment, besides the value.
    pub(super) turning: f32x16<S>,
}

impl<S: Simd> Above<S> {
    #[inline(always)]
    pub(super) fn new(height: f32x16<S>, feet: [f32x16<S>; 2]) -> Self {
        Self {
            height,
            square: (height * height).min(1.0),
            feet,
        }
    }
}

impl<'a> Seen<'a> {
    #[inline(always)]
    pub(super) fn new(border: &'a Border, foot: Vec2) -> Self {
        let (from, to) = (border.from - foot, border.to - foot);
        let start = from.dot(border.along);
        Self {
            border,
            from,
            to,
            across: from.perp_dot(border.along),
            ends: [start, start + border.length],
        }
    }

    /// Squared distance of the foot.
    #[inline(always)]
    pub(super) fn distance_squared(&self) -> f32 {
        let beyond = self.ends[0].max(-self.ends[1]).max(0.0);
        self.across * self.across + beyond * beyond
    }

    /// What the number of insides changes by on the way from a place to the foot.
    #[inline(always)]
    pub(super) fn crossed(&self, way: Vec2) -> f32 {
        let before = (self.from + way).perp_dot(self.border.along) < 0.0;
        let after = self.across < 0.0;
        let [a, b] = [self.from, self.to].map(|v| (v + way).perp_dot(way) < 0.0);
        match (before != after) & (a != b) {
            true if after => -1.0,
            true => 1.0,
            false => 0.0,
        }
    }

    /// Distances of the border's line from the feet.
    #[inline(always)]
    pub(super) fn across<S: Simd>(&self, above: &Above<S>) -> f32x16<S> {
        let (simd, [x, y]) = (above.height.token(), above.feet);
        let along = self.border.along;
        let lanes = f32x16::splat(simd, self.across);
        // Without negative zeros, which are on the other side to some.
        x.mul_add(-along.y, y.mul_add(along.x, lanes)) + 0.0
    }

    /// Where the border begins on its line.
    #[inline(always)]
    pub(super) fn start<S: Simd>(&self, above: &Above<S>) -> f32x16<S> {
        let (simd, [x, y]) = (above.height.token(), above.feet);
        let along = self.border.along;
        let lanes = f32x16::splat(simd, self.ends[0]);
        x.mul_add(-along.x, y.mul_add(-along.y, lanes))
    }

    /// What the number of insides changes by on the ways from the foot of the middle to the feet.
    #[inline(always)]
    pub(super) fn crossed_on<S: Simd>(&self, above: &Above<S>, across: f32x16<S>) -> f32x16<S> {
        let simd = above.height.token();
        let zero = f32x16::splat(simd, 0.0);
        let apart = right_of(above, self.from) ^ right_of(above, self.to);
        let (other, change) = match self.across < 0.0 {
            true => (across.simd_ge(zero), 1.0),
            false => (across.simd_lt(zero), -1.0),
        };
        (other & apart).select(f32x16::splat(simd, change), zero)
    }

    /// Adds `2π` times what it takes.
    #[inline(always)]
    pub(super) fn add_to<S: Simd>(
        &self,
        above: &Above<S>,
        taylor: &Taylor<S>,
        across: f32x16<S>,
        sums: &mut Slopes<S>,
    ) {
        let simd = across.token();
        let zero = f32x16::splat(simd, 0.0);
        let start = self.start(above);
        let flat = across * across;
        let near = flat + above.height * above.height;
        let visible = (1.0 - near).max(zero).sqrt();
        let a = start.max(-visible);
        let b = (start + self.border.length).min(visible);
        if !b.simd_gt(a).any_true() {
            return;
        }
        let b = b.max(a);
        let piece = Piece::new(above, across, [a, b]);
        let [logarithm, angle, lifted] = piece.newtonian();
        let [rest, tilt, slope] = taylor.along(flat, [a, b], piece.beyond);
        let value = (across * logarithm + piece.height * lifted) * 0.5;
        sums.value += value - taylor.d[0] * angle - across * rest;
        let sign = above
            .height
            .simd_eq(zero)
            .select(zero, f32x16::splat(simd, 0.5).copysign(above.height));
        let bend = taylor.d[1] * angle + across * tilt;
        sums.height += sign * lifted - above.height * (bend + bend);
        let out = slope * 2.0 - logarithm * 0.5;
        let along = self.border.along;
        sums.along[0] += out * along.y;
        sums.along[1] -= out * along.x;
    }
}

/// Whether a corner lies to the right of the ways from the foot of the middle to the feet.
#[inline(always)]
fn right_of<S: Simd>(above: &Above<S>, v: Vec2) -> mask32x16<S> {
    let [x, y] = above.feet;
    (y * v.x).simd_lt(x * v.y)
}

/// A piece of a border's line as it is seen from samples.
struct Piece<S: Simd> {
    /// Above or below.
    height: f32x16<S>,
    across: f32x16<S>,
    /// Squared distance of the line.
    near: f32x16<S>,
    ends: [f32x16<S>; 2],
    /// Squared distances of the ends from the feet.
    beyond: [f32x16<S>; 2],
    /// Squared height.
    square: f32x16<S>,
}

impl<S: Simd> Piece<S> {
    #[inline(always)]
    fn new(above: &Above<S>, across: f32x16<S>, ends: [f32x16<S>; 2]) -> Self {
        let flat = across * across;
        Self {
            height: above.height.abs(),
            across,
            near: flat + above.square,
            ends,
            beyond: [
                ends[0].mul_add(ends[0], flat),
                ends[1].mul_add(ends[1], flat),
            ],
            square: above.square,
        }
    }

    /// `∫ dl / R`, and the angles at which the piece is seen in the plane and from above it:
    /// `across ∫ dl / (across² + l²)` and `across |h| ∫ dl / ((across² + l²) R)`.
    #[inline(always)]
    fn newtonian(&self) -> [f32x16<S>; 3] {
        let [a, b] = self.ends;
        let ra = (self.beyond[0] + self.square).sqrt();
        let rb = (self.beyond[1] + self.square).sqrt();
        let (pa, pb) = (ra + a.abs(), rb + b.abs());
        let product = a * b;
        let beside = product.simd_lt(0.0);
        // From the ends where nothing cancels.
        let above = beside.select(pa * pb, pa.max(pb)).max(1e-30);
        let below = beside.select(self.near, pa.min(pb)).max(1e-30);
        let logarithm = ln(above / below);
        let flat = self.across * self.across;
        let distance = self.across.abs();
        let angle = upper_angle(distance * (b - a), flat + product);
        let rise = self.height * distance * (b * ra - a * rb).max(0.0);
        let lifted = upper_angle(rise, flat * (ra * rb) + self.square * product);
        [
            logarithm,
            angle.copysign(self.across),
            lifted.copysign(self.across),
        ]
    }
}
