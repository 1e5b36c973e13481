//! The integral of the kernel over the visible patches, for a cluster of sixteen samples, with
//! slopes.
//!
//! # Tilt
//!
//! The integral has a kink where the height `x` is zero: it is `S(x) - |x|/2` with `S` smooth. Over
//! a piece of surface that reaches `e` to either side the average of `|x|` is `(x² + e²) / (2 e)`
//! where `|x| < e`. So the average of `-|x|/2` is below the value in the middle by
//! `(e - |x|)² / (4 e)`, and that of `S` is above it by about `e² S'' / 6`. Integrated over all
//! heights both are `e²/6`: evenly spread samples are not biased, whatever their phase. A square of half side `r`,
//! tilted by an angle `θ`, has `e = r sin θ`: exact where it is tilted about a side, and of the
//! same second moment elsewhere. Heights above a torus are only known as well as facets keep to it,
//! which extends samples in the same way.
//!
//! At the patch's boundary, where the kink ends, both terms taper to zero.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use fearless_simd_macros::simd;
use glam::{Mat3, Vec2, Vec3};

use super::boundary_edges::{EdgeLine, EdgeSums, EdgeView, LocalSamples};
use super::curved::{DevelopedSamples, OFF};
use super::kernel::{Quotients, Vectors, components, curvature, scaled, splat, turned};
use super::lookup::Cluster;
use super::patches::{Patch, PatchList};

/// Heights, in units of the reach, many times the resolution of single precision: some ten
/// nanometres. Walls as near as that are flush.
const FLUSH: f32 = 1e-5;

/// Half the sign of a height, continuous for flush walls: at zero height the slope is the mean of
/// both sides, however the height is rounded.
#[inline(always)]
fn half_sign<S: Simd>(height: f32x16<S>) -> f32x16<S> {
    let half = splat(height.token(), 0.5);
    (height * (0.5 / FLUSH)).min(half).max(half * -1.0)
}

/// The integral of the kernel over a patch, and its slopes with the height and along the patch's
/// two directions.
struct PatchIntegral<S: Simd> {
    pub(super) value: f32x16<S>,
    pub(super) height: f32x16<S>,
    pub(super) along: [f32x16<S>; 2],
    /// What the normal is multiplied with for the moment, besides the value.
    turning: f32x16<S>,
}

impl<S: Simd> PatchIntegral<S> {
    /// `inside` times the integral over the whole plane, less the sums over boundary edges.
    #[inline(always)]
    pub(super) fn new(
        local: &LocalSamples<S>,
        kernel: &Quotients<S>,
        edge_sums: &EdgeSums<S>,
        inside: f32x16<S>,
    ) -> Self {
        const TURN: f32 = 1.0 / std::f32::consts::TAU;
        let zero = splat(inside.token(), 0.0);
        // Shares of the full angle that the patch fills, from the foot and from above.
        let visible_share = edge_sums.angle.mul_add(-TURN, inside);
        let lifted = edge_sums.lifted.mul_add(-TURN, inside);
        let sign = half_sign(local.height);
        let flat = kernel.value.mul_add(visible_share, edge_sums.rest * TURN);
        let bent = kernel
            .slope
            .mul_add(visible_share, edge_sums.height_slope * -TURN);
        Self {
            value: flat - local.height * sign * lifted,
            height: (local.height + local.height).mul_sub(bent, sign * lifted),
            along: edge_sums.along.map(|a| a * TURN),
            turning: zero,
        }
    }
}

/// Distance from the boundary at which the taper begins, in units of `r`.
const TAPER: f32 = 0.7;

/// Squared sine of the least angle that counts.
const LEAST: f32 = 1e-8;

/// Deviation of facets from their torus, in units of the reach: half of what is allowed.
const STRAY: f32 = 0.5 * OFF as f32;

/// Tilt of samples against a patch.
struct Tilt<S: Simd> {
    /// Cosine of the angle between them and the patch.
    pub(super) cosine: f32x16<S>,
    /// Their normals along the patch's two directions.
    pub(super) aside: [f32x16<S>; 2],
    /// How far the surface may be from the patch, in units of the reach.
    stray: f32,
}

