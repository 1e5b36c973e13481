//! The integral of the kernel over the patches that a cluster of sixteen samples sees, with its
//! slopes.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::{Mat3, Vec2, Vec3};

use super::boundary_edges::{Above, Line, Seen, Taken};
use super::curved::{OFF, Unrolled};
use super::kernel::{Quotients, Vectors, along, curvature, scaled, splat, turned};
use super::lookup::Cluster;
use super::patches::{Sheet, Views};

/// Heights, in units of the reach, that single precision does not tell from zero, many times over:
/// some ten nanometres. Walls as near as that are flush.
const FLUSH: f32 = 1e-5;

/// Half the sign of a height; between those of both sides for walls that are flush, where it is zero:
/// the mean of the slopes to either side, whatever rounding makes of the height.
#[inline(always)]
pub(super) fn half_sign<S: Simd>(height: f32x16<S>) -> f32x16<S> {
    let half = splat(height.token(), 0.5);
    (height * (0.5 / FLUSH)).min(half).max(half * -1.0)
}

/// The integral of the kernel over a sheet, and its slopes with the height and along the sheet's two
/// directions.
pub(super) struct Slopes<S: Simd> {
    pub(super) value: f32x16<S>,
    pub(super) height: f32x16<S>,
    pub(super) along: [f32x16<S>; 2],
    /// What the normal is multiplied with for the moment, besides the value.
    pub(super) turning: f32x16<S>,
}

impl<S: Simd> Slopes<S> {
    /// So many times over the whole plane, without what borders take.
    #[inline(always)]
    pub(super) fn new(
        above: &Above<S>,
        kernel: &Quotients<S>,
        taken: &Taken<S>,
        inside: f32x16<S>,
    ) -> Self {
        const TURN: f32 = 1.0 / std::f32::consts::TAU;
        let zero = splat(inside.token(), 0.0);
        // What of the plane is seen from the foot and from above it.
        let seen = taken.angle.mul_add(-TURN, inside);
        let lifted = taken.lifted.mul_add(-TURN, inside);
        let sign = half_sign(above.height);
        let flat = kernel.value.mul_add(seen, taken.rest * TURN);
        let bent = kernel.slope.mul_add(seen, taken.tilt * -TURN);
        Self {
            value: flat - above.height * sign * lifted,
            height: (above.height + above.height).mul_sub(bent, sign * lifted),
            along: taken.along.map(|a| a * TURN),
            turning: zero,
        }
    }
}

/// Where it begins to fade, in units of `r`.
const FADE: f32 = 0.7;

/// Squared sine of the least angle that counts.
const LEAST: f32 = 1e-8;

/// How far facets stray from the torus that stands for them, in units of the reach: a half of what
/// is allowed.
pub(super) const STRAY: f32 = 0.5 * OFF as f32;

/// How samples lean.
pub(super) struct Lean<S: Simd> {
    /// Of the angle between them and the sheet.
    pub(super) cosine: f32x16<S>,
    /// Their normals along the sheet's two directions.
    pub(super) aside: [f32x16<S>; 2],
    /// How far the surface may be from the sheet, in units of the reach.
    pub(super) stray: f32,
}

/// Samples that lean, and how near they are to borders.
pub(super) struct Leaning<S: Simd> {
    sine_squared: f32x16<S>,
    /// Squared.
    stray: f32,
    /// Square of where fading begins.
    width: f32x16<S>,
    /// Squared distance of the nearest border so far, and the way from it along the sheet's two
    /// directions: the nearest alone counts, so that it is the same in however many pieces a border
    /// comes.
    nearest: f32x16<S>,
    way: [f32x16<S>; 2],
}

impl<S: Simd> Lean<S> {
    /// None if all samples lie along the sheet, which is flat, or are too far from it.
    #[inline(always)]
    pub(super) fn leaning(&self, above: &Above<S>) -> Option<Leaning<S>> {
        let simd = self.cosine.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let [x, y] = self.aside;
        let sine_squared = x.mul_add(x, y * y);
        let extent = sine_squared + splat(simd, self.stray);
        let counts = extent.simd_gt(splat(simd, LEAST)) & above.square.simd_lt(one);
        counts.any_true().then(|| {
            let width = above.half * FADE;
            let width = (width * width).max(1e-20);
            Leaning {
                sine_squared: counts.select(sine_squared, zero),
                stray: self.stray * self.stray,
                width,
                nearest: width,
                way: [zero; 2],
            }
        })
    }
}

