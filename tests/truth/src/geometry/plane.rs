//! Oriented planes.

use fft_correlate::Pose;
use glam::DVec3;

/// The plane `normal · p = offset`; the solid whose face lies in it is behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    /// Unit vector out of the solid.
    pub(crate) normal: DVec3,
    /// Metres.
    pub(crate) offset: f64,
}

impl Plane {
    /// The plane through the corners of a triangle, or none if it has no area.
    pub(crate) fn through([a, b, c]: [DVec3; 3]) -> Option<Self> {
        let normal = (b - a).cross(c - a).try_normalize()?;
        let offset = normal.dot((a + b + c) / 3.0);
        Some(Self { normal, offset })
    }

    /// Height of a point over the plane, metres; negative behind it.
    pub(crate) fn height(&self, p: DVec3) -> f64 {
        self.normal.dot(p) - self.offset
    }

    /// The plane of a part that `pose` moves.
    pub(crate) fn moved(&self, pose: &Pose) -> Self {
        let normal = pose.rotation * self.normal;
        Self {
            normal,
            offset: self.offset + normal.dot(pose.translation),
        }
    }
}
