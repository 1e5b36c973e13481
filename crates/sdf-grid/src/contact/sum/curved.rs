//! Curved surfaces: osculating tori and cylinders, and coordinates developed from them into a
//! plane.
//!
//! Seen from different places, a torus fitted to facets differs by a part of the facets' deviation
//! from it, and the sum has a small step where a cluster moves from one cell to the next. A
//! cylinder, the commonest curved surface of mating parts, is therefore fitted to a whole region.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use glam::{DMat2, DMat3, DVec2, DVec3, Vec2};

use super::kernel::{Vectors, inner, splat};
use crate::support::angle::upper_angle;

/// Largest curvature, per reach of the kernel: the axis of a stronger bend would be within reach of
/// the surface, where places have more than one foot.
const MOST_BENT: f64 = 1.0;

/// Smaller curvatures count as zero.
const LEAST_BENT: f64 = 1e-4;

/// Deviation allowed of a torus from the surface near by, and its growth with the distance beyond
/// [`NEAR`], in units of the reach.
pub(super) const OFF: f64 = 0.006;
const OFF_FAR: f64 = 0.03;
pub(super) const NEAR: f64 = 0.9;

/// Cosine of the largest angle between normals of the surface and of the torus.
pub(super) const ALONG: f64 = 0.95;

/// Iterations of the fit, each starting from the torus before.
const LOOKS: usize = 4;

/// A small piece of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surfel {
    pub(super) place: DVec3,
    pub(super) normal: DVec3,
    pub(super) area: f64,
}

impl Surfel {
    /// The surfel in units of `unit`, relative to `origin`.
    pub(super) fn scaled(&self, origin: DVec3, unit: f64) -> Self {
        Self {
            place: (self.place - origin) / unit,
            normal: self.normal,
            area: self.area / (unit * unit),
        }
    }
}

/// A torus, a cylinder, a sphere or a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct OsculatingTorus {
    /// A point of it.
    pub(super) origin: DVec3,
    /// Its principal directions there and its normal; right-handed.
    pub(super) axes: [DVec3; 3],
    /// Its principal curvatures, positive if it is convex.
    pub(super) curvature: DVec2,
}

impl OsculatingTorus {
    /// Fits a torus to the surface around the first of `surfels`; the others are its neighbours
    /// within [`NEAR`]. None if the surface is bent too much.
    pub(super) fn fit(surfels: &[Surfel]) -> Option<Self> {
        let first = surfels.first()?;
        let (u, v) = first.normal.any_orthonormal_pair();
        let mut torus = Self {
            origin: first.place,
            axes: [u, v, first.normal],
            curvature: DVec2::ZERO,
        };
        for _ in 0..LOOKS {
            torus = torus.refine_fit(surfels)?;
        }
        let bent = torus.curvature.abs().max_element();
        if bent < LEAST_BENT {
            torus.curvature = DVec2::ZERO;
        }
        (bent <= MOST_BENT).then_some(torus)
    }

    /// Whether it approximates `surfels` within what the distance from the origin allows.
    pub(super) fn approximates(&self, mut surfels: impl Iterator<Item = Surfel>) -> bool {
        surfels.all(|s| {
            let beyond = (s.place.length() - NEAR).max(0.0);
            self.contains(&s, OFF + OFF_FAR * beyond * beyond)
        })
    }

    /// Whether a surfel is within `off` of it and has a similar normal.
    fn contains(&self, surfel: &Surfel, off: f64) -> bool {
        let [x, y, z] = self.axes.map(|a| (surfel.place - self.origin).dot(a));
        let [kx, ky] = self.curvature.to_array();
        let (lifted, about) = rise(z, y, ky);
        let (height, around) = rise(lifted, x, kx);
        if height.abs() > off {
            return false;
        }
        let [nx, ny, nz] = self.axes.map(|a| surfel.normal.dot(a));
        let up = (ky * y * ny + (1.0 + ky * z) * nz) / about;
        kx * x * nx + (1.0 + kx * lifted) * up >= ALONG * around
    }

    /// The torus with its origin moved.
    pub(super) fn translated(self, by: DVec3) -> Self {
        Self {
            origin: self.origin + by,
            ..self
        }
    }

