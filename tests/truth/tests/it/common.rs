//! Poses and errors.

use fft_correlate::{Pose, Twist, Wrench};
use glam::{DQuat, DVec3};
use pegfit_truth::Truth;

/// Pressed, turned in the hole, and askew half out of it.
pub(crate) fn poses() -> [Pose; 3] {
    let askew = DVec3::new(0.05, -0.07, 0.03);
    [
        Pose::new(DQuat::from_rotation_y(0.01), DVec3::new(7e-4, 1e-4, 2e-3)),
        Pose::new(DQuat::from_rotation_z(0.06), DVec3::new(2e-4, -1e-4, 3e-4)),
        Pose::new(
            DQuat::from_scaled_axis(askew),
            DVec3::new(2e-3, 1e-3, -3e-3),
        ),
    ]
}

/// The wrench by central differences of the energy over `step` metres either way, and the angle
/// that moves points at 15 mm as far.
pub(crate) fn difference(truth: &Truth, pose: &Pose, step: f64) -> Wrench {
    let slope = |twist: Twist, length: f64| {
        let at = |s: f64| truth.at(&pose.perturbed(&(twist * s))).energy;
        -(at(1.0) - at(-1.0)) / (2.0 * length)
    };
    let angle = step / 0.015;
    let force = DVec3::AXES.map(|axis| {
        let angular = DVec3::ZERO;
        slope(
            Twist {
                angular,
                linear: axis * step,
            },
            step,
        )
    });
    let torque = DVec3::AXES.map(|axis| {
        let linear = DVec3::ZERO;
        slope(
            Twist {
                angular: axis * angle,
                linear,
            },
            angle,
        )
    });
    Wrench {
        torque: DVec3::from_array(torque),
        force: DVec3::from_array(force),
    }
}

/// The relative distance of two wrenches over several poses, force and torque.
pub(crate) fn apart(found: &[Wrench], exact: &[Wrench]) -> [f64; 2] {
    let relative = |part: fn(&Wrench) -> DVec3| {
        let pairs = found.iter().zip(exact);
        let wrong: f64 = pairs
            .map(|(a, b)| (part(a) - part(b)).length_squared())
            .sum();
        let all: f64 = exact.iter().map(|b| part(b).length_squared()).sum();
        (wrong / all).sqrt()
    };
    [relative(|w| w.force), relative(|w| w.torque)]
}
