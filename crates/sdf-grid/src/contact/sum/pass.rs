//! The sum over a cluster of samples.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{Mat3, Vec2, Vec3};

use super::border::{Above, Seen, Taken};
use super::clusters::Cluster;
use super::kink::{Lean, STRAY};
use super::sheet::Sheet;
use super::slopes::Slopes;
use super::smooth::Quotients;
use super::unrolled::Unrolled;
use super::vectors::{Vectors, along, scaled, splat, turned};
use super::views::Views;

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
