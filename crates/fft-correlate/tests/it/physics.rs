//! The energy against closed forms and the symmetries of the paper's peg-in-hole pairs.

use crate::physics_support::{COLUMNS, fitted, kink_slope, tongue_and_groove};
use fft_correlate::{DirectEvaluator, DirectOptions, EnergySource, Pair, ScoreModel};
use glam::{DQuat, DVec3};
use sdf_grid::shapes::PegInHole;

/// Energy at a displacement and yaw of the moving part.
struct Energies {
    pair: Pair,
    direct: DirectEvaluator,
}

impl Energies {
    fn new(pair: Pair, options: &DirectOptions) -> Self {
        let direct = DirectEvaluator::new(&pair, options).expect("valid pair");
        Self { pair, direct }
    }

    fn at(&self, yaw: f64, displacement: DVec3) -> f64 {
        let pose = self.pair.pose(DQuat::from_rotation_z(yaw), displacement);
        let mut scratch = self.direct.scratch();
        self.direct.evaluate(&pose, &mut scratch).energy
    }
}

fn models() -> [ScoreModel; 3] {
    [
        ScoreModel::GUIDED,
        ScoreModel::PAPER,
        ScoreModel {
            sigma: 0.05,
            separation_weight: 0.5,
            ..ScoreModel::PAPER
        },
    ]
}

/// At zero clearance the energy is V-shaped: its slope follows from the density just inside and
/// outside a face alone. The secant over one spacing also sees the skeleton shift, which is
/// smooth, so it approaches the closed form in first order of the spacing; both sides agree.
#[test]
fn contact_slope_is_the_closed_form() {
    let thickness = 0.020;
    for model in models() {
        // The skeleton's ridges are sigma wide: the finest lattice has about 100 cells across them.
        let errors = [25.6, 51.2, 102.4].map(|cells| {
            let cells = (cells / model.sigma).round() as usize;
            let energies = Energies::new(
                tongue_and_groove(thickness, cells, &model),
                &DirectOptions::FULL,
            );
            let h = energies.pair.spacing();
            let columns = (COLUMNS as f64 * h).powi(2);
            let expected = kink_slope(&model, 2.0 * columns);
            let [up, down, fit] = [h, -h, 0.0].map(|s| energies.at(0.0, DVec3::Z * s));
            assert!((up - down).abs() < 1e-4 * (up - fit), "{up} and {down}");
            (up - fit) / h / expected - 1.0
        });
        let sigma = model.sigma;
        assert!(errors[2].abs() < 0.05, "sigma {sigma}: {errors:?}");
        for pair in errors.windows(2) {
            let gain = pair[0] / pair[1];
            assert!((1.6..2.6).contains(&gain), "sigma {sigma}: {errors:?}");
        }
    }
}

/// The assembled pose is the lowest along x, y and yaw for all three pairs, and their symmetries
/// hold: every quarter turn of the square peg, any spin of the round one.
#[test]
fn assembled_poses_are_the_lowest_and_symmetries_hold() {
    let h = PegInHole::RADIUS / 3.0;
    for shape in PegInHole::ALL {
        let pair = fitted(shape, h, &ScoreModel::GUIDED);
        let energies = Energies::new(pair, &DirectOptions::FULL);
        let fit = energies.at(0.0, DVec3::ZERO);
        assert!(fit < 0.0);
        for axis in [DVec3::X, DVec3::Y] {
            for step in [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0] {
                let moved = energies.at(0.0, step * h * axis);
                assert!(
                    moved > fit,
                    "{} at {step} {axis}: {moved}, fit {fit}",
                    shape.name()
                );
            }
        }
        let turned = |degrees: f64| energies.at(degrees.to_radians(), DVec3::ZERO) / fit;
        match shape {
            // Turned lattices no longer meet cell by cell, and reward is lost within a spacing of
            // the touching faces: a share in proportion to h / R (0.10 at h / R = 0.25).
            PegInHole::Circular => {
                for degrees in [10.0, 45.0, 77.0, 90.0, 180.0] {
                    let ratio = turned(degrees);
                    assert!(
                        (ratio - 1.0).abs() < 0.5 * h / PegInHole::RADIUS,
                        "round peg at {degrees}: {ratio}"
                    );
                }
            }
            PegInHole::Rectangular => {
                for degrees in [90.0, 180.0, 270.0] {
                    let ratio = turned(degrees);
                    assert!(
                        (ratio - 1.0).abs() < 1e-4,
                        "square peg at {degrees}: {ratio}"
                    );
                }
                assert!(
                    [-10.0, -5.0, 5.0, 10.0, 45.0]
                        .map(turned)
                        .iter()
                        .all(|&e| e < 0.99)
                );
            }
            PegInHole::Combined => {
                let others = [-90.0, -10.0, -5.0, 5.0, 10.0, 90.0, 180.0];
                assert!(others.map(turned).iter().all(|&e| e < 0.99));
            }
        }
    }
}
