//! The density as the paper computes it (eq_10): one sample per triangle, all triangles for every
//! point; plain, and on sixteen points at a time. Both are given the distances.

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use fearless_simd_macros::simd;
use glam::{DVec3, Vec3};
use num_complex::Complex64;
use sdf_grid::TriangleMesh;

/// Points per packet of [`MidpointSum::packet`].
pub const LANES: usize = 16;

/// Centroids and area vectors of all triangles.
pub struct MidpointSum {
    samples: Vec<(DVec3, DVec3)>,
    sigma: f64,
    level: Level,
}

impl MidpointSum {
    /// One sample for each triangle of `mesh`.
    pub fn new(mesh: &TriangleMesh, sigma: f64) -> Self {
        let sample = |[a, b, c]: [DVec3; 3]| ((a + b + c) / 3.0, 0.5 * (b - a).cross(c - a));
        Self {
            samples: mesh.faces().map(sample).collect(),
            sigma,
            level: Level::new(),
        }
    }

    /// Both unit parts together, `exterior + interior`, at `p` whose signed distance is `xi`.
    pub fn at(&self, p: DVec3, xi: f64) -> Complex64 {
        let mut sum = Complex64::ZERO;
        for (centre, area) in &self.samples {
            let r = p - *centre;
            let eta = r.length();
            let u = eta / xi.abs();
            let x = (u - 1.0) / self.sigma;
            let z = Complex64::new(xi.signum(), u);
            let weight = r.dot(*area) / (eta * eta * eta) * (-0.5 * x * x).exp();
            sum += u * u / (z * z) * weight;
        }
        sum * (xi.signum() / (2.0 * std::f64::consts::PI * self.sigma))
    }

    /// As [`MidpointSum::at`], for sixteen points, in single precision; real and imaginary parts.
    pub fn packet(&self, points: &[DVec3; LANES], xi: &[f32; LANES]) -> [[f32; LANES]; 2] {
        dispatch!(self.level, simd => packet(simd, self, points, xi))
    }
}

#[simd]
fn packet<S: Simd>(
    simd: S,
    sum: &MidpointSum,
    points: &[DVec3; LANES],
    xi: &[f32; LANES],
) -> [[f32; LANES]; 2] {
    let splat = |v: f32| f32x16::splat(simd, v);
    let origin = points[0];
    let place = |k: usize| {
        f32x16::simd_from(
            simd,
            std::array::from_fn::<f32, LANES, _>(|i| (points[i] - origin)[k] as f32),
        )
    };
    let (px, py, pz) = (place(0), place(1), place(2));
    let signed = f32x16::simd_from(simd, *xi);
    let inverse = 1.0 / signed.abs();
    let inverse_sigma = 1.0 / sum.sigma as f32;
    let (mut re, mut im) = (splat(0.0), splat(0.0));
    for (centre, area) in &sum.samples {
        let (c, n): (Vec3, Vec3) = ((*centre - origin).as_vec3(), area.as_vec3());
        let (x, y, z) = (px - c.x, py - c.y, pz - c.z);
        let squared = x.mul_add(x, y.mul_add(y, z * z));
        let across = x.mul_add(splat(n.x), y.mul_add(splat(n.y), z * n.z));
        let u = squared.sqrt() * inverse;
        let t = (u - 1.0) * inverse_sigma;
        let e = exp(t * t * -0.5);
        let u2 = u * u;
        // u^2 / (s + iu)^2 / eta^3 = (1 - u^2 - 2 i s u) / ((1 + u^2)^2 u |xi|^3).
        let w = 1.0 / (u2 + 1.0);
        let weight = across * e * w * w / u;
        re = weight.mul_add(1.0 - u2, re);
        im = weight.mul_add(u * -2.0, im);
    }
    let scale = inverse * inverse * inverse / (2.0 * std::f32::consts::PI * sum.sigma as f32);
    let one = splat(1.0).copysign(signed);
    [(re * scale * one).into(), (im * scale).into()]
}

/// The exponential of a non-positive number to about 2e-7; zero below -80.
#[inline(always)]
fn exp<S: Simd>(x: f32x16<S>) -> f32x16<S> {
    let y = x.max(-80.0) * std::f32::consts::LOG2_E;
    let n = y.round_ties_even();
    let f = y - n;
    let mut p = f32x16::splat(x.token(), 1.877_576_7e-3);
    for c in [
        8.989_34e-3,
        5.582_632e-2,
        2.401_536e-1,
        6.931_531e-1,
        0.999_999_94,
    ] {
        p = p.mul_add(f, f32x16::splat(x.token(), c));
    }
    let bits: fearless_simd::i32x16<S> = ((n + 127.0) * 8_388_608.0).to_int();
    p * bits.bitcast::<f32x16<S>>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::meshes;
    use sdf_grid::{DensityKernel, ReferenceDensity};

    #[test]
    fn sums_over_fine_meshes_are_the_density() {
        let mesh = meshes::curved(100_000).unwrap();
        let reference = ReferenceDensity::new(&mesh, &DensityKernel::new(0.2).unwrap());
        let sum = MidpointSum::new(&mesh, 0.2);
        let points: [DVec3; LANES] =
            std::array::from_fn(|i| DVec3::new(0.002 * i as f64, 1e-3, 2e-3));
        let distances = points.map(|p| reference.signed_distance(p));
        let [re, im] = sum.packet(&points, &distances.map(|d| d as f32));
        let far = |xi: &f64| xi.abs() >= 3e-3;
        assert!(distances.iter().filter(|xi| far(xi)).count() >= 8);
        for (i, (p, xi)) in points.into_iter().zip(distances).enumerate() {
            if !far(&xi) {
                continue;
            }
            let exact = reference.unit_density(p, 1e-6).combined(1.0, 1.0);
            let plain = sum.at(p, xi);
            let packet = Complex64::new(re[i].into(), im[i].into());
            // Triangles of 0.1 mm; the integrand is as wide as sigma times the distance, 0.6 mm and
            // more: second order, (1/6)²/24 = 1e-3, and single precision.
            assert!(
                (plain - exact).norm() < 2e-3 * exact.norm(),
                "{plain} {exact}"
            );
            assert!(
                (packet - plain).norm() < 1e-4 * exact.norm(),
                "{packet} {plain}"
            );
        }
    }
}
