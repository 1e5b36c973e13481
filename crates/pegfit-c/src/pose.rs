//! Poses and responses as C sees them.

use fft_correlate::{Pose, Response};
use glam::{DQuat, DVec3};

use crate::failure::Failure;
use crate::status::PegfitStatus;

/// Pose of the moving part in the scene that a table was baked for: what the scene puts at `q` is
/// at `R q + t`. Without a placement these are the frames of both parts.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PegfitPose {
    /// t: x, y, z in metres.
    pub translation: [f64; 3],
    /// R as a unit quaternion: x, y, z, w.
    pub rotation: [f64; 4],
}

/// Energy and wrench at a pose, along the scene's axes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PegfitResponse {
    /// Joules.
    pub energy: f64,
    /// Torque on the moving part about where the pose takes the scene's origin: x, y, z in newton
    /// metres.
    pub torque: [f64; 3],
    /// Force on the moving part: x, y, z in newtons.
    pub force: [f64; 3],
    /// 1 inside the table, 0 outside, where force and torque are 0; in between at its edge.
    pub coverage: f64,
}

/// Quaternions this close to unit length are taken for rounded ones and normalized.
const UNIT_TOLERANCE: f64 = 1e-3;

impl PegfitPose {
    /// As a pose; `place` is said in the failure.
    pub(crate) fn checked(&self, place: usize) -> Result<Pose, Failure> {
        let rotation = DQuat::from_array(self.rotation);
        let translation = DVec3::from_array(self.translation);
        let length = rotation.length();
        // Written so that NaN is refused.
        let unit = (length - 1.0).abs() <= UNIT_TOLERANCE;
        if !(unit && translation.is_finite()) {
            return Err(Failure::new(
                PegfitStatus::BadPose,
                format!(
                    "pose {place}: expected finite numbers and a quaternion of length 1, found \
                     translation {:?}, rotation {:?}",
                    self.translation, self.rotation
                ),
            ));
        }
        Ok(Pose {
            rotation: rotation / length,
            translation,
        })
    }
}

impl From<Pose> for PegfitPose {
    fn from(pose: Pose) -> Self {
        Self {
            translation: pose.translation.to_array(),
            rotation: pose.rotation.to_array(),
        }
    }
}

impl From<Response> for PegfitResponse {
    fn from(response: Response) -> Self {
        Self {
            energy: response.energy,
            torque: response.wrench.torque.to_array(),
            force: response.wrench.force.to_array(),
            coverage: response.coverage,
        }
    }
}
