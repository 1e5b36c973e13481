//! Places of one shape on another, found once for all parts that have them.

use std::time::Instant;

use fft_correlate::Pose;
use fft_correlate::mating::{HeldPose, Joint, JointKind, MatingSearch, MatingSearchOptions};
use sdf_grid::Monitor;
use serde::{Deserialize, Serialize};

use crate::families::{carries, distinct, moved_joint};
use crate::seeds::Seed;
use crate::shape::Shape;

/// Kinds of places found of a pair, and kept: of those that a joint carries into each other one.
const FOUND: usize = 30;
const KEPT: usize = 12;

/// Places held worse are none, nats.
const WORST: f64 = 3.0;

/// A stage of somebody else's: only whether it shall stop is passed on.
pub(crate) struct Quiet<'a>(pub(crate) &'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Where one shape belongs on another.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct PairPlaces {
    /// The larger shape.
    pub(crate) fixed: usize,
    /// The smaller one.
    pub(crate) moving: usize,
    /// The best first; places that are alike follow each other.
    pub(crate) places: Vec<PairPlace>,
    /// Time it took.
    pub(crate) seconds: f64,
}

/// A place of the smaller shape.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct PairPlace {
    /// Pose of the smaller shape in the larger one's frame.
    pub(crate) pose: Pose,
    /// How well contact holds it there, nats.
    pub(crate) rank: f64,
    /// Share of its surface that mates.
    pub(crate) share: f64,
    /// The joint that contact leaves there, larger shape's frame, without travel.
    pub(crate) joint: Joint,
}

impl PairPlaces {
    /// Docks two shapes.
    pub(crate) fn find(
        shapes: &[Shape],
        [a, b]: [usize; 2],
        clearance: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Self {
        let began = Instant::now();
        let smaller = |i: usize| shapes[i].mesh.area();
        let (fixed, moving) = match smaller(a) < smaller(b) {
            true => (b, a),
            false => (a, b),
        };
        let options = MatingSearchOptions {
            top: FOUND,
            least: Some(WORST),
            clearance,
            symmetries: shapes[moving].symmetries.clone(),
            ..MatingSearchOptions::default()
        };
        let search = MatingSearch::new(&shapes[fixed].mesh, &shapes[moving].mesh, options);
        let found = search.run(&[], &Quiet(monitor));
        let mut kept: Vec<&HeldPose> = Vec::new();
        for held in &found {
            let bounds = shapes[moving].mesh.bounds();
            let known = |k: &&HeldPose| carries(&k.joint, &k.pose, &held.pose, &bounds);
            if kept.len() < KEPT && !kept.iter().any(known) {
                kept.push(held);
            }
        }
        let mut places: Vec<PairPlace> = Vec::new();
        for held in kept {
            let poses = [held.pose].into_iter().chain(held.alike.iter().copied());
            let place = |pose: Pose| {
                let joint = Joint {
                    slide: None,
                    turn: None,
                    ..moved_joint(&held.joint, &(pose * held.pose.inverse()))
                };
                (pose, joint)
            };
            let mut alike: Vec<(Pose, Joint)> = poses.map(place).collect();
            distinct(&mut alike, &shapes[moving].mesh.bounds());
            places.extend(alike.into_iter().map(|(pose, joint)| PairPlace {
                pose,
                rank: held.rank,
                share: held.hold.share,
                joint,
            }));
        }
        Self {
            fixed,
            moving,
            places,
            seconds: began.elapsed().as_secs_f64(),
        }
    }

    /// Places of shape `wanted` beside shape `there`, in that one's frame; of those that symmetry makes
    /// equal all.
    pub(crate) fn beside(&self, there: usize, wanted: usize, shapes: &[Shape]) -> Vec<Seed> {
        let mut found = Vec::new();
        for place in &self.places {
            // The axis about which the part may turn, or along which it may slide.
            let free = matches!(
                place.joint.kind,
                JointKind::Revolute | JointKind::Cylindrical | JointKind::Prismatic
            );
            let axis = free.then_some((place.joint.point, place.joint.axis));
            let size = shapes[self.moving].mesh.bounds().size();
            let across = place.pose.rotation.conjugate() * place.joint.axis;
            let seed = Seed {
                pose: place.pose,
                rank: place.rank,
                axis,
                length: across.abs().dot(size),
            };
            let symmetries = &shapes[there].symmetries;
            if (there, wanted) == (self.fixed, self.moving) {
                found.extend(symmetries.iter().map(|s| seed.moved(s)));
            }
            if (there, wanted) == (self.moving, self.fixed) {
                let back = place.pose.inverse();
                let seed = Seed {
                    pose: Pose::IDENTITY,
                    ..seed
                };
                found.extend(symmetries.iter().map(|s| seed.moved(&(*s * back))));
            }
        }
        found
    }
}
