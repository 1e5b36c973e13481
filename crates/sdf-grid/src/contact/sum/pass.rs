//! The sum over a cluster of samples.

use fearless_simd::{f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{Mat3, Vec2, Vec3};

use super::border::{Above, Seen, Slopes};
use super::clusters::Cluster;
use super::lanes::Lanes;
use super::smooth::{ENTIRE, Taylor};
use super::views::{REFERENCE, Sheet, Views};

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
    arm: [f32x16<S>; 3],
    normal: [f32x16<S>; 3],
    area: f32x16<S>,
}

#[inline(always)]
fn dot<S: Simd>(a: &[f32x16<S>; 3], b: Vec3) -> f32x16<S> {
    let simd = a[0].token();
    let splat = |x| f32x16::splat(simd, x);
    a[0].mul_add(
        splat(b.x),
        a[1].mul_add(splat(b.y), a[2] * b.z),
    )
}

#[inline(always)]
fn turned<S: Simd>(simd: S, turn: &Mat3, v: &[Lanes; 3]) -> [f32x16<S>; 3] {
    let v = [
        f32x16::simd_from(simd, v[0]),
        f32x16::simd_from(simd, v[1]),
        f32x16::simd_from(simd, v[2]),
    ];
    [
        dot(&v, turn.row(0)),
        dot(&v, turn.row(1)),
        dot(&v, turn.row(2)),
    ]
}

/// What a cluster adds to the sum over the sheets seen from its cell.
#[simd]
pub(super) fn part<S: Simd>(
    simd: S,
    views: &Views,
    sheets: &[Sheet],
    placed: &Placed<'_>,
) -> Part {
    let cluster = placed.cluster;
    let samples = Samples {
        arm: turned(simd, &placed.turn, &cluster.position),
        normal: turned(simd, &placed.turn, &cluster.normal),
        area: f32x16::simd_from(simd, cluster.area),
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
    let height = from.dot(normal);
    let reach = 1.0 + placed.radius;
    if height.abs() >= reach {
        return;
    }
    let zero = f32x16::splat(simd, 0.0);
    let lanes = dot(&samples.arm, normal) + height;
    let above = Above {
        height: lanes,
        square: (lanes * lanes).min(1.0),
        feet: [dot(&samples.arm, u), dot(&samples.arm, v)],
    };
    let foot = Vec2::new(from.dot(u), from.dot(v));
    let way = foot - REFERENCE;
    let mut sums = Slopes {
        value: zero,
        height: zero,
        along: [zero; 2],
    };
    let (mut inside, mut change) = (sheet.inside, zero);
    let mut taylor = None;
    let range = sheet.first as usize..(sheet.first + sheet.count) as usize;
    for border in &views.borders[range] {
        let seen = Seen::new(border, foot);
        inside += seen.crossed(way);
        let off = seen.distance_squared();
        if off + height * height >= reach * reach {
            continue;
        }
        let across = seen.across(&above);
        if off <= placed.radius * placed.radius {
            change += seen.crossed_on(&above, across);
        }
        if taylor.is_none() {
            taylor = Some(Taylor::at(above.square));
        }
        if let Some(taylor) = &taylor {
            seen.add_to(&above, taylor, across, &mut sums);
        }
    }
    if inside == 0.0 && taylor.is_none() {
        return;
    }
    let inside = change + inside;
    add_plane(&above, inside, &mut sums);
    totals.add(samples, &sums, sheet.axes);
}

/// Turns `2π` times what borders take into what they take, and adds the whole plane where the feet
/// are inside.
#[inline(always)]
fn add_plane<S: Simd>(above: &Above<S>, inside: f32x16<S>, sums: &mut Slopes<S>) {
    const TURN: f32 = 1.0 / std::f32::consts::TAU;
    let simd = inside.token();
    let zero = f32x16::splat(simd, 0.0);
    let t = above.square;
    let (mut value, mut slope) = (zero, zero);
    for c in ENTIRE.iter().rev() {
        slope = slope.mul_add(t, value);
        value = value.mul_add(t, f32x16::splat(simd, *c));
    }
    let within = t.simd_lt(1.0);
    let height = above.height;
    let sign = f32x16::splat(simd, 0.5).copysign(height);
    let sign = height.simd_eq(zero).select(zero, sign);
    let value = within.select(value - height * sign, zero);
    let slope = within.select(height * (slope + slope) - sign, zero);
    sums.value = inside.mul_add(value, sums.value * TURN);
    sums.height = inside.mul_add(slope, sums.height * TURN);
    sums.along = [sums.along[0] * TURN, sums.along[1] * TURN];
}

impl<S: Simd> Totals<S> {
    #[inline(always)]
    fn add(&mut self, samples: &Samples<S>, sums: &Slopes<S>, [u, v, normal]: [Vec3; 3]) {
        let weight = samples.area * dot(&samples.normal, normal);
        self.value += weight * sums.value;
        let [du, dv] = [weight * sums.along[0], weight * sums.along[1]];
        let dn = weight * sums.height;
        for k in 0..3 {
            let slope = dn * normal[k] + du * u[k] + dv * v[k];
            self.gradient[k] += slope;
            self.flux[k] += sums.value * normal[k];
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
