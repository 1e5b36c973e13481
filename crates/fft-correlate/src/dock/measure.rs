//! What is told about a docked pose: how wide its well is.

use glam::DVec3;

use crate::energy::{EnergySource, Scratch};
use crate::geometry::se3::Pose;

/// How far from `pose`, along the axis of the fixed frame on which the energy rises fastest, it
/// rises to half, metres, without rotation; none if it does not within `reach`. Resolved to a
/// hundredth of the reach.
pub(super) fn half_width(
    source: &dyn EnergySource,
    scratch: &mut Scratch,
    pose: &Pose,
    energy: f64,
    reach: f64,
) -> Option<f64> {
    const STEPS: usize = 100;
    let directions = [DVec3::X, DVec3::Y, DVec3::Z];
    (1..=STEPS)
        .map(|i| reach * i as f64 / STEPS as f64)
        .find(|&s| {
            directions.iter().any(|d| {
                [s, -s].into_iter().any(|s| {
                    let moved = Pose {
                        translation: pose.translation + *d * s,
                        ..*pose
                    };
                    source.evaluate(&moved, scratch).energy >= 0.5 * energy
                })
            })
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::energy::Response;

    #[test]
    fn width_of_a_known_well() {
        struct Cone;
        impl EnergySource for Cone {
            fn scratch(&self) -> Scratch {
                Scratch::default()
            }
            fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
                let t = pose.translation * DVec3::new(1.0, 4.0, 2.0);
                Response {
                    energy: -(1.0 - t.length()).max(0.0),
                    ..Response::default()
                }
            }
        }
        let width =
            |reach| half_width(&Cone, &mut Scratch::default(), &Pose::IDENTITY, -1.0, reach);
        assert!((width(1.0).unwrap() - 0.125).abs() < 0.011);
        assert_eq!(width(0.1), None);
    }
}