    /// One least-squares step on the residuals, weighted towards the first surfel.
    fn refine_fit(&self, surfels: &[Surfel]) -> Option<Self> {
        let about = surfels.first()?.place;
        let mut normal = [[0.0; 6]; 6];
        let mut right = [0.0; 6];
        for s in surfels {
            let off = s.place.distance_squared(about) / (NEAR * NEAR);
            let weight = s.area * (1.0 - off) * (1.0 - off);
            let (p, middle) = self.developed(s.place);
            // On average over the surfel, which is bent, it is to be on the torus.
            let height = middle + s.area / 24.0 * (self.curvature.x + self.curvature.y);
            let row = [1.0, p.x, p.y, 0.5 * p.x * p.x, p.x * p.y, 0.5 * p.y * p.y];
            for i in 0..6 {
                right[i] += weight * row[i] * height;
                for j in i..6 {
                    normal[i][j] += weight * row[i] * row[j];
                }
            }
        }
        // The other half is the same.
        let upper = normal;
        for (i, row) in normal.iter_mut().enumerate() {
            let column = upper.iter().map(|r| r[i]).take(i);
            row.iter_mut().zip(column).for_each(|(x, y)| *x = y);
        }
        // Directions that surfels leave undetermined, as on a line, keep their values.
        let trace = (0..6).map(|i| normal[i][i]).sum::<f64>();
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] += 1e-9 * trace;
        }
        let c = solve(normal, right)?;
        let [u, v, n] = self.axes;
        let up = (n - c[1] * u - c[2] * v).try_normalize()?;
        let u = (u - u.dot(up) * up).try_normalize()?;
        let v = up.cross(u);
        let bent = DMat2::from_diagonal(self.curvature)
            - DMat2::from_cols(DVec2::new(c[3], c[4]), DVec2::new(c[4], c[5]));
        let (turn, curvature) = principal_curvatures(bent);
        Some(Self {
            origin: self.origin + c[0] * n,
            axes: [turn.x * u + turn.y * v, turn.x * v - turn.y * u, up],
            curvature: curvature.clamp(DVec2::splat(-1.0), DVec2::splat(1.0)),
        })
    }

    /// Developed coordinates of a place, and its height above the torus.
    pub(super) fn developed(&self, p: DVec3) -> (DVec2, f64) {
        let [x, y, z] = self.axes.map(|a| (p - self.origin).dot(a));
        let [kx, ky] = self.curvature.to_array();
        let (lifted, _) = rise(z, y, ky);
        let place = DVec2::new(arc_length(lifted, x, kx), arc_length(z, y, ky));
        (place, rise(lifted, x, kx).0)
    }
}

/// Height above a circle of curvature `k` through the origin, and distance from its middle in
/// radii.
fn rise(z: f64, x: f64, k: f64) -> (f64, f64) {
    let square = x * x + z * z;
    let distance = (1.0 + k * (2.0 * z + k * square)).max(0.0).sqrt();
    ((2.0 * z + k * square) / (1.0 + distance), distance)
}

/// Arc length on the circle to the foot of a place.
fn arc_length(z: f64, x: f64, k: f64) -> f64 {
    match k.abs() < LEAST_BENT {
        true => x,
        false => (k * x).atan2(1.0 + k * z) / k,
    }
}

/// Direction of the greater eigenvalue of a symmetric matrix, and both eigenvalues.
fn principal_curvatures(m: DMat2) -> (DVec2, DVec2) {
    let (half, off) = (0.5 * (m.x_axis.x - m.y_axis.y), m.x_axis.y);
    let angle = 0.5 * off.atan2(half);
    let (middle, spread) = (0.5 * (m.x_axis.x + m.y_axis.y), half.hypot(off));
    (
        DVec2::from_angle(angle),
        DVec2::new(middle + spread, middle - spread),
    )
}

/// Solves symmetric positive definite equations; none if they are not.
fn solve<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    for i in 0..N {
        let (row, right) = (a[i], b[i]);
        if row[i].is_nan() || row[i] <= 0.0 {
            return None;
        }
        for j in i + 1..N {
            let factor = a[j][i] / row[i];
            a[j].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
            b[j] -= factor * right;
        }
    }
    for i in (0..N).rev() {
        let known = a[i].iter().zip(b).skip(i + 1);
        b[i] = (b[i] - known.map(|(x, y)| x * y).sum::<f64>()) / a[i][i];
    }
    Some(b)
}

/// Squarings of the moment matrix in the power iteration for the axis.
const SQUARINGS: usize = 20;

/// A cylinder; lengths are in units of the reach.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cylinder {
    /// A point of its axis, and the axis' direction.
    centre: DVec3,
    along: DVec3,
    radius: f64,
    /// One if normals point outwards, minus one if inwards.
    side: f64,
}