impl<S: Simd> Leaning<S> {
    /// Looks whether a border so long is nearer than others.
    #[inline(always)]
    pub(super) fn pass(&mut self, line: &Line<S>, length: f32) {
        let zero = splat(self.nearest.token(), 0.0);
        let (across, start) = (line.across, line.start);
        let beyond = start.max(zero) + (start + length).min(zero);
        let square = across.mul_add(across, beyond * beyond);
        let nearer = square.simd_lt(self.nearest);
        if !nearer.any_true() {
            return;
        }
        self.nearest = square.min(self.nearest);
        let (out, along) = (line.outward, line.along);
        for k in 0..2 {
            let way = across.mul_add(out[k], beyond * along[k]);
            self.way[k] = nearer.select(way, self.way[k]);
        }
    }

    /// One away from borders and zero on them, and its slopes along the sheet.
    #[inline(always)]
    fn faded(&self) -> (f32x16<S>, [f32x16<S>; 2]) {
        let scale = splat(self.nearest.token(), 1.0) / self.width;
        let t = self.nearest * scale;
        // By the square of the distance, times two.
        let slope = (t - t * t) * scale * -12.0;
        (
            t * t * (3.0 - t * 2.0),
            [slope * self.way[0], slope * self.way[1]],
        )
    }

    /// Adds to the sums of samples, so many times above the sheet. What comes back is what the normal
    /// is to be multiplied with for the moment by the change of `θ`.
    #[inline(always)]
    pub(super) fn add_to(
        &self,
        above: &Above<S>,
        cosine: f32x16<S>,
        inside: f32x16<S>,
        sums: &mut Slopes<S>,
    ) -> f32x16<S> {
        let zero = splat(inside.token(), 0.0);
        let square = above.half * above.half;
        let leaning = self.sine_squared.simd_gt(zero);
        let share = leaning.select(square * inside, zero) * (1.0 / 6.0);
        let [second, third] = curvature(above.square);
        let mut value = share * self.sine_squared * second;
        let mut rise = share * self.sine_squared * third * above.height;
        let mut turning = share * second * -2.0;
        let extent = square.mul_add(self.sine_squared, self.stray).sqrt();
        let height = above.height.abs();
        let deep = (extent - height).max(zero);
        if deep.simd_gt(zero).any_true() {
            let inverse = splat(inside.token(), 1.0) / extent.max(1e-20);
            let (part, most) = (deep * inverse, inside * 0.25);
            value -= most * deep * part;
            rise = (most * part * 4.0).mul_add(half_sign(above.height), rise);
            // e² - x² over e², and r² / e.
            let bow = part * (extent + height) * inverse;
            turning += most * bow * square * inverse;
        }
        let (fade, slopes) = self.faded();
        sums.value = value.mul_add(fade, sums.value);
        sums.height = rise.mul_add(fade, sums.height);
        sums.along[0] = value.mul_add(slopes[0], sums.along[0]);
        sums.along[1] = value.mul_add(slopes[1], sums.along[1]);
        turning * fade * cosine * cosine
    }
}

/// Height, in units of the reach, beyond which it hardly matters what samples see: the kernel's
/// integral is a thousandth of that at the surface.
const HIGH: f32 = 0.75;

/// Where a cluster lies.
pub(super) struct Placed<'a> {
    pub(super) cluster: &'a Cluster,
    /// From its frame to that of the surface.
    pub(super) turn: Mat3,
    /// Its centre from the middle of the cell it is in, and its radius, in units of the reach.
    pub(super) at: Vec3,
    pub(super) radius: f32,
}

/// What a cluster adds, in units of the reach: the sum, its slope with the translation, and with a
/// rotation about the cluster's centre.
pub(super) struct Part {
    pub(super) value: f32,
    pub(super) gradient: Vec3,
    pub(super) moment: Vec3,
}

/// Sums of sixteen lanes.
struct Totals<S: Simd> {
    value: f32x16<S>,
    gradient: [f32x16<S>; 3],
    /// `n V`, of which the moment is made.
    flux: [f32x16<S>; 3],
}

