//! What the acceptance tests share: the paper's pairs on coarse lattices, scores by FFT, random
//! poses.

pub mod spectrum;

use fft_correlate::{
    Correlator, DirectEvaluator, DirectOptions, EnergySource, Pair, PairBuilder, Pose, Response,
    ScoreModel, TranslationWindow,
};
use glam::{DQuat, DVec3};
use haptic::{Geometry, Workspace};
use ndarray::Array3;
use rand::Rng;
use rand::rngs::SmallRng;
use sdf_grid::shapes::PegInHole;
use sdf_grid::{Silent, TriangleMesh};

/// A pair at the default halo and field tolerance; spacing in metres.
///
/// # Panics
/// If the builder refuses, which it does not for the examples.
pub fn pair_of(
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    model: &ScoreModel,
    spacing: f64,
) -> Pair {
    let builder = PairBuilder {
        spacing: Some(spacing),
        ..PairBuilder::default()
    };
    builder
        .build(fixed, moving, model, &Silent)
        .expect("a usable pair")
}

/// One of the paper's examples at zero clearance; spacing in metres.
///
/// # Panics
/// Never for a spacing of a few millimetres.
pub fn example(which: PegInHole, model: &ScoreModel, spacing: f64) -> Pair {
    let (hole, peg) = which.pair(0.0).expect("zero clearance is in range");
    pair_of(&hole, &peg, model, spacing)
}

/// Where a pair's fit is and how a hand gets there, and a device whose origin is the fit.
pub fn hand_at_fit(pair: &Pair) -> (Geometry, Workspace) {
    let seated = pair.pose(DQuat::IDENTITY, DVec3::ZERO);
    let geometry = Geometry {
        seated,
        axis: DVec3::NEG_Z,
        depth: PegInHole::HEIGHT,
        radius: 0.5 * PegInHole::RADIUS,
        tilt: 0.08,
    };
    (geometry, Workspace::new(1.0, seated, pair.pivot()))
}

/// Real part of the score at every displacement of the window, by FFT and with what contact adds,
/// cubic metres.
///
/// # Panics
/// If the window does not fit the pair.
pub fn scores(pair: &Pair, rotation: DQuat, window: &TranslationWindow) -> Array3<f32> {
    let correlator = Correlator::new(pair, window).expect("window on the pair's lattice");
    let mut out = Array3::zeros(window.shape());
    correlator.score(rotation, &mut correlator.scratch(), out.view_mut());
    pair.add_contact(rotation, window, out.view_mut());
    out
}

/// A direct evaluator with every cell its own point.
///
/// # Panics
/// If the pair has no interior.
pub fn full_direct(pair: &Pair) -> DirectEvaluator {
    DirectEvaluator::new(pair, &DirectOptions::FULL).expect("parts have an interior")
}

/// Energy and wrench at a pose.
pub fn ask(source: &dyn EnergySource, pose: &Pose) -> Response {
    source.evaluate(pose, &mut source.scratch())
}

/// A direction, uniform on the sphere.
pub fn direction(rng: &mut SmallRng) -> DVec3 {
    loop {
        let v = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A rotation by up to `angle` radians about a random axis.
pub fn rotation(rng: &mut SmallRng, angle: f64) -> DQuat {
    let turn = angle * rng.random_range(0.0f64..1.0).cbrt();
    DQuat::from_scaled_axis(direction(rng) * turn)
}

/// A displacement within the cube of half edge `reach`.
pub fn displacement(rng: &mut SmallRng, reach: f64) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-reach..reach)))
}

/// Root of the mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// The 24 rotations that take the coordinate axes to coordinate axes.
pub fn axis_rotations() -> Vec<DQuat> {
    use std::f64::consts::FRAC_PI_2;
    let faces = [
        DQuat::IDENTITY,
        DQuat::from_rotation_x(FRAC_PI_2),
        DQuat::from_rotation_x(-FRAC_PI_2),
        DQuat::from_rotation_x(2.0 * FRAC_PI_2),
        DQuat::from_rotation_y(FRAC_PI_2),
        DQuat::from_rotation_y(-FRAC_PI_2),
    ];
    let spins = (0..4).map(|k| DQuat::from_rotation_z(FRAC_PI_2 * f64::from(k)));
    spins
        .flat_map(|spin| faces.map(|face| face * spin))
        .collect()
}