impl Cylinder {
    /// Fits a cylinder; none if some surfel does not lie on it.
    pub(super) fn fit(surfels: &[Surfel]) -> Option<Self> {
        // Axis direction.
        let along = axis_direction(surfels)?;
        let area: f64 = surfels.iter().map(|s| s.area).sum();
        let mean = surfels.iter().map(|s| s.area * s.place).sum::<DVec3>() / area;
        let (u, v) = along.any_orthonormal_pair();
        // x² + y² = a x + b y + c by least squares.
        let (mut normal, mut right) = ([[0.0; 3]; 3], [0.0; 3]);
        for s in surfels {
            let p = s.place - mean;
            let p = DVec2::new(p.dot(u), p.dot(v));
            let row = [p.x, p.y, 1.0];
            for i in 0..3 {
                right[i] += s.area * row[i] * p.length_squared();
                for j in 0..3 {
                    normal[i][j] += s.area * row[i] * row[j];
                }
            }
        }
        // Centre and radius.
        let [a, b, c] = solve(normal, right)?;
        let centre = mean + 0.5 * (a * u + b * v);
        let radius = (c + 0.25 * (a * a + b * b)).sqrt();
        let out = |s: &Surfel| (s.place - centre).dot(s.normal) * s.area;
        let cylinder = Self {
            centre,
            along,
            // Surfels are bent: their middles lie below their surface.
            radius: radius + area / surfels.len() as f64 / (24.0 * radius),
            side: surfels.iter().map(out).sum::<f64>().signum(),
        };
        // All surfels must lie on it.
        let on = |s: &Surfel| {
            let torus = cylinder.tangent_torus(s.place);
            torus.is_some_and(|t| {
                (s.place - t.origin).length() <= OFF && t.axes[2].dot(s.normal) >= ALONG
            })
        };
        (radius * MOST_BENT >= 1.0 && surfels.iter().all(on)).then_some(cylinder)
    }

    /// The cylinder as a torus at the point nearest to `p`; `p` and the result are relative to
    /// `middle`.
    pub(super) fn tangent_torus_from(&self, middle: DVec3, p: DVec3) -> Option<OsculatingTorus> {
        let torus = self.tangent_torus(middle + p)?;
        Some(OsculatingTorus {
            origin: torus.origin - middle,
            ..torus
        })
    }

    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// The direction of its axis.
    #[cfg(test)]
    pub(super) fn along(&self) -> DVec3 {
        self.along
    }

    /// Developed coordinates of a place on it: along the circle, and along the axis.
    pub(super) fn developed(&self, p: DVec3) -> DVec2 {
        let (u, v) = self.along.any_orthonormal_pair();
        let from = p - self.centre;
        let angle = from.dot(v).atan2(from.dot(u));
        DVec2::new(self.radius * angle, from.dot(self.along))
    }

    fn tangent_torus(&self, p: DVec3) -> Option<OsculatingTorus> {
        let from = p - self.centre;
        let height = from.dot(self.along);
        let out = (from - height * self.along).try_normalize()?;
        let normal = self.side * out;
        Some(OsculatingTorus {
            origin: self.centre + height * self.along + self.radius * out,
            axes: [self.along.cross(normal), self.along, normal],
            curvature: DVec2::new(self.side / self.radius, 0.0),
        })
    }
}

/// The direction most nearly perpendicular to all normals: that of the least moment.
fn axis_direction(surfels: &[Surfel]) -> Option<DVec3> {
    let mut moments = DMat3::ZERO;
    for s in surfels {
        let n = s.normal;
        moments += DMat3::from_cols(n * n.x, n * n.y, n * n.z) * s.area;
    }
    let trace = moments.x_axis.x + moments.y_axis.y + moments.z_axis.z;
    let rest = DMat3::from_diagonal(DVec3::splat(trace)) - moments;
    let mut power = rest * (1.0 / trace);
    for _ in 0..SQUARINGS {
        power = power * power;
        let most = power.to_cols_array().into_iter().fold(0.0, f64::max);
        power *= 1.0 / most;
    }
    let columns = [power.x_axis, power.y_axis, power.z_axis];
    let longest = columns.into_iter().max_by(|a, b| {
        let [a, b] = [a, b].map(|c| c.length_squared());
        a.total_cmp(&b)
    });
    longest?.try_normalize()
}

