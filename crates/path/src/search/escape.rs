//! How far a part is from being beside the other.

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::TriangleMesh;

use crate::contact::gaps::Gaps;
use crate::motion::frame::directions;

/// Directions in which parts may part.
const DIRECTIONS: usize = 192;

/// The fixed part's extent in many directions.
#[derive(Debug, Clone)]
pub(crate) struct Escape {
    heights: Vec<(DVec3, f64)>,
}

/// Along which direction, in the fixed frame, a part would have to be moved least to lie wholly beyond
/// the other, and how far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Exit {
    pub(crate) direction: DVec3,
    /// Metres; negative once there is a gap between the parts' extents.
    pub(crate) distance: f64,
}

impl Escape {
    pub(crate) fn new(gaps: &Gaps) -> Self {
        let height = |u: DVec3| {
            let heights = gaps.fixed.vertices().map(|p| p.dot(u));
            heights.fold(f64::MIN, f64::max)
        };
        let normals = face_directions(gaps);
        let all = directions(DIRECTIONS).chain(normals);
        Self {
            heights: all.map(|u| (u, height(u))).collect(),
        }
    }

    /// The shortest way out of the fixed part's extent. Once the parts lie beside each other, a straight
    /// motion along the direction keeps them there.
    pub(crate) fn exit(&self, gaps: &Gaps, pose: &Pose) -> Exit {
        let extremes = &gaps.frame.extremes;
        let mut best = Exit {
            direction: DVec3::Z,
            distance: f64::INFINITY,
        };
        for (u, height) in &self.heights {
            let own = pose.rotation.conjugate() * *u;
            let lowest = extremes.iter().map(|q| q.dot(own)).fold(f64::MAX, f64::min);
            let distance = height - (lowest + pose.translation.dot(*u));
            if distance < best.distance {
                best = Exit {
                    direction: *u,
                    distance,
                };
            }
        }
        if best.distance < 0.0 {
            best.distance = self.exact(gaps, pose, best.direction);
        }
        best
    }

    /// By all vertices of the moving part.
    fn exact(&self, gaps: &Gaps, pose: &Pose, direction: DVec3) -> f64 {
        let own = pose.rotation.conjugate() * direction;
        let heights = gaps.moving.vertices().map(|q| q.dot(own));
        let lowest = heights.fold(f64::MAX, f64::min);
        let height = |(u, h): &(DVec3, f64)| (*u == direction).then_some(*h);
        let height = self.heights.iter().find_map(height).unwrap_or(f64::MAX);
        height - (lowest + pose.translation.dot(direction))
    }
}

/// Normals of the fixed part's largest flat sides.
fn face_directions(gaps: &Gaps) -> Vec<DVec3> {
    let mut sides: Vec<(DVec3, f64)> = Vec::new();
    for [a, b, c] in gaps.fixed.meshes().flat_map(TriangleMesh::faces) {
        let normal = (b - a).cross(c - a);
        let (unit, area) = (normal.normalize_or_zero(), normal.length());
        match sides.iter().position(|(n, _)| n.dot(unit) > 1.0 - 1e-6) {
            Some(side) => sides[side].1 += area,
            None if sides.len() < 512 => sides.push((unit, area)),
            None => {}
        }
    }
    sides.sort_by(|a, b| b.1.total_cmp(&a.1));
    sides.truncate(24);
    sides.into_iter().map(|(n, _)| n).collect()
}