/// Samples in the frame of the surface.
struct Samples<S: Simd> {
    arm: Vectors<S>,
    normal: Vectors<S>,
    area: f32x16<S>,
    /// Half the side of a square as large.
    half: f32x16<S>,
}

/// What a cluster adds to the sum over the sheets seen from its cell.
#[simd]
pub(super) fn part<S: Simd>(simd: S, views: &Views, sheets: &[Sheet], placed: &Placed<'_>) -> Part {
    let cluster = placed.cluster;
    let samples = Samples {
        arm: turned(simd, &placed.turn, &cluster.position),
        normal: turned(simd, &placed.turn, &cluster.normal),
        area: f32x16::simd_from(simd, cluster.area),
        half: f32x16::simd_from(simd, cluster.half),
    };
    let zero = f32x16::splat(simd, 0.0);
    let mut totals = Totals {
        value: zero,
        gradient: [zero; 3],
        flux: [zero; 3],
    };
    for sheet in sheets {
        add_sheet(views, sheet, placed, &samples, &mut totals);
    }
    totals.part(&samples)
}

#[inline(always)]
fn add_sheet<S: Simd>(
    views: &Views,
    sheet: &Sheet,
    placed: &Placed<'_>,
    samples: &Samples<S>,
    totals: &mut Totals<S>,
) {
    let simd = samples.area.token();
    let [u, v, normal] = sheet.axes;
    let from = placed.at - sheet.origin;
    let flat = sheet.curvature == Vec2::ZERO;
    let (foot, height) = match flat {
        true => (Vec2::new(from.dot(u), from.dot(v)), from.dot(normal)),
        false => sheet.unrolled(from),
    };
    if height.abs() >= 1.0 + placed.radius {
        return;
    }
    let across = along(&samples.arm, &sheet.axes);
    if flat {
        let heights = across[2] + height;
        if heights.abs().simd_ge(1.0).all_true() {
            return;
        }
        let above = Above::new(heights, [across[0], across[1]], samples.half);
        let [x, y, cosine] = along(&samples.normal, &sheet.axes);
        let lean = Lean {
            cosine,
            aside: [x, y],
            stray: 0.0,
        };
        if let Some(sums) = seen(views, sheet, placed.radius, (foot, height), &above, &lean) {
            totals.add_flat(samples.area * cosine, &sums, sheet.axes);
        }
        return;
    }
    let place = [
        across[0] + from.dot(u),
        across[1] + from.dot(v),
        across[2] + from.dot(normal),
    ];
    let unrolled = Unrolled::new(simd, sheet.curvature, place);
    let feet = [unrolled.place[0] - foot.x, unrolled.place[1] - foot.y];
    // The height above what is bent averages to more over a sample's extent than in its middle.
    let bent = (sheet.curvature.x + sheet.curvature.y) / 6.0;
    let high = samples.half * samples.half * bent + unrolled.height;
    let above = Above::new(high, feet, samples.half);
    // Unrolled from the inside, places are farther apart the higher they are.
    let radius = placed.radius / (1.0 - HIGH * sheet.curvature.abs().max_element());
    let faces = unrolled.along(&along(&samples.normal, &sheet.axes));
    let lean = Lean {
        cosine: faces[2],
        aside: [faces[0], faces[1]],
        stray: STRAY,
    };
    if let Some(sums) = seen(views, sheet, radius, (foot, height), &above, &lean) {
        totals.add_curved(scaled(&faces, samples.area), &sums, &unrolled, sheet);
    }
}