/// Distances from a circle's centre are at least this, in units of its radius, so that directions
/// exist.
const CENTRE: f32 = 1e-2;

/// Coordinates relative to a circle through the origin, tangent to `x` there, with its centre below
/// for positive curvature.
pub(super) struct Circle<S: Simd> {
    pub(super) height: f32x16<S>,
    /// Arc length to the foot, along the circle.
    pub(super) place: f32x16<S>,
    /// Cosine and sine of the angle by which the circle turns on the way there.
    pub(super) cosine: f32x16<S>,
    pub(super) sine: f32x16<S>,
    /// The circle's radius over the distance from its centre.
    pub(super) shrunk: f32x16<S>,
}

impl<S: Simd> Circle<S> {
    /// Coordinates of `(x, z)` relative to a circle of curvature `k`.
    #[inline(always)]
    pub(super) fn new(x: f32x16<S>, z: f32x16<S>, k: f32) -> Self {
        let simd = x.token();
        let (zero, one) = (splat(simd, 0.0), splat(simd, 1.0));
        if k == 0.0 {
            return Self {
                height: z,
                place: x,
                cosine: one,
                sine: zero,
                shrunk: one,
            };
        }
        let square = x.mul_add(x, z * z);
        let rise = square.mul_add(k, z + z);
        let distance = rise.mul_add(k, one).max(CENTRE * CENTRE).sqrt();
        let shrunk = one / distance;
        let (up, aside) = (z.mul_add(k, one), x * k);
        let angle = upper_angle(aside.abs(), up).copysign(aside);
        Self {
            height: rise / (distance + 1.0),
            place: angle * (1.0 / k),
            cosine: up * shrunk,
            sine: aside * shrunk,
            shrunk,
        }
    }
}

/// Height above a circle of curvature `k` and arc length to the foot, as in [`Circle`].
#[inline(always)]
pub(super) fn circle_coordinates(x: f32, z: f32, k: f32) -> [f32; 2] {
    let rise = 2.0 * z + k * (x * x + z * z);
    let distance = (1.0 + k * rise).max(0.0).sqrt();
    let place = match k == 0.0 {
        true => x,
        false => (k * x).atan2(1.0 + k * z) / k,
    };
    [rise / (1.0 + distance), place]
}

/// Developed coordinates of samples above a torus; vectors are in the axes of its patch.
pub(super) struct DevelopedSamples<S: Simd> {
    pub(super) height: f32x16<S>,
    /// The feet, developed.
    pub(super) place: [f32x16<S>; 2],
    /// Unit gradients of the height and of both developed coordinates.
    pub(super) normal: Vectors<S>,
    pub(super) x: Vectors<S>,
    pub(super) y: Vectors<S>,
    /// Slopes of the developed coordinates with lengths along these.
    pub(super) shrunk: [f32x16<S>; 2],
    /// Slopes of the normal with lengths along these.
    pub(super) bent: [f32x16<S>; 2],
}

impl<S: Simd> DevelopedSamples<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, curvature: Vec2, [x, y, z]: Vectors<S>) -> Self {
        let zero = splat(simd, 0.0);
        let b = Circle::new(y, z, curvature.y);
        let a = Circle::new(x, b.height, curvature.x);
        Self {
            height: a.height,
            place: [a.place, b.place],
            normal: [a.sine, a.cosine * b.sine, a.cosine * b.cosine],
            x: [a.cosine, zero - a.sine * b.sine, zero - a.sine * b.cosine],
            y: [zero, b.cosine, zero - b.sine],
            shrunk: [a.shrunk, b.shrunk],
            bent: [a.shrunk * curvature.x, a.cosine * b.shrunk * curvature.y],
        }
    }
}

impl<S: Simd> DevelopedSamples<S> {
    /// Transforms a direction from the patch's axes to `x`, `y` and the normal.
    #[inline(always)]
    pub(super) fn to_local(&self, v: &Vectors<S>) -> Vectors<S> {
        [inner(v, &self.x), inner(v, &self.y), inner(v, &self.normal)]
    }

    /// Transforms a direction back to the patch's axes.
    #[inline(always)]
    pub(super) fn to_patch_axes(&self, v: &Vectors<S>) -> Vectors<S> {
        let mut sum = *v;
        for (k, sum) in sum.iter_mut().enumerate() {
            let ends = v[1].mul_add(self.y[k], v[2] * self.normal[k]);
            *sum = v[0].mul_add(self.x[k], ends);
        }
        sum
    }
}
