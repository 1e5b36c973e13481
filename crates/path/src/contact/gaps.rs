//! Where two parts are close to each other or overlap.

use crate::contact::body::Body;
use crate::contact::features::touching_points;
use crate::motion::frame::Frame;
use crate::motion::six::Vec6;
use fft_correlate::Pose;
use glam::DVec3;

/// Two bodies, each as solids and as the points with which it touches the other.
#[derive(Debug, Clone)]
pub(crate) struct Gaps {
    pub(crate) fixed: Body,
    pub(crate) moving: Body,
    fixed_points: Vec<DVec3>,
    moving_points: Vec<DVec3>,
    pub(crate) frame: Frame,
}

/// A place where the parts are close.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Contact {
    /// Between the surfaces, metres; negative where they overlap.
    pub(crate) distance: f64,
    /// In which direction, in the fixed frame, the moving part goes away from the fixed one.
    pub(crate) normal: DVec3,
    /// How the distance grows with a small motion of the moving part.
    pub(crate) slope: Vec6,
}

impl Gaps {
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

    /// The same parts with points this far apart.
    pub(crate) fn finer(&self, spacing: f64) -> Self {
        Self {
            fixed_points: points_of(&self.fixed, spacing),
            moving_points: points_of(&self.moving, spacing),
            ..self.clone()
        }
    }

    /// Points that are looked at.
    pub(crate) fn points(&self) -> usize {
        self.fixed_points.len() + self.moving_points.len()
    }

    /// Least distance within `margin` and `depth` of zero, metres (`margin` if there is none), and the
    /// contacts closer than the margin. What overlaps by more than the depth is not seen.
    pub(crate) fn near(
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

    /// Whether no point overlaps by more than `level`, of those that do by less than `depth`.
    pub(crate) fn clear(&self, pose: &Pose, level: f64, depth: f64) -> bool {
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

    /// By how much the deepest point of either part lies in the other, metres; 0 if none does. Points
    /// that lie deeper than `most` are not seen.
    pub(crate) fn depth(&self, pose: &Pose, most: f64) -> f64 {
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

    /// Volume that the bodies share, cubic metres.
    pub(crate) fn shared_volume(&self, pose: &Pose) -> f64 {
        self.fixed.shared_with(&self.moving, pose)
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

/// Where the solids of a body touch others.
fn points_of(body: &Body, spacing: f64) -> Vec<DVec3> {
    let each = body.meshes().map(|mesh| touching_points(mesh, spacing));
    each.flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;
    use pegfit_fixtures as shapes;
    use sdf_grid::TriangleMesh;
    use std::sync::Arc;

    fn body(mesh: TriangleMesh) -> Body {
        Body::of_mesh(Arc::new(mesh))
    }

    #[test]
    fn distances_grow_as_their_slopes_say_and_overlaps_are_seen() {
        let fit = shapes::random_fit(4).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, 2.0, -0.7));
        let moving = fit.moving.transformed(turn, DVec3::new(0.03, 0.01, -0.02));
        let fit_pose = Pose::new(turn, DVec3::new(0.03, 0.01, -0.02)).inverse();
        let gaps = Gaps::new(body(fit.fixed), body(moving), 3e-4);
        let mut contacts = Vec::new();
        let nudge = gaps
            .frame
            .motion(DVec3::new(2e-4, -1e-4, 3e-4), DVec3::splat(-1e-5));
        let pose = gaps.frame.moved(&fit_pose, &nudge);
        let least = gaps.near(&pose, 1e-3, 0.0, &mut contacts);
        assert!(contacts.len() > 50);
        let step = gaps
            .frame
            .motion(DVec3::new(-1e-5, 2e-5, 1e-5), DVec3::new(1e-7, 2e-7, 0.0));
        let expected = contacts
            .iter()
            .map(|c| c.distance + crate::motion::six::dot(&c.slope, &step));
        let expected = expected.fold(f64::INFINITY, f64::min);
        let moved = gaps.frame.moved(&pose, &step);
        let found = gaps.near(&moved, 1e-3, 0.0, &mut contacts);
        assert!((found - least).abs() > 1e-8);
        // Of second order in the step.
        assert!((found - expected).abs() < 5e-9, "{found} {expected}");
        assert!(gaps.depth(&fit_pose, 0.01) < 1e-12);
        let sunk = Pose::new(fit_pose.rotation, fit_pose.translation + DVec3::X * 1e-3);
        let depth = gaps.depth(&sunk, 0.01);
        assert!((depth - (1e-3 - fit.clearance)).abs() < 2e-4, "{depth}");
        assert!(!gaps.clear(&sunk, 1e-4, 2e-3) && gaps.clear(&fit_pose, 1e-5, 1e-3));
    }
}
