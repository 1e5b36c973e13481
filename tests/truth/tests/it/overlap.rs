//! Constant densities: the energy is a sum of volumes, known in closed form.

use fft_correlate::{Pose, ScoreModel, Wrench};
use glam::{DQuat, DVec2, DVec3};
use num_complex::Complex64;
use pegfit_truth::{Densities, Truth, TruthOptions};
use sdf_grid::TriangleMesh;
use sdf_grid::shapes::PegInHole;

use crate::common::{apart, difference, poses};

const EXTERIOR: Complex64 = Complex64::new(-0.07, -0.53);
const INTERIOR: Complex64 = Complex64::new(-0.07, 0.53);

/// Constant densities as far as any of the poses reaches; cells only to tell faces apart.
fn options() -> TruthOptions {
    TruthOptions {
        smallest: 0.25,
        largest: 1.0,
        halo: Some(0.06),
        densities: Densities::Constant {
            exterior: EXTERIOR,
            interior: INTERIOR,
        },
        ..TruthOptions::COARSE
    }
}

/// Joules per shared cubic metre.
fn per_volume(model: &ScoreModel) -> f64 {
    let (l1, l2) = (model.lambda_exterior, model.lambda_interior);
    let [fit, collision] = [EXTERIOR * INTERIOR, INTERIOR * INTERIOR].map(|c| c.re);
    -model.gamma * (l2 * l2 * collision - 2.0 * l1 * l2 * fit)
}

fn energy(hole: &TriangleMesh, peg: &TriangleMesh, shared: f64, model: &ScoreModel) -> f64 {
    let fit = model.lambda_exterior * model.lambda_interior * (EXTERIOR * INTERIOR).re;
    let apart = -model.gamma * fit * (hole.volume() + peg.volume());
    apart + per_volume(model) * shared
}

/// The area of a convex polygon within a half plane for each (normal, offset).
fn area(mut polygon: Vec<DVec2>, planes: &[(DVec2, f64)]) -> f64 {
    for (normal, offset) in planes {
        let mut kept = Vec::new();
        for (i, p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (a, b) = (normal.dot(*p) - offset, normal.dot(q) - offset);
            if a <= 0.0 {
                kept.push(*p);
            }
            if a * b < 0.0 {
                kept.push(*p + (q - *p) * (a / (a - b)));
            }
        }
        polygon = kept;
    }
    let next = polygon.iter().cycle().skip(1);
    0.5 * polygon
        .iter()
        .zip(next)
        .map(|(p, q)| p.perp_dot(*q))
        .sum::<f64>()
}

/// Shifted by any vector and turned about the axis, the peg shares prisms with the block.
#[test]
fn energies_of_prisms_are_volumes() {
    let model = ScoreModel::GUIDED;
    for (clearance, turn, shift) in [
        (0.0, 0.0, DVec3::new(4e-4, -1e-4, 2e-3)),
        (1e-4, 0.05, DVec3::new(2e-4, 3e-4, -1e-3)),
        (5e-4, 0.4, DVec3::new(1e-3, -2e-3, 5e-3)),
    ] {
        let (hole, peg) = PegInHole::Rectangular.pair(clearance).unwrap();
        let truth = Truth::new(&hole, &peg, &model, &options()).unwrap();
        let pose = Pose::new(DQuat::from_rotation_z(turn), shift);
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let rotation = DVec2::from_angle(turn);
        let section = corners.map(|c| rotation.rotate(DVec2::from(c) * 0.01) + shift.truncate());
        let square =
            |half: f64| [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].map(|normal| (normal, half));
        let within = |half: f64| area(section.to_vec(), &square(half));
        let height = PegInHole::HEIGHT - shift.z.abs();
        let shared = (within(0.02) - within(0.01 + clearance)) * height;
        let exact = energy(&hole, &peg, shared, &model);
        let found = truth.at(&pose).energy;
        // Rounding of some thousand pieces.
        assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    }
}

#[test]
fn wrenches_are_slopes_of_volumes() {
    for which in [PegInHole::Rectangular, PegInHole::Combined] {
        let (hole, peg) = which.pair(2e-4).unwrap();
        let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options()).unwrap();
        let poses = &poses()[1..];
        let found: Vec<Wrench> = poses.iter().map(|p| truth.at(p).wrench).collect();
        let slopes: Vec<Wrench> = poses.iter().map(|p| difference(&truth, p, 1e-7)).collect();
        // Volumes are piecewise cubic in the pose: differences over 0.1 um err by rounding alone.
        let [force, torque] = apart(&found, &slopes);
        assert!(
            force < 1e-4 && torque < 1e-4,
            "{} {force} {torque}",
            which.name()
        );
    }
}

/// Where walls coincide, the mean of the slopes to both sides.
#[test]
fn at_coinciding_walls_the_wrench_is_the_mean_of_both_sides() {
    let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
    let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options()).unwrap();
    let flush = Pose::from_translation(DVec3::new(0.0, 0.0, 4e-3));
    let beside = |x: f64| {
        truth.at(&flush.perturbed(&fft_correlate::Twist {
            angular: DVec3::ZERO,
            linear: DVec3::X * x,
        }))
    };
    let [left, right] = [-1e-7, 1e-7].map(|x| beside(x).wrench.force.x);
    let mean = 0.5 * (left + right);
    let found = truth.at(&flush).wrench.force.x;
    assert!(right.abs() > 1e-3, "{right}");
    assert!(
        (found - mean).abs() < 1e-6 * right.abs(),
        "{left} {found} {right}"
    );
}
