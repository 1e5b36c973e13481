//! The energy and its slope along one translation or rotation through the fit.

use fft_correlate::{EnergySource, Pose, Response};
use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::assembly::loaded::Assembly;

/// One degree of freedom through the assembled pose; directions have unit length and are along the
/// fixed shape's own axes, as displacements of a table are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Along a direction.
    Translation(DVec3),
    /// About a direction, through the pair's pivot.
    Rotation(DVec3),
}

/// A pose on the way and what was evaluated there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// How far from the fit, metres or radians.
    pub amount: f64,
    /// The pose, of the shapes.
    pub pose: Pose,
    /// Energy, wrench and coverage there, of the shapes.
    pub response: Response,
    /// Minus the slope of the energy along the motion: a force, newtons, or a torque about the pivot,
    /// newton metres.
    pub load: f64,
}

impl Assembly {
    /// The assembled pose of the shapes moved by `amount` metres or radians.
    pub fn moved(&self, motion: Motion, amount: f64) -> Pose {
        let assembled = self.setup.parts.assembled;
        match motion {
            Motion::Translation(direction) => Pose {
                translation: assembled.translation + amount * direction,
                ..assembled
            },
            Motion::Rotation(axis) => {
                let turn = DQuat::from_axis_angle(axis, amount);
                let rotation = (turn * assembled.rotation).normalize();
                self.pair.pose(rotation, self.pair.displacement(&assembled))
            }
        }
    }

    /// Energy and load at each of `amounts` (metres or radians) of a motion, in their order; `source`
    /// is asked at poses of the shapes, by all threads.
    pub fn profile(
        &self,
        source: &dyn EnergySource,
        motion: Motion,
        amounts: &[f64],
    ) -> Vec<ProfilePoint> {
        let point = |scratch: &mut _, &amount: &f64| {
            let pose = self.moved(motion, amount);
            let response = source.evaluate(&pose, scratch);
            let load = match motion {
                Motion::Translation(direction) => response.wrench.force.dot(direction),
                Motion::Rotation(axis) => {
                    let arm = pose.rotation * self.pair.pivot();
                    response.wrench.about(arm).torque.dot(axis)
                }
            };
            ProfilePoint {
                amount,
                pose,
                response,
                load,
            }
        };
        let points = amounts.par_iter().map_init(|| source.scratch(), point);
        points.collect()
    }
}
