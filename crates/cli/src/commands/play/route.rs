//! The way of the part into its fit: where the hand begins, what the energy is on the way.

use fft_correlate::{EnergySource, Pose};
use glam::DQuat;
use haptic::Geometry;
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};

/// Points of the curve of the energy on the straight way in.
const POINTS: u32 = 120;

/// Share of the depth from which, and to which, the curve goes.
const SPAN: (f64, f64) = (-0.6, 1.08);

/// Poses at which two sources are compared.
const POSES: u32 = 24;

/// The assembled pose withdrawn so that it is `depth` metres in.
pub(super) fn at_depth(geometry: &Geometry, depth: f64) -> Pose {
    Pose {
        translation: geometry.seated.translation + geometry.axis * (depth - geometry.depth),
        ..geometry.seated
    }
}

/// Where the hand begins: before the entrance, beside the axis, tilted a little; `grip` is the point
/// of the part about which it is turned.
pub(super) fn start(geometry: &Geometry, grip: glam::DVec3) -> Pose {
    let before = at_depth(geometry, -0.4 * geometry.depth);
    let side = geometry.axis.any_orthonormal_vector();
    let turn = DQuat::from_axis_angle(side.cross(geometry.axis), geometry.tilt);
    let rotation = (turn * before.rotation).normalize();
    let held = before.apply(grip) + side * (1.5 * geometry.radius);
    Pose {
        rotation,
        translation: held - rotation * grip,
    }
}

/// The coordinate axis across which a cut shows the way in, seen from where the hand begins.
pub(super) fn cut(geometry: &Geometry) -> usize {
    let across = geometry.axis.cross(geometry.axis.any_orthonormal_vector());
    across.abs().max_position()
}

/// Energy (J) against depth (m) on the straight way in.
pub(super) fn profile(source: &dyn EnergySource, geometry: &Geometry) -> Vec<[f64; 2]> {
    let mut scratch = source.scratch();
    let share = |k| SPAN.0 + (SPAN.1 - SPAN.0) * f64::from(k) / f64::from(POINTS);
    (0..=POINTS)
        .map(|k| geometry.depth * share(k))
        .map(|depth| {
            let pose = at_depth(geometry, depth);
            [depth, source.evaluate(&pose, &mut scratch).energy]
        })
        .collect()
}

/// Root mean square difference of the forces of two sources at poses about the way in, as a share of
/// that of `truth`.
pub(super) fn force_error(
    source: &dyn EnergySource,
    truth: &dyn EnergySource,
    geometry: &Geometry,
) -> f64 {
    let mut rng = SmallRng::seed_from_u64(7);
    let (mut ours, mut theirs) = (source.scratch(), truth.scratch());
    let (mut difference, mut scale) = (0.0, 0.0);
    for _ in 0..POSES {
        let mut pose = at_depth(geometry, geometry.depth * rng.random_range(0.0..1.0));
        let mut any = |most: f64| {
            glam::DVec3::from_array([(); 3].map(|()| rng.random_range(-1.0..1.0) * most))
        };
        pose.translation += any(0.3 * geometry.radius);
        pose.rotation =
            (DQuat::from_scaled_axis(any(0.5 * geometry.tilt)) * pose.rotation).normalize();
        let expected = truth.evaluate(&pose, &mut theirs).wrench.force;
        let found = source.evaluate(&pose, &mut ours).wrench.force;
        difference += (found - expected).length_squared();
        scale += expected.length_squared();
    }
    (difference / scale.max(f64::MIN_POSITIVE)).sqrt()
}
