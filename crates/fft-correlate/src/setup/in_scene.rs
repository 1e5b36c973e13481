//! A pair's energy as a scene asks for it.

use crate::energy::{EnergySource, Response, Scratch};
use crate::geometry::placement::Placement;
use crate::geometry::se3::Pose;

/// A source that knows poses of the shapes, asked at poses in the scene: wrenches are along the
/// scene's axes, about the origin of what the pose moves.
#[derive(Debug, Clone)]
pub struct InScene<S> {
    source: S,
    placement: Placement,
}

impl<S> InScene<S> {
    /// `source` as seen from the scene that places its shapes so.
    pub fn new(source: S, placement: Placement) -> Self {
        Self { source, placement }
    }

    /// What answers for the shapes.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// Where the scene puts the shapes.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    fn to_scene(&self, pose: &Pose, response: Response) -> Response {
        Response {
            wrench: self.placement.wrench_to_scene(pose, &response.wrench),
            ..response
        }
    }
}

impl<S: EnergySource> EnergySource for InScene<S> {
    fn scratch(&self) -> Scratch {
        self.source.scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let shapes = self.placement.to_shapes(pose);
        self.to_scene(pose, self.source.evaluate(&shapes, scratch))
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        let change = self
            .source
            .refresh(&self.placement.to_shapes(pose), scratch);
        change.map(|response| self.to_scene(pose, response))
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        self.source
            .is_loaded(&self.placement.to_shapes(pose), scratch)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::geometry::se3::{Twist, Wrench};

    /// `E = |t|² + t·(R x)`, whose wrench depends on every part of the pose.
    struct Spring;

    impl EnergySource for Spring {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let (t, axis) = (pose.translation, pose.rotation * DVec3::X);
            Response {
                energy: t.length_squared() + t.dot(axis),
                wrench: Wrench {
                    torque: -axis.cross(t),
                    force: -2.0 * t - axis,
                },
                coverage: 0.25,
            }
        }
    }

    #[test]
    fn the_wrench_in_the_scene_is_minus_the_gradient_there() {
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        let placement = Placement {
            fixed: Pose::new(turn(0.4, -1.1, 0.7), DVec3::new(0.3, -0.2, 0.9)),
            moving: Pose::new(turn(-0.8, 0.2, 2.1), DVec3::new(-0.1, 0.5, 0.4)),
        };
        let source = InScene::new(Spring, placement);
        let mut scratch = source.scratch();
        let pose = Pose::new(turn(0.9, 0.3, -0.5), DVec3::new(0.2, 0.1, -0.7));
        let answer = source.evaluate(&pose, &mut scratch);
        assert_eq!(answer.coverage, 0.25);
        let h = 1e-5;
        for k in 0..6 {
            let mut v = [0.0; 6];
            v[k] = h;
            let step = Twist {
                angular: DVec3::new(v[0], v[1], v[2]),
                linear: DVec3::new(v[3], v[4], v[5]),
            };
            let mut at = |t: &Twist| source.evaluate(&pose.perturbed(t), &mut scratch).energy;
            let slope = (at(&step) - at(&-step)) / (2.0 * h);
            // Central differences of order h²; numbers of order one.
            let error = slope + answer.wrench.dot(&(step * (1.0 / h)));
            assert!(error.abs() < 1e-8, "{k}: {error}");
        }
    }
}