/// The integral of the kernel over a sheet, none if nothing of it is in reach of a cluster of a
/// radius above a foot.
#[inline(always)]
fn seen<S: Simd>(
    views: &Views,
    sheet: &Sheet,
    radius: f32,
    (foot, height): (Vec2, f32),
    above: &Above<S>,
    lean: &Lean<S>,
) -> Option<Slopes<S>> {
    let zero = splat(above.height.token(), 0.0);
    let mut taken = Taken {
        angle: zero,
        lifted: zero,
        rest: zero,
        tilt: zero,
        along: [zero; 2],
    };
    let reach = (1.0 + radius) * (1.0 + radius);
    let (mut inside, mut change) = (sheet.inside, zero);
    let mut near = false;
    let mut leaning = lean.leaning(above);
    let kernel = Quotients::at(above.square);
    let range = sheet.first as usize..(sheet.first + sheet.count) as usize;
    let borders = &views.borders[range];
    for border in borders {
        let seen = Seen::new(border, foot);
        inside += seen.crossed(sheet.reference);
        let off = seen.distance_squared();
        if off + height * height >= reach {
            continue;
        }
        near = true;
        let line = seen.line(above);
        if off <= radius * radius {
            change += seen.crossed_on(above, line.across);
        }
        if let Some(leaning) = &mut leaning {
            leaning.pass(&line, border.length);
        }
        seen.add_to(above, &kernel, &line, &mut taken);
    }
    if inside == 0.0 && !near {
        return None;
    }
    // Beyond the reach nothing counts.
    let within = above.square.simd_lt(1.0);
    let inside = within.select(change + inside, zero);
    let mut sums = Slopes::new(above, &kernel, &taken, inside);
    if let Some(leaning) = leaning {
        sums.turning = leaning.add_to(above, lean.cosine, inside, &mut sums);
    }
    Some(sums)
}

impl<S: Simd> Totals<S> {
    #[inline(always)]
    fn add_flat(&mut self, weight: f32x16<S>, sums: &Slopes<S>, [u, v, normal]: [Vec3; 3]) {
        self.value = weight.mul_add(sums.value, self.value);
        let [du, dv] = [weight * sums.along[0], weight * sums.along[1]];
        let dn = weight * sums.height;
        let flux = sums.value + sums.turning;
        for k in 0..3 {
            let slope = du.mul_add(u[k], self.gradient[k]);
            self.gradient[k] = dn.mul_add(normal[k], dv.mul_add(v[k], slope));
            self.flux[k] = flux.mul_add(normal[k], self.flux[k]);
        }
    }

    /// Of the normal of a bent surface, `(1 - H ξ)` times the integral over the unrolled one, with
    /// `H` the mean curvature and `ξ` the height: right to first order in the curvature.
    #[inline(always)]
    fn add_curved(
        &mut self,
        [x, y, up]: Vectors<S>,
        sums: &Slopes<S>,
        unrolled: &Unrolled<S>,
        sheet: &Sheet,
    ) {
        let mean = 0.5 * (sheet.curvature.x + sheet.curvature.y);
        let spread = 1.0 - unrolled.height * mean;
        let value = sums.value * spread;
        let flux = value + sums.turning * spread;
        let [u, v, normal] = sheet.axes;
        self.value += up * value;
        let height = sums.height * spread - sums.value * mean;
        let [ix, iy] = unrolled.shrunk;
        let slopes = [
            x * flux * unrolled.bent[0] + up * spread * sums.along[0] * ix,
            y * flux * unrolled.bent[1] + up * spread * sums.along[1] * iy,
            up * height,
        ];
        // Along the sheet's axes.
        let slope = unrolled.back(&slopes);
        let bent = scaled(&unrolled.normal, flux);
        for k in 0..3 {
            let sum = slope[0].mul_add(u[k], self.gradient[k]);
            self.gradient[k] = slope[2].mul_add(normal[k], slope[1].mul_add(v[k], sum));
            let sum = bent[0].mul_add(u[k], self.flux[k]);
            self.flux[k] = bent[2].mul_add(normal[k], bent[1].mul_add(v[k], sum));
        }
    }

    #[inline(always)]
    fn part(&self, samples: &Samples<S>) -> Part {
        let [gx, gy, gz] = self.gradient;
        let [ax, ay, az] = samples.arm;
        let [nx, ny, nz] = samples.normal;
        let [ux, uy, uz] = self.flux;
        let x = ay * gz - az * gy + samples.area * (ny * uz - nz * uy);
        let y = az * gx - ax * gz + samples.area * (nz * ux - nx * uz);
        let z = ax * gy - ay * gx + samples.area * (nx * uy - ny * ux);
        Part {
            value: self.value.reduce_sum(),
            gradient: Vec3::new(gx.reduce_sum(), gy.reduce_sum(), gz.reduce_sum()),
            moment: Vec3::new(x.reduce_sum(), y.reduce_sum(), z.reduce_sum()),
        }
    }
}
