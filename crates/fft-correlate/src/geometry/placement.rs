//! Where a scene puts the two parts of a pair.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::geometry::se3::{Pose, Wrench};

/// Where a scene puts the shapes of a pair: each from its own frame to that of the scene.
///
/// A pose in the scene moves the moving part from where it is placed. A pose of the shapes is what
/// fields, tables and direct evaluation know: it maps the moving shape's own frame to the fixed
/// shape's own frame (`docs/conventions.md`, frames).
///
/// ```
/// use fft_correlate::{Placement, Pose};
/// use glam::DVec3;
///
/// let placement = Placement {
///     fixed: Pose::from_translation(DVec3::X),
///     moving: Pose::from_translation(DVec3::Z),
/// };
/// // Where the moving part is placed, as the fixed shape sees it.
/// let shapes = placement.to_shapes(&Pose::IDENTITY);
/// assert_eq!(shapes.translation, DVec3::new(-1.0, 0.0, 1.0));
/// assert_eq!(placement.to_scene(&shapes).translation, DVec3::ZERO);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// The part that stays.
    #[serde(with = "written")]
    pub fixed: Pose,
    /// The part that moves, before it is moved.
    #[serde(with = "written")]
    pub moving: Pose,
}

impl Placement {
    /// Shapes that lie in the scene as they were modelled.
    pub const IDENTITY: Self = Self {
        fixed: Pose::IDENTITY,
        moving: Pose::IDENTITY,
    };

    /// A fixed part placed by `pose`, and a moving one that is not.
    pub fn of_fixed(pose: Pose) -> Self {
        Self {
            fixed: pose,
            ..Self::IDENTITY
        }
    }

    /// The pose of the shapes for a pose in the scene, `fixed⁻¹ pose moving`; the same bits if
    /// nothing is placed.
    #[must_use]
    pub fn to_shapes(&self, pose: &Pose) -> Pose {
        if *self == Self::IDENTITY {
            return *pose;
        }
        let fixed = self.fixed.inverse();
        let moved = pose.apply(self.moving.translation);
        Pose::new(self.rotation_to_shapes(pose.rotation), fixed.apply(moved))
    }

    /// The pose in the scene for a pose of the shapes; undoes [`Placement::to_shapes`].
    #[must_use]
    pub fn to_scene(&self, pose: &Pose) -> Pose {
        match *self == Self::IDENTITY {
            true => *pose,
            false => self.fixed * *pose * self.moving.inverse(),
        }
    }

    /// A direction along the scene's axes, along those of the fixed shape.
    pub fn direction_to_shapes(&self, direction: DVec3) -> DVec3 {
        match self.fixed.rotation == DQuat::IDENTITY {
            true => direction,
            false => self.fixed.rotation.conjugate() * direction,
        }
    }

    /// The rotation of [`Placement::to_shapes`], not normalized.
    pub(crate) fn rotation_to_shapes(&self, rotation: DQuat) -> DQuat {
        self.fixed.rotation.conjugate() * rotation * self.moving.rotation
    }

    /// The wrench in the scene, about the origin of what `pose` (in the scene) moves, for one along
    /// the fixed shape's axes about the moving shape's origin.
    pub fn wrench_to_scene(&self, pose: &Pose, wrench: &Wrench) -> Wrench {
        // No force stays none, however far away.
        if *self == Self::IDENTITY || *wrench == Wrench::ZERO {
            return *wrench;
        }
        let turn = self.fixed.rotation;
        let turned = Wrench {
            torque: turn * wrench.torque,
            force: turn * wrench.force,
        };
        // From the shape's origin back to that of the pose.
        turned.about(-(pose.rotation * self.moving.translation))
    }
}

/// A pose as tables write it: `position` in metres, `rotation` a unit quaternion `x, y, z, w`.
mod written {
    use glam::{DQuat, DVec3};
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::geometry::se3::Pose;

    #[derive(Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct StoredPose {
        position: [f64; 3],
        rotation: [f64; 4],
    }

    pub(super) fn serialize<S: Serializer>(pose: &Pose, to: S) -> Result<S::Ok, S::Error> {
        let written = StoredPose {
            position: pose.translation.to_array(),
            rotation: pose.rotation.to_array(),
        };
        written.serialize(to)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Pose, D::Error> {
        let StoredPose { position, rotation } = StoredPose::deserialize(from)?;
        let pose = Pose {
            rotation: DQuat::from_array(rotation),
            translation: DVec3::from_array(position),
        };
        match pose.is_valid() {
            true => Ok(pose),
            false => Err(D::Error::custom(format!(
                "placement: expected finite numbers and a unit quaternion, found {position:?}, \
                 {rotation:?}"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placement() -> Placement {
        let turn = |x, y, z| DQuat::from_scaled_axis(DVec3::new(x, y, z));
        Placement {
            fixed: Pose::new(turn(0.4, -1.1, 0.7), DVec3::new(0.3, -0.2, 0.9)),
            moving: Pose::new(turn(-0.8, 0.2, 2.1), DVec3::new(-0.1, 0.5, 0.4)),
        }
    }

    #[test]
    fn a_point_of_the_moving_shape_comes_to_lie_where_the_scene_says() {
        let (placement, point) = (placement(), DVec3::new(0.03, -0.01, 0.02));
        let pose = Pose::new(DQuat::from_rotation_y(0.6), DVec3::new(0.2, 0.1, -0.7));
        let shapes = placement.to_shapes(&pose);
        let there = placement.fixed.apply(shapes.apply(point));
        let expected = pose.apply(placement.moving.apply(point));
        // A few roundings of numbers of order one, here and below.
        assert!((there - expected).length() < 1e-14);
        let back = placement.to_scene(&shapes);
        assert!((back.translation - pose.translation).length() < 1e-14);
        assert!(back.angle_to(&pose) < 1e-7);
    }

    #[test]
    fn a_table_s_header_gives_a_placement_back_and_refuses_what_is_none() {
        let text = serde_json::to_string(&placement()).unwrap();
        let read: Placement = serde_json::from_str(&text).unwrap();
        let far = |a: &Pose, b: &Pose| {
            (a.translation - b.translation).length() > 1e-15 || a.angle_to(b) > 1e-7
        };
        assert!(!far(&read.fixed, &placement().fixed) && !far(&read.moving, &placement().moving));
        let place = r#"{"position":[0,0,0],"rotation":[0,0,0,1]}"#;
        for bad in [
            r#"{"position":[0,0,0],"rotation":[0,0,0,2]}"#,
            r#"{"position":[0,0,0]}"#,
        ] {
            let text = format!(r#"{{"fixed":{place},"moving":{bad}}}"#);
            assert!(serde_json::from_str::<Placement>(&text).is_err(), "{bad}");
        }
        let text = format!(r#"{{"fixed":{place},"moving":{place}}}"#);
        assert_eq!(
            serde_json::from_str::<Placement>(&text).unwrap(),
            Placement::IDENTITY
        );
    }
}
