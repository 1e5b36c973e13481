//! Collision checker of two bodies: contacts, penetration depth, and projection of a pose to contact.

use fft_correlate::Pose;
use glam::DVec3;

use crate::collision::body::Body;
use crate::collision::contact_points::contact_points;
use crate::motion::frame::Frame;
use crate::motion::vec6::{LeastSquares, Vec6, length, scaled};

/// Two bodies, each with its solids and the surface points that can touch the other.
#[derive(Debug, Clone)]
pub(crate) struct CollisionChecker {
    pub(crate) fixed: Body,
    pub(crate) moving: Body,
    fixed_points: Vec<DVec3>,
    moving_points: Vec<DVec3>,
    pub(crate) frame: Frame,
}

/// A point where the parts are close.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    /// Between the surfaces, metres; negative where they overlap.
    pub(crate) distance: f64,
    /// Unit vector in the fixed frame, from the fixed part to the moving one.
    pub(crate) normal: DVec3,
    /// Derivative of the distance by a small motion of the moving part.
    pub(crate) slope: Vec6,
}

impl CollisionChecker {
    /// Points along edges lie at most `spacing` metres apart.
    pub(crate) fn new(fixed: Body, moving: Body, spacing: f64) -> Self {
        let vertices: Vec<DVec3> = moving.vertices().copied().collect();
        Self {
            fixed_points: points_of(&fixed, spacing),
            moving_points: points_of(&moving, spacing),
            frame: Frame::new(moving.centroid(), &vertices),
            fixed,
            moving,
        }
    }

    /// The same parts, with points at most `spacing` metres apart.
    pub(crate) fn finer(&self, spacing: f64) -> Self {
        Self {
            fixed_points: points_of(&self.fixed, spacing),
            moving_points: points_of(&self.moving, spacing),
            ..self.clone()
        }
    }

    /// Number of surface points that are checked.
    pub(crate) fn point_count(&self) -> usize {
        self.fixed_points.len() + self.moving_points.len()
    }

    /// Collects the contacts closer than `margin` and returns the least distance, metres (`margin` if there
    /// is none). Points deeper than `depth` are not seen.
    pub(crate) fn collect_contacts(
        &self,
        pose: &Pose,
        margin: f64,
        depth: f64,
        contacts: &mut Vec<Contact>,
    ) -> f64 {
        let radius = margin.max(depth);
        let back = pose.inverse();
        let moving = |q: &DVec3| {
            let place = pose.apply(*q);
            let probes = self.fixed.probes(place, radius);
            let close = probes.filter(|p| p.distance < margin);
            close.map(move |p| self.contact(pose, p.distance, place, p.normal))
        };
        let fixed = |p: &DVec3| {
            let place = *p;
            let probes = self.moving.probes(back.apply(place), radius);
            let close = probes.filter(|p| p.distance < margin);
            close.map(move |p| {
                let normal = -(pose.rotation * p.normal);
                self.contact(pose, p.distance, place, normal)
            })
        };
        contacts.clear();
        let mut others: Vec<Contact> = Vec::new();
        rayon::join(
            || contacts.extend(self.moving_points.iter().flat_map(moving)),
            || others.extend(self.fixed_points.iter().flat_map(fixed)),
        );
        contacts.append(&mut others);
        contacts.iter().map(|c| c.distance).fold(margin, f64::min)
    }

    /// Whether no point is deeper than `level` metres; points deeper than `depth` are not seen.
    pub(crate) fn is_free(&self, pose: &Pose, level: f64, depth: f64) -> bool {
        let radius = depth.max(level);
        let inside = |body: &Body, p: DVec3| {
            let mut probes = body.probes(p, radius);
            probes.any(|p| p.distance < -level)
        };
        let moving = |q: &DVec3| inside(&self.fixed, pose.apply(*q));
        let back = pose.inverse();
        let fixed = |p: &DVec3| inside(&self.moving, back.apply(*p));
        let (a, b) = rayon::join(
            || !self.moving_points.iter().any(moving),
            || !self.fixed_points.iter().any(fixed),
        );
        a && b
    }

