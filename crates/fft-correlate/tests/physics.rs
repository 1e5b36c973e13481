//! The energy of the paper's peg-in-hole pairs against closed forms and symmetries.

mod physics_support;

use std::f64::consts::{FRAC_PI_2, TAU};

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, Pair, PairBuilder, Pose, ScoreModel,
};
use glam::{DQuat, DVec3};
use physics_support::{fitted, kink_slope};
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
        self.direct.evaluate(&pose, &mut self.direct.scratch()).energy
    }
}

/// At zero clearance the energy is V-shaped across the axis: its slope follows from the density
/// just inside and outside a face alone. Secants over one spacing see rounded corners as well, so
/// they approach it in first order.
#[test]
fn contact_slope_is_the_closed_form() {
    for (shape, sigma, area) in [(PegInHole::Circular, 0.2, 4.0 * 0.01 * 0.03), (PegInHole::Circular, 0.4, 4.0 * 0.01 * 0.03), (PegInHole::Rectangular, 0.4, 4.0 * 0.01 * 0.03)] {
    let model = ScoreModel {
        sigma,
        separation_weight: 0.0,
        ..ScoreModel::PAPER
    };
    let expected = kink_slope(&model, area);
    eprintln!("extrap {shape:?} {sigma}");
    for cells in [10, 14, 20] {
        let h = 0.020 / f64::from(cells);
        let energies = Energies::new(fitted(shape, h, &model), &DirectOptions::FULL);
        let e: Vec<f64> = (0..5).map(|i| energies.at(0.0, DVec3::X * (h * f64::from(i)))).collect();
        let s: Vec<f64> = (1..5).map(|i| (e[i] - e[0]) / (h * i as f64) / expected).collect();
        eprintln!("{cells} {s:?} extrapolated {} {}", 2.0 * s[0] - s[1], 3.0*s[0] - 3.0*s[1] + s[2]);
    }
}
}
