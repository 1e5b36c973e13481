//! Of poses that differ by a free turn, the one to show: as the parts lie already, or with planes
//! parallel.

use std::f64::consts::TAU;

use glam::DQuat;
use sdf_grid::InterferenceQuery;

use super::hypotheses::Hypotheses;
use super::joint::{JointKind, Travel};
use super::search::{HeldPose, MatingSearch};
use crate::geometry::se3::Pose;

/// Nats that a pose may rank below the best of its family.
const AS_GOOD: f64 = 3.0;

/// Turns that make planes parallel, of which the best is chosen.
const TURNS: usize = 6;

impl MatingSearch<'_> {
    /// The pose of a family of poses, which differ by the free turn of the joint, that a person would
    /// choose: the part's present one, if it belongs to the family; else one with planes of both parts
    /// parallel, as a leg that is screwed into a table has; else the one found. Each is as good as the
    /// best, or nearly.
    pub(super) fn representative(
        &self,
        query: &InterferenceQuery<'_>,
        hypotheses: &Hypotheses<'_>,
        found: HeldPose,
    ) -> HeldPose {
        let joint = &found.joint;
        let turns = matches!(joint.kind, JointKind::Revolute | JointKind::Screw);
        let (true, Some(travel)) = (turns, joint.turn) else {
            return found;
        };
        let turned = |angle: f64| {
            let turn = DQuat::from_axis_angle(joint.axis, angle);
            let along = joint.pitch / TAU * angle * joint.axis;
            let rotation = (turn * found.pose.rotation).normalize();
            let shift = joint.point + turn * (found.pose.translation - joint.point) + along;
            Pose::new(rotation, shift)
        };
        // As it is turned, or seated there once more.
        let as_good = |pose: &Pose| {
            let measured = |pose: &Pose| self.measure_above(query, pose, found.rank - AS_GOOD);
            let seated = || measured(&self.contact.approach_nearly_right(pose));
            measured(pose).or_else(seated).map(|measured| HeldPose {
                joint: self.contact.joint(&measured.pose),
                alike: found.alike.clone(),
                ..measured
            })
        };
        if let Some(present) = self.options.present {
            let turn = present.rotation * found.pose.rotation.conjugate();
            let angle = 2.0 * turn.xyz().dot(joint.axis).atan2(turn.w);
            let near = reachable(angle, &travel)
                .map(turned)
                .filter(|pose| self.contact.distance(pose, &present) < self.contact.resolution)
                .find_map(|pose| as_good(&pose));
            if let Some(there) = near {
                return there;
            }
        }
        let aligned = hypotheses.aligned_spins(found.pose.rotation, joint.axis);
        let most = aligned.first().map_or(0.0, |a| a.1);
        let mut angles: Vec<f64> = (aligned.iter().take(TURNS))
            .filter(|a| a.1 > 0.9 * most)
            .flat_map(|a| reachable(a.0, &travel))
            .collect();
        angles.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let aligned = angles.iter().find_map(|a| as_good(&turned(*a)));
        aligned.unwrap_or(found)
    }
}

/// The turns equal to an angle up to full ones that a travel allows, radians.
fn reachable(angle: f64, travel: &Travel) -> impl Iterator<Item = f64> {
    let [low, high] = travel.range;
    let first = ((low - angle) / TAU).ceil();
    let count = ((high - angle) / TAU).floor() - first + 1.0;
    // A threaded rod has many turns; those nearest to the pose are enough.
    let count = count.clamp(0.0, 100.0) as usize;
    (0..count).map(move |k| angle + (first + k as f64) * TAU)
}