    /// Penetration depth: of the deepest point of either part in the other, metres; 0 if none overlaps.
    /// Points deeper than `most` are not seen.
    pub(crate) fn penetration_depth(&self, pose: &Pose, most: f64) -> f64 {
        let back = pose.inverse();
        let inside = |body: &Body, p: DVec3| {
            let probes = body.probes(p, most);
            probes.map(|p| -p.distance).fold(0.0, f64::max)
        };
        let moving = self.moving_points.iter();
        let moving = moving.map(|q| inside(&self.fixed, pose.apply(*q)));
        let fixed = self.fixed_points.iter();
        let fixed = fixed.map(|p| inside(&self.moving, back.apply(*p)));
        moving.chain(fixed).fold(0.0, f64::max)
    }

    /// Interference volume, cubic metres.
    pub(crate) fn interference_volume(&self, pose: &Pose) -> f64 {
        self.fixed.interference_volume(&self.moving, pose)
    }

    fn contact(&self, pose: &Pose, distance: f64, place: DVec3, normal: DVec3) -> Contact {
        let arm = place - pose.apply(self.frame.centre);
        let t = arm.cross(normal) / self.frame.radius;
        Contact {
            distance,
            normal,
            slope: [t.x, t.y, t.z, normal.x, normal.y, normal.z],
        }
    }
}

/// Points of a body that can touch others.
fn points_of(body: &Body, spacing: f64) -> Vec<DVec3> {
    let each = body.meshes().map(|mesh| contact_points(mesh, spacing));
    each.flatten().collect()
}

/// Most corrections of a pose.
const MOST: usize = 8;

/// Two corrections that gain less than this share of what is missing show that no more will.
const STALLED: f64 = 0.1;

/// The range of corrections.
struct Within {
    /// Where they begin.
    origin: Pose,
    /// The longest correction, metres; three times as much in all.
    reach: f64,
    by: Allowed,
}

/// Which motions may correct a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Allowed {
    /// Rotations and translations.
    All,
    /// Translations alone.
    Translations,
}

/// Allowed penetration, and how finely distances are resolved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ContactLimits {
    /// Overlaps no deeper than this are allowed, metres.
    pub(crate) level: f64,
    /// Resolution of distances, metres: parts are kept three times this above the level where there is
    /// room.
    pub(crate) tolerance: f64,
}

impl ContactLimits {
    /// Greatest penetration at which contacts are collected, metres, for motions of at most `step`.
    pub(crate) fn depth(&self, step: f64) -> f64 {
        self.level + 2.0 * step + self.tolerance
    }
}

impl CollisionChecker {
    /// Projects `pose` to a near pose within the limits, by corrections of at most `reach` metres each;
    /// none if there is none.
    ///
    /// Each correction is the smallest motion that opens all narrow gaps as far as possible (least squares
    /// over the contacts that are too close).
    pub(crate) fn project_to_contact(
        &self,
        pose: &Pose,
        limits: &ContactLimits,
        reach: f64,
        by: Allowed,
        contacts: &mut Vec<Contact>,
    ) -> Option<Pose> {
        let within = Within {
            origin: *pose,
            reach,
            by,
        };
        // Room on all sides if there is; where it is almost too narrow, none.
        let aim = |room: f64| room * limits.tolerance - limits.level;
        match self.open_gaps(pose, limits, aim(3.0), &within, contacts) {
            Ok(found) => Some(found),
            Err((least, _)) if least < aim(-4.0) => None,
            Err((_, best)) => {
                let found = self.open_gaps(&best, limits, aim(1.0), &within, contacts);
                found.ok()
            }
        }
    }