/// Correction for tilted samples, and their distance from the boundary.
struct TiltCorrection<S: Simd> {
    sine_squared: f32x16<S>,
    /// Squared.
    stray: f32,
    /// Square of the distance at which the taper begins.
    width: f32x16<S>,
    /// Squared distance of the nearest boundary edge so far, and the way from it along the patch's
    /// two directions: only the nearest counts, so that the result does not depend on how an edge
    /// is divided.
    nearest: f32x16<S>,
    way: [f32x16<S>; 2],
}

impl<S: Simd> Tilt<S> {
    /// None if all samples lie along the patch, which is flat, or are too far from it.
    #[inline(always)]
    fn correction(&self, local: &LocalSamples<S>) -> Option<TiltCorrection<S>> {
        let simd = self.cosine.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        let [x, y] = self.aside;
        let sine_squared = x.mul_add(x, y * y);
        let extent = sine_squared + splat(simd, self.stray);
        let counts = extent.simd_gt(splat(simd, LEAST)) & local.square.simd_lt(one);
        counts.any_true().then(|| {
            let width = local.half * TAPER;
            let width = (width * width).max(1e-20);
            TiltCorrection {
                sine_squared: counts.select(sine_squared, zero),
                stray: self.stray * self.stray,
                width,
                nearest: width,
                way: [zero; 2],
            }
        })
    }
}

impl<S: Simd> TiltCorrection<S> {
    /// Keeps a boundary edge of this length where it is nearer than those before.
    #[inline(always)]
    fn update_nearest(&mut self, line: &EdgeLine<S>, length: f32) {
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

    /// Taper: one away from boundary edges and zero on them, and its slopes along the patch.
    #[inline(always)]
    fn taper(&self) -> (f32x16<S>, [f32x16<S>; 2]) {
        let scale = splat(self.nearest.token(), 1.0) / self.width;
        let t = self.nearest * scale;
        // By the square of the distance, times two.
        let slope = (t - t * t) * scale * -12.0;
        (
            t * t * (3.0 - t * 2.0),
            [slope * self.way[0], slope * self.way[1]],
        )
    }

    /// Adds the correction to the sums of samples that are `inside` times above the patch. Returns
    /// the factor of the normal in the moment due to the change of `θ`.
    #[inline(always)]
    pub(super) fn add_to(
        &self,
        local: &LocalSamples<S>,
        cosine: f32x16<S>,
        inside: f32x16<S>,
        sums: &mut PatchIntegral<S>,
    ) -> f32x16<S> {
        let zero = splat(inside.token(), 0.0);
        // Second-order terms of the smooth part.
        let square = local.half * local.half;
        let tilted = self.sine_squared.simd_gt(zero);
        let share = tilted.select(square * inside, zero) * (1.0 / 6.0);
        let [second, third] = curvature(local.square);
        let mut value = share * self.sine_squared * second;
        let mut rise = share * self.sine_squared * third * local.height;
        let mut turning = share * second * -2.0;
        // The kink of `|x|`, where samples reach across the patch.
        let extent = square.mul_add(self.sine_squared, self.stray).sqrt();
        let height = local.height.abs();
        let deep = (extent - height).max(zero);
        if deep.simd_gt(zero).any_true() {
            let inverse = splat(inside.token(), 1.0) / extent.max(1e-20);
            let (part, most) = (deep * inverse, inside * 0.25);
            value -= most * deep * part;
            rise = (most * part * 4.0).mul_add(half_sign(local.height), rise);
            // e² - x² over e², and r² / e.
            let bow = part * (extent + height) * inverse;
            turning += most * bow * square * inverse;
        }
        // Tapered towards the boundary.
        let (taper, slopes) = self.taper();
        sums.value = value.mul_add(taper, sums.value);
        sums.height = rise.mul_add(taper, sums.height);
        sums.along[0] = value.mul_add(slopes[0], sums.along[0]);
        sums.along[1] = value.mul_add(slopes[1], sums.along[1]);
        turning * taper * cosine * cosine
    }
}

/// Height, in units of the reach, beyond which the kernel's integral is below a thousandth of that
/// at the surface.
const HIGH: f32 = 0.75;

/// A cluster at a pose.
pub(super) struct PlacedCluster<'a> {
    pub(super) cluster: &'a Cluster,
    /// From its frame to that of the surface.
    pub(super) turn: Mat3,
    /// Its centre from the middle of the cell it is in, and its radius, in units of the reach.
    pub(super) at: Vec3,
    pub(super) radius: f32,
}

