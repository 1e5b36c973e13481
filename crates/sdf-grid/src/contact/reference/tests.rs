//! The sum over surfaces against closed forms.

use glam::{DMat3, DQuat, DVec3};

use super::kernel::ContactKernel;
use super::surface::{ContactSurface, Flux};
use crate::contact::samples::{SurfaceSample, surface_samples};
use crate::mesh::shapes;

/// Density and distribution of the normal distribution, the latter by integrating the former.
fn normal(x: f64) -> [f64; 2] {
    let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let steps = 2000;
    let step = x / f64::from(steps);
    let sum: f64 = (0..steps)
        .map(|i| density((f64::from(i) + 0.5) * step))
        .sum();
    [density(x), 0.5 + sum * step]
}

/// Length of the overlap of two intervals of half lengths `a`, `b` whose middles are `t` apart,
/// averaged over Gaussian displacements of variance `v`.
fn overlap(t: f64, a: f64, b: f64, v: f64) -> f64 {
    let s = v.sqrt();
    let ramp = |x: f64| {
        let [density, below] = normal(x / s);
        x * below + s * density
    };
    ramp(t + a + b) - ramp(t + a - b) - ramp(t - a + b) + ramp(t - a - b)
}

/// What the sum must be for two boxes along the axes: the overlap less the smoothed and sharpened
/// one.
fn lost(a: DVec3, b: DVec3, at: DVec3, width: f64) -> f64 {
    let exact: f64 = (0..3)
        .map(|k| (a[k].min(at[k] + b[k]) - (-a[k]).max(at[k] - b[k])).max(0.0))
        .product();
    let v = width * width;
    let smoothed = |v: f64| {
        (0..3)
            .map(|k| overlap(at[k], a[k], b[k], v))
            .product::<f64>()
    };
    let slope = (smoothed(1.001 * v) - smoothed(0.999 * v)) / (2e-3 * v);
    exact - (smoothed(v) - v * slope)
}

fn sum(surface: &ContactSurface, samples: &[SurfaceSample], at: DVec3) -> f64 {
    let seen = |s: &SurfaceSample| surface.flux(s.position + at).value.dot(s.area);
    samples.iter().map(seen).sum()
}

/// With faces, edges and corners in reach of one another; sampled finely, so that what differs is
/// the midpoint rule (second order) and the end of the reach. Both boxes along the axes, for which
/// the closed form holds, and both turned and shifted with them.
#[test]
fn two_boxes_lose_what_smoothing_takes() {
    let (a, b) = (DVec3::new(2.0, 1.5, 1.2), DVec3::new(1.0, 1.7, 0.8));
    let solid = |half: DVec3| shapes::cuboid(2.0 * half).unwrap();
    let width = 0.4;
    let surface = ContactSurface::new(&solid(a), width);
    let samples = surface_samples(&solid(b), 0.05).unwrap();
    let area: f64 = samples.iter().map(|s| s.area.length()).sum();
    assert!((area - solid(b).area()).abs() < 1e-9 * area);
    let turn = DQuat::from_scaled_axis(DVec3::new(-0.3, 1.1, 0.6));
    let shift = DVec3::new(3.0, -7.0, 0.4);
    let turned = ContactSurface::new(&solid(a).transformed(turn, shift), width);
    let turned_samples = surface_samples(&solid(b).transformed(turn, shift), 0.05).unwrap();
    for at in [
        DVec3::new(0.3, 0.1, 0.2),
        DVec3::new(1.0, 0.2, 0.4),
        DVec3::new(2.9, 3.1, 1.9),
        DVec3::new(2.4, 2.6, 1.5),
        DVec3::new(3.0, 0.1, 0.0),
    ] {
        let expected = lost(a, b, at, width);
        for found in [
            sum(&surface, &samples, at),
            sum(&turned, &turned_samples, turn * at),
        ] {
            assert!(
                (found - expected).abs() < 2e-3 * expected.abs() + 2e-5,
                "{at}: {found} instead of {expected}"
            );
        }
    }
}

#[test]
fn planes_have_the_unit_normal_loss() {
    let kernel = ContactKernel::new(0.7);
    for x in [-2.0f64, -0.3, 0.0, 0.1, 0.9, 3.0] {
        let z = x.abs() / 0.7;
        let [density, below] = normal(z);
        let expected = 0.7 * (density - z * (1.0 - below)) - 0.35 * density;
        assert!((kernel.plane(x).0 - expected).abs() < 1e-7, "{x}");
        let h = 1e-5;
        let slope = (kernel.plane(x + h).0 - kernel.plane(x - h).0) / (2.0 * h);
        assert!((kernel.plane(x).1 - slope).abs() < 1e-6, "{x}");
    }
}

/// A turned body with concave edges, seen from everywhere near it: slopes are those of differences,
/// and the flux is that of the surface moved along.
#[test]
fn slopes_are_those_of_differences_in_every_frame() {
    let (hole, _) = shapes::PegInHole::Combined.pair(1e-4).unwrap();
    let width = 1.1e-3;
    let surface = ContactSurface::new(&hole, width);
    let (turn, shift) = (
        DQuat::from_scaled_axis(DVec3::new(0.5, -0.8, 0.3)),
        DVec3::new(0.013, -0.004, 0.021),
    );
    let moved = ContactSurface::new(&hole.transformed(turn, shift), width);
    let mut seen = 0;
    for i in 0..2000 {
        let place = DVec3::new(
            f64::from(i % 13),
            f64::from(i / 13 % 13),
            f64::from(i / 169),
        );
        let p = DVec3::new(0.042, 0.0417, 0.033) * (place / 12.0 - 0.5) + 1.7e-5;
        let Flux { value, slope } = surface.flux(p);
        let there = moved.flux(turn * p + shift);
        assert!((there.value - turn * value).length() < 1e-6 * width, "{p}");
        if value == DVec3::ZERO {
            continue;
        }
        seen += 1;
        let h = 1e-7;
        let at = |q: DVec3| surface.flux(q).value;
        let column = |d: DVec3| (at(p + d * h) - at(p - d * h)) / (2.0 * h);
        let differences = DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
        let off = (slope - differences).to_cols_array().map(f64::abs);
        let most = off.into_iter().fold(0.0, f64::max);
        assert!(most < 1e-3, "{p}: {slope} instead of {differences}");
    }
    assert!(seen > 500, "{seen}");
}