    /// A pose near `pose` with distances of `aim`, or at least within the limits; else the best pose with
    /// its least distance.
    fn open_gaps(
        &self,
        pose: &Pose,
        limits: &ContactLimits,
        aim: f64,
        within: &Within,
        contacts: &mut Vec<Contact>,
    ) -> Result<Pose, (f64, Pose)> {
        let depth = limits.depth(within.reach);
        let (mut at, mut best, mut stalls) = (*pose, (f64::NEG_INFINITY, *pose), 0);
        for _ in 0..MOST {
            // Measure, and keep the best pose.
            let least = self.collect_contacts(&at, aim, depth, contacts);
            let (gain, done) = (least - best.0, best.0 >= -limits.level);
            let missing = -limits.level - best.0;
            if gain > 0.0 {
                best = (least, at);
            }
            let enough = least >= aim - 0.25 * limits.tolerance;
            if enough || (done && gain < 0.2 * limits.tolerance) {
                break;
            }
            // Where two walls push against each other nothing is gained.
            stalls = if gain < STALLED * missing {
                stalls + 1
            } else {
                0
            };
            if stalls > 1 {
                break;
            }
            // Correct, by at most the reach at once.
            let Some(correction) = opening_motion(contacts, aim, within.by) else {
                break;
            };
            let size = length(&correction);
            let correction = scaled(&correction, (within.reach / size).min(1.0));
            at = self.frame.moved(&at, &correction);
            if self.frame.apart(&within.origin, &at) > 3.0 * within.reach {
                break;
            }
        }
        match best.0 >= -limits.level {
            true => Ok(best.1),
            false => Err(best),
        }
    }
}

/// The smallest motion that raises all distances below `aim` to it (least squares).
fn opening_motion(contacts: &[Contact], aim: f64, by: Allowed) -> Option<Vec6> {
    let mut sums = LeastSquares::default();
    for c in contacts.iter().filter(|c| c.distance < aim) {
        let mut slope = c.slope;
        if by == Allowed::Translations {
            slope[..3].fill(0.0);
        }
        sums.add(&slope, aim - c.distance);
    }
    sums.solution()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DQuat;
    use sdf_grid::TriangleMesh;

    use super::*;

    fn body(mesh: TriangleMesh) -> Body {
        Body::of_mesh(Arc::new(mesh))
    }

    #[test]
    fn distances_grow_as_their_slopes_say_and_overlaps_are_seen() {
        let fit = pegfit_fixtures::random_fit(4).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, 2.0, -0.7));
        let moving = fit.moving.transformed(turn, DVec3::new(0.03, 0.01, -0.02));
        let fit_pose = Pose::new(turn, DVec3::new(0.03, 0.01, -0.02)).inverse();
        let checker = CollisionChecker::new(body(fit.fixed), body(moving), 3e-4);
        let mut contacts = Vec::new();
        let nudge = checker
            .frame
            .motion(DVec3::new(2e-4, -1e-4, 3e-4), DVec3::splat(-1e-5));
        let pose = checker.frame.moved(&fit_pose, &nudge);
        let least = checker.collect_contacts(&pose, 1e-3, 0.0, &mut contacts);
        assert!(contacts.len() > 50);
        let step = checker
            .frame
            .motion(DVec3::new(-1e-5, 2e-5, 1e-5), DVec3::new(1e-7, 2e-7, 0.0));
        let expected = contacts
            .iter()
            .map(|c| c.distance + crate::motion::vec6::dot(&c.slope, &step));
        let expected = expected.fold(f64::INFINITY, f64::min);
        let moved = checker.frame.moved(&pose, &step);
        let found = checker.collect_contacts(&moved, 1e-3, 0.0, &mut contacts);
        assert!((found - least).abs() > 1e-8);
        // Of second order in the step.
        assert!((found - expected).abs() < 5e-9, "{found} {expected}");
        assert!(checker.penetration_depth(&fit_pose, 0.01) < 1e-12);
        let sunk = Pose::new(fit_pose.rotation, fit_pose.translation + DVec3::X * 1e-3);
        let depth = checker.penetration_depth(&sunk, 0.01);
        assert!((depth - (1e-3 - fit.clearance)).abs() < 2e-4, "{depth}");
        assert!(!checker.is_free(&sunk, 1e-4, 2e-3) && checker.is_free(&fit_pose, 1e-5, 1e-3));
    }
}
