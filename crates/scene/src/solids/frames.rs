//! Poses as robots' descriptions write them.

use fft_correlate::Pose;
use glam::{DMat3, DQuat, DVec3};

/// Fixed-axis roll, pitch and yaw, radians, of URDF.
pub(crate) fn roll_pitch_yaw([roll, pitch, yaw]: [f64; 3]) -> DQuat {
    DQuat::from_rotation_z(yaw) * DQuat::from_rotation_y(pitch) * DQuat::from_rotation_x(roll)
}

/// Three turns, radians, about the axes that `sequence` names: small letters turn with the body,
/// capitals stay. `None` if a letter is no axis.
pub(crate) fn euler(sequence: &str, angles: [f64; 3]) -> Option<DQuat> {
    let mut rotation = DQuat::IDENTITY;
    let letters: Vec<char> = sequence.chars().collect();
    let [a, b, c] = letters[..] else { return None };
    for (letter, angle) in [a, b, c].into_iter().zip(angles) {
        let axis = match letter.to_ascii_lowercase() {
            'x' => DVec3::X,
            'y' => DVec3::Y,
            'z' => DVec3::Z,
            _ => return None,
        };
        let turn = DQuat::from_axis_angle(axis, angle);
        rotation = match letter.is_ascii_lowercase() {
            true => rotation * turn,
            false => turn * rotation,
        };
    }
    Some(rotation)
}

/// The frame with these x and y axes, the second made perpendicular to the first; `None` if they are
/// parallel.
pub(crate) fn from_axes([a, b, c, d, e, f]: [f64; 6]) -> Option<DQuat> {
    let x = DVec3::new(a, b, c).try_normalize()?;
    let y = DVec3::new(d, e, f);
    let y = (y - x * x.dot(y)).try_normalize()?;
    Some(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))))
}

/// The least turn of z onto an axis; onto -z, the one about x, as MuJoCo has it. `None` if the axis is
/// zero.
pub(crate) fn from_z_axis(axis: [f64; 3]) -> Option<DQuat> {
    let axis = DVec3::from(axis).try_normalize()?;
    let about = DVec3::Z.cross(axis);
    let angle = about.length().atan2(axis.z);
    let about = if about.length() < 1e-10 {
        DVec3::X
    } else {
        about.normalize()
    };
    Some(DQuat::from_axis_angle(about, angle))
}

/// A pose of a quaternion that need not be of unit length.
pub(crate) fn pose(rotation: DQuat, position: [f64; 3]) -> Pose {
    Pose::new(rotation, DVec3::from(position))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns about axes that stay, in one order, are turns about axes that turn along, in the other.
    #[test]
    fn sequences_of_turns_agree() {
        let [a, b, c] = [0.3, -0.7, 1.1];
        let fixed = roll_pitch_yaw([a, b, c]);
        let same = |found: Option<DQuat>| (found.unwrap().dot(fixed).abs() - 1.0).abs() < 1e-12;
        assert!(same(euler("XYZ", [a, b, c])));
        assert!(same(euler("zyx", [c, b, a])));
        assert!(!same(euler("xyz", [a, b, c])));
        assert!(euler("xy", [a, b, c]).is_none() && euler("xyw", [a, b, c]).is_none());
    }

    #[test]
    fn axes_become_a_frame() {
        let turn = roll_pitch_yaw([0.4, 0.2, -0.9]);
        let (x, y) = (turn * DVec3::X, turn * (DVec3::Y + 0.3 * DVec3::X));
        let found = from_axes([2.0 * x.x, 2.0 * x.y, 2.0 * x.z, y.x, y.y, y.z]).unwrap();
        assert!((found.dot(turn).abs() - 1.0).abs() < 1e-12);
        assert!(from_axes([1.0, 0.0, 0.0, -2.0, 0.0, 0.0]).is_none());
    }

    #[test]
    fn the_z_axis_turns_the_least_way_and_about_x_onto_its_opposite() {
        for axis in [[0.3, -0.4, 0.2], [0.0, 2.0, 0.0], [1e-13, 0.0, 3.0]] {
            let turn = from_z_axis(axis).unwrap();
            let expected = DVec3::from(axis).normalize();
            assert!((turn * DVec3::Z - expected).length() < 1e-12, "{axis:?}");
            assert!(turn.z.abs() < 1e-15, "{axis:?}: {turn}");
        }
        let turn = from_z_axis([0.0, 0.0, -2.0]).unwrap();
        assert!((turn * DVec3::X - DVec3::X).length() < 1e-15);
        assert!((turn * DVec3::Y + DVec3::Y).length() < 1e-15);
        assert!(from_z_axis([0.0; 3]).is_none());
    }
}
