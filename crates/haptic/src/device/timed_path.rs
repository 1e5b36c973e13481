//! A path of the operator's handle: poses with times.

use std::sync::Arc;

use fft_correlate::Pose;

use crate::device::workspace::Workspace;

/// Speed of the handle along a path, m/s: slow enough to feel contacts.
const SPEED: f64 = 0.02;

/// Angular speed likewise, rad/s.
const TURN_SPEED: f64 = 0.6;

/// Rest at the beginning of the path, seconds, so that the force is back before the handle moves.
const REST: f64 = 1.0;

/// Poses of the moving part in the scene, each with the time at which a slow operator reaches it.
///
/// ```
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::{TimedPath, Workspace};
///
/// let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
/// let poses = [0.02, 0.0].map(|z| Pose::from_translation(DVec3::Z * z));
/// let path = TimedPath::new(&poses, &workspace).expect("two valid poses");
/// // A second of rest, then 2 cm at 2 cm/s.
/// assert!((path.seconds() - 2.0).abs() < 1e-9);
/// assert!((path.at(1.5).translation.z - 0.01).abs() < 1e-9);
/// ```
#[derive(Debug, Clone)]
pub struct TimedPath {
    poses: Arc<[Pose]>,
    /// Seconds since the command, non-decreasing, one per pose.
    times: Arc<[f64]>,
}

impl TimedPath {
    /// A path along these poses; `None` if there are fewer than two, or one is invalid. Speeds are
    /// those of the handle, whatever the workspace's scale.
    pub fn new(poses: &[Pose], workspace: &Workspace) -> Option<Self> {
        if poses.len() < 2 || !poses.iter().all(Pose::is_valid) {
            return None;
        }
        let held: Vec<Pose> = poses.iter().map(|p| workspace.device_pose(p)).collect();
        let mut times = Vec::with_capacity(poses.len());
        times.push(REST);
        for pair in held.windows(2) {
            let far = pair[0].translation.distance(pair[1].translation);
            let seconds = (far / SPEED).max(pair[0].angle_to(&pair[1]) / TURN_SPEED);
            times.push(times[times.len() - 1] + seconds);
        }
        Some(Self {
            poses: poses.into(),
            times: times.into(),
        })
    }

    /// The first pose.
    pub(crate) fn first(&self) -> &Pose {
        &self.poses[0]
    }

    /// Seconds from the command to the end.
    pub fn seconds(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    /// Wanted pose of the part `time` seconds after the command.
    pub fn at(&self, time: f64) -> Pose {
        let next = self.times.partition_point(|&t| t <= time);
        let last = self.poses.len() - 1;
        if next == 0 || next > last {
            return self.poses[next.min(last)];
        }
        let (from, to) = (self.poses[next - 1], self.poses[next]);
        let span = self.times[next] - self.times[next - 1];
        from.perturbed(&(from.twist_to(&to) * ((time - self.times[next - 1]) / span)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn a_way_is_gone_slowly_whatever_its_poses_are() {
        // Twice as large in the scene as at the device.
        let workspace = Workspace::new(2.0, Pose::IDENTITY, DVec3::new(0.0, 0.0, 0.03));
        let at = |x: f64| Pose::from_translation(DVec3::new(x, 0.0, 0.0));
        let turned = Pose::new(DQuat::from_rotation_z(1.2), DVec3::new(0.04, 0.0, 0.0));
        // A pose twice, poses near and far, a turn on the spot.
        let poses = [at(0.0), at(0.0), at(0.001), at(0.04), turned];
        let path = TimedPath::new(&poses, &workspace).unwrap();
        assert!((path.seconds() - (REST + 0.02 / SPEED + 1.2 / TURN_SPEED)).abs() < 1e-9);
        assert_eq!(path.at(0.5 * REST), poses[0]);
        assert_eq!(path.at(path.seconds() + 1.0), turned);
        let step = 0.01;
        let mut last = workspace.device_pose(&path.at(0.0));
        for k in 1..=(path.seconds() / step) as u32 + 2 {
            let here = workspace.device_pose(&path.at(f64::from(k) * step));
            let far = here.translation.distance(last.translation);
            assert!(far <= SPEED * step * 1.001, "{k}");
            assert!(here.angle_to(&last) <= TURN_SPEED * step * 1.001, "{k}");
            last = here;
        }
        assert!(
            last.twist_to(&workspace.device_pose(&turned))
                .linear
                .length()
                < 1e-9
        );
    }

    #[test]
    fn nonsense_is_no_way() {
        let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
        let bad = Pose::from_translation(DVec3::splat(f64::NAN));
        assert!(TimedPath::new(&[Pose::IDENTITY], &workspace).is_none());
        assert!(TimedPath::new(&[Pose::IDENTITY, bad], &workspace).is_none());
    }
}
