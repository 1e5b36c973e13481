use std::sync::Arc;

use num_complex::Complex64;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{Lattice, Sampling};

use super::*;
use crate::ScoreModel;

const H: f64 = 0.1;

/// A part that is a union of balls with made-up densities: exterior outside within a halo, interior
/// inside; smooth enough to turn, with nothing that favours an axis.
fn part(balls: &[(DVec3, f64)], min: [i64; 3], shape: [usize; 3]) -> DensityField {
    let origin = (DVec3::from_array(min.map(|m| m as f64)) + 0.5) * H;
    let lattice = Lattice::new(origin, H, shape).unwrap();
    let distance = |p: DVec3| {
        let to = |(c, r): &(DVec3, f64)| (p - c).length() - r;
        balls.iter().map(to).fold(f64::INFINITY, f64::min)
    };
    let at = |i, j, k| distance(lattice.position([i, j, k]));
    let complex = |re: f64, im: f64| Complex32::new(re as f32, im as f32);
    DensityField {
        exterior: Array3::from_shape_fn(shape, |(i, j, k)| match at(i, j, k) {
            d if d > 0.0 && d < 0.3 => complex((d * 5.0).cos() * (0.3 - d), d - 0.3),
            _ => Complex32::default(),
        }),
        interior: Array3::from_shape_fn(shape, |(i, j, k)| match at(i, j, k) {
            d if d <= 0.0 => complex(d, 0.7 - d),
            _ => Complex32::default(),
        }),
        signed_distance: Array3::from_shape_fn(shape, |(i, j, k)| at(i, j, k) as f32),
        lattice,
        sigma: 0.2,
        halo: 0.3,
        sampling: Sampling::Point,
        mesh_hash: [0; 32],
    }
}

fn fixed_part() -> DensityField {
    let balls = [
        (DVec3::new(0.1, 0.0, -0.2), 0.35),
        (DVec3::new(-0.35, 0.3, 0.1), 0.25),
    ];
    part(&balls, [-10, -8, -9], [18, 17, 16])
}

fn moving_part() -> DensityField {
    let balls = [
        (DVec3::new(0.05, 0.1, 0.0), 0.25),
        (DVec3::new(0.3, 0.05, 0.15), 0.15),
    ];
    part(&balls, [-6, -5, -6], [14, 12, 13])
}

fn pair(w: f64, pivot: DVec3) -> Pair {
    let model = ScoreModel {
        separation_weight: w,
        ..ScoreModel::GUIDED
    };
    Pair::new(
        Arc::new(fixed_part()),
        Arc::new(moving_part()),
        model,
        pivot,
    )
    .unwrap()
}

fn window() -> TranslationWindow {
    TranslationWindow::new(DVec3::new(-0.4, -0.2, -0.9), DVec3::new(0.2, 0.5, 0.3), H).unwrap()
}

/// The trilinear interpolant of a field in double precision, zero beyond the lattice.
fn interpolate(values: &Array3<Complex32>, at: DVec3) -> Complex64 {
    let mut sum = Complex64::default();
    for corner in 0..8 {
        let c = DVec3::new(
            (corner & 1) as f64,
            (corner >> 1 & 1) as f64,
            (corner >> 2) as f64,
        );
        let node = at.floor() + c;
        let weight = (1.0 - (at - node).abs()).to_array().iter().product::<f64>();
        if node.min_element() >= 0.0
            && let Some(v) = values.get(node.to_array().map(|v| v as usize))
        {
            sum += Complex64::new(v.re as f64, v.im as f64) * weight;
        }
    }
    sum
}

/// The score from its definition: the sum over all fixed nodes of the four weighted products.
fn direct(pair: &Pair, rotation: DQuat, displacement: DVec3) -> f64 {
    let m = pair.model();
    let (fixed, moving) = (pair.fixed(), pair.moving());
    let (l1, l2) = (m.lambda_exterior, m.lambda_interior);
    let back = pair.pose(rotation, displacement).inverse();
    let mut sum = 0.0;
    for ((i, j, k), o1) in fixed.exterior.indexed_iter() {
        let wide = |v: &Complex32| Complex64::new(v.re as f64, v.im as f64);
        let (o1, i1) = (wide(o1), wide(&fixed.interior[[i, j, k]]));
        let q = back.apply(fixed.lattice.position([i, j, k]));
        let q = moving.lattice.fractional_index(q);
        // Rounding must not push an exactly aligned node into the neighbouring cell.
        let q = (q * 1e9).round() / 1e9;
        let o2 = interpolate(&moving.exterior, q);
        let i2 = interpolate(&moving.interior, q);
        let f = o1 * o2 * (m.separation_weight * l1 * l1)
            + (o1 * i2 + i1 * o2) * (l1 * l2)
            + i1 * i2 * (l2 * l2);
        sum += f.re;
    }
    sum * H.powi(3)
}

fn score(pair: &Pair, rotation: DQuat, window: &TranslationWindow) -> Array3<f32> {
    let correlator = Correlator::plan(pair, window).unwrap();
    let mut out = Array3::from_elem(window.shape(), f32::NAN);
    correlator.score(rotation, &mut correlator.scratch(), out.view_mut());
    out
}

/// Relative L2 distance.
fn distance(a: &Array3<f32>, b: &Array3<f64>) -> f64 {
    let wrong: f64 = a.iter().zip(b).map(|(a, b)| (*a as f64 - b).powi(2)).sum();
    (wrong / b.iter().map(|b| b * b).sum::<f64>()).sqrt()
}

fn random_rotation(rng: &mut SmallRng) -> DQuat {
    let mut q = || rng.random_range(-1.0..1.0);
    DQuat::from_xyzw(q(), q(), q(), q()).normalize()
}

/// f32 transforms (1e-7) of fields whose products cancel to about a tenth.
const TOLERANCE: f64 = 1e-5;

#[test]
fn equals_the_direct_sum_for_every_separation_weight() {
    let mut rng = SmallRng::seed_from_u64(1);
    let window = window();
    for w in [0.0, 0.3, 1.0] {
        for pivot in [DVec3::ZERO, DVec3::new(0.123, -0.04, 0.3)] {
            let pair = pair(w, pivot);
            for rotation in [
                DQuat::IDENTITY,
                random_rotation(&mut rng),
                random_rotation(&mut rng),
            ] {
                let found = score(&pair, rotation, &window);
                let exact = Array3::from_shape_fn(window.shape(), |(i, j, k)| {
                    direct(&pair, rotation, window.displacement([i, j, k]))
                });
                let e = distance(&found, &exact);
                assert!(e < TOLERANCE, "w {w} pivot {pivot} {rotation}: {e}");
            }
        }
    }
}