/// Contribution of a cluster, in units of the reach: the sum, its slope with the translation, and
/// with a rotation about the cluster's centre.
pub(super) struct ClusterSum {
    pub(super) value: f32,
    pub(super) gradient: Vec3,
    pub(super) moment: Vec3,
}

/// Sums of sixteen lanes.
struct Accumulator<S: Simd> {
    value: f32x16<S>,
    gradient: [f32x16<S>; 3],
    /// `n V`, from which the moment follows.
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

/// Contribution of a cluster over the patches visible from its cell.
#[simd]
pub(super) fn sum_cluster<S: Simd>(
    simd: S,
    visible: &PatchList,
    placed: &PlacedCluster<'_>,
) -> ClusterSum {
    let cluster = placed.cluster;
    let samples = Samples {
        arm: turned(simd, &placed.turn, &cluster.position),
        normal: turned(simd, &placed.turn, &cluster.normal),
        area: f32x16::simd_from(simd, cluster.area),
        half: f32x16::simd_from(simd, cluster.half),
    };
    let zero = f32x16::splat(simd, 0.0);
    let mut totals = Accumulator {
        value: zero,
        gradient: [zero; 3],
        flux: [zero; 3],
    };
    for patch in &visible.patches {
        add_patch(visible, patch, placed, &samples, &mut totals);
    }
    totals.reduce(&samples)
}

#[inline(always)]
fn add_patch<S: Simd>(
    visible: &PatchList,
    patch: &Patch,
    placed: &PlacedCluster<'_>,
    samples: &Samples<S>,
    totals: &mut Accumulator<S>,
) {
    let simd = samples.area.token();
    // Foot and height of the cluster.
    let [u, v, normal] = patch.axes;
    let from = placed.at - patch.origin;
    let flat = patch.curvature == Vec2::ZERO;
    let (foot, height) = match flat {
        true => (Vec2::new(from.dot(u), from.dot(v)), from.dot(normal)),
        false => patch.developed(from),
    };
    if height.abs() >= 1.0 + placed.radius {
        return;
    }
    let across = components(&samples.arm, &patch.axes);
    // Flat patches.
    if flat {
        let heights = across[2] + height;
        if heights.abs().simd_ge(1.0).all_true() {
            return;
        }
        let local = LocalSamples::new(heights, [across[0], across[1]], samples.half);
        let [x, y, cosine] = components(&samples.normal, &patch.axes);
        let tilt = Tilt {
            cosine,
            aside: [x, y],
            stray: 0.0,
        };
        if let Some(sums) =
            integrate_patch(visible, patch, placed.radius, (foot, height), &local, &tilt)
        {
            totals.add_flat(samples.area * cosine, &sums, patch.axes);
        }
        return;
    }
    // Curved patches, developed.
    let place = [
        across[0] + from.dot(u),
        across[1] + from.dot(v),
        across[2] + from.dot(normal),
    ];
    let developed = DevelopedSamples::new(simd, patch.curvature, place);
    let feet = [developed.place[0] - foot.x, developed.place[1] - foot.y];
    // The height above a curved patch is larger on average over a sample than in its middle.
    let bent = (patch.curvature.x + patch.curvature.y) / 6.0;
    let high = samples.half * samples.half * bent + developed.height;
    let local = LocalSamples::new(high, feet, samples.half);
    // Developed from the inside, places are farther apart the higher they are.
    let radius = placed.radius / (1.0 - HIGH * patch.curvature.abs().max_element());
    let faces = developed.to_local(&components(&samples.normal, &patch.axes));
    let tilt = Tilt {
        cosine: faces[2],
        aside: [faces[0], faces[1]],
        stray: STRAY,
    };
    if let Some(sums) = integrate_patch(visible, patch, radius, (foot, height), &local, &tilt) {
        totals.add_curved(scaled(&faces, samples.area), &sums, &developed, patch);
    }
}

/// The integral of the kernel over a patch; none if the patch is out of reach of a cluster of this
/// radius above the foot.
#[inline(always)]
fn integrate_patch<S: Simd>(
    visible: &PatchList,
    patch: &Patch,
    radius: f32,
    (foot, height): (Vec2, f32),
    local: &LocalSamples<S>,
    tilt: &Tilt<S>,
) -> Option<PatchIntegral<S>> {
    let zero = splat(local.height.token(), 0.0);
    let mut edge_sums = EdgeSums {
        angle: zero,
        lifted: zero,
        rest: zero,
        height_slope: zero,
        along: [zero; 2],
    };
    // Boundary edges: winding numbers, tilt and integrals.
    let reach = (1.0 + radius) * (1.0 + radius);
    let (mut inside, mut change) = (patch.inside, zero);
    let mut near = false;
    let mut correction = tilt.correction(local);
    let kernel = Quotients::expand_at(local.square);
    let range = patch.first as usize..(patch.first + patch.count) as usize;
    let boundary = &visible.boundary[range];
    for edge in boundary {
        let view = EdgeView::new(edge, foot);
        inside += view.winding_change(patch.reference);
        let off = view.distance_squared();
        if off + height * height >= reach {
            continue;
        }
        near = true;
        let line = view.line(local);
        if off <= radius * radius {
            change += view.winding_changes(local, line.across);
        }
        if let Some(correction) = &mut correction {
            correction.update_nearest(&line, edge.length);
        }
        view.add_to(local, &kernel, &line, &mut edge_sums);
    }
    // Nothing of the patch is in reach.
    if inside == 0.0 && !near {
        return None;
    }
    // Beyond the reach nothing counts.
    let within = local.square.simd_lt(1.0);
    let inside = within.select(change + inside, zero);
    // The plane less the boundary, and the correction for tilt.
    let mut sums = PatchIntegral::new(local, &kernel, &edge_sums, inside);
    if let Some(correction) = correction {
        sums.turning = correction.add_to(local, tilt.cosine, inside, &mut sums);
    }
    Some(sums)
}

impl<S: Simd> Accumulator<S> {
    #[inline(always)]
    fn add_flat(&mut self, weight: f32x16<S>, sums: &PatchIntegral<S>, [u, v, normal]: [Vec3; 3]) {
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

    /// Adds a curved patch: the normal times `(1 - H ξ)` times the integral over the developed
    /// patch, with `H` the mean curvature and `ξ` the height. Correct to first order in the
    /// curvature.
    #[inline(always)]
    fn add_curved(
        &mut self,
        [x, y, up]: Vectors<S>,
        sums: &PatchIntegral<S>,
        developed: &DevelopedSamples<S>,
        patch: &Patch,
    ) {
        let mean = 0.5 * (patch.curvature.x + patch.curvature.y);
        let stretch = 1.0 - developed.height * mean;
        let value = sums.value * stretch;
        let flux = value + sums.turning * stretch;
        let [u, v, normal] = patch.axes;
        self.value += up * value;
        let height = sums.height * stretch - sums.value * mean;
        let [ix, iy] = developed.shrunk;
        let slopes = [
            x * flux * developed.bent[0] + up * stretch * sums.along[0] * ix,
            y * flux * developed.bent[1] + up * stretch * sums.along[1] * iy,
            up * height,
        ];
        // Along the patch's axes.
        let slope = developed.to_patch_axes(&slopes);
        let bent = scaled(&developed.normal, flux);
        for k in 0..3 {
            let sum = slope[0].mul_add(u[k], self.gradient[k]);
            self.gradient[k] = slope[2].mul_add(normal[k], slope[1].mul_add(v[k], sum));
            let sum = bent[0].mul_add(u[k], self.flux[k]);
            self.flux[k] = bent[2].mul_add(normal[k], bent[1].mul_add(v[k], sum));
        }
    }

    #[inline(always)]
    fn reduce(&self, samples: &Samples<S>) -> ClusterSum {
        let [gx, gy, gz] = self.gradient;
        let [ax, ay, az] = samples.arm;
        let [nx, ny, nz] = samples.normal;
        let [ux, uy, uz] = self.flux;
        let x = ay * gz - az * gy + samples.area * (ny * uz - nz * uy);
        let y = az * gx - ax * gz + samples.area * (nz * ux - nx * uz);
        let z = ax * gy - ay * gx + samples.area * (nx * uy - ny * ux);
        ClusterSum {
            value: self.value.reduce_sum(),
            gradient: Vec3::new(gx.reduce_sum(), gy.reduce_sum(), gz.reduce_sum()),
            moment: Vec3::new(x.reduce_sum(), y.reduce_sum(), z.reduce_sum()),
        }
    }
}
