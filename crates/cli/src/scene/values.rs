//! Numbers, places and rotations as a scene writes them.

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use toml::Spanned;

use super::source::Source;
use crate::error::CommandError;

/// How far a quaternion may be from unit length and still be taken as a rotation.
pub(crate) const QUATERNION_SLACK: f64 = 1e-3;

pub(super) fn natural(
    value: &Spanned<f64>,
    name: &str,
    source: &Source<'_>,
) -> Result<f64, CommandError> {
    match *value.get_ref() {
        0.0 => Ok(0.0),
        _ => positive(value, name, source),
    }
}

pub(super) fn pose(
    position: &Option<Spanned<[f64; 3]>>,
    rotation: &Option<Spanned<[f64; 4]>>,
    metres: f64,
    source: &Source<'_>,
) -> Result<Pose, CommandError> {
    let translation = match position {
        Some(p) => finite(p, "position", source)? * metres,
        None => DVec3::ZERO,
    };
    let rotation = match rotation {
        Some(q) => quaternion(*q.get_ref())
            .map_err(|found| source.error(q.span(), not_a_rotation("rotation", &found)))?,
        None => DQuat::IDENTITY,
    };
    Ok(Pose::new(rotation, translation))
}

pub(super) fn positive(
    value: &Spanned<f64>,
    name: &str,
    source: &Source<'_>,
) -> Result<f64, CommandError> {
    let v = *value.get_ref();
    if v.is_finite() && v > 0.0 {
        Ok(v)
    } else {
        Err(source.error(
            value.span(),
            format!("{name}: expected a positive number, found {v}"),
        ))
    }
}

pub(super) fn finite(
    value: &Spanned<[f64; 3]>,
    name: &str,
    source: &Source<'_>,
) -> Result<DVec3, CommandError> {
    let v = DVec3::from_array(*value.get_ref());
    if v.is_finite() {
        Ok(v)
    } else {
        Err(source.error(
            value.span(),
            format!("{name}: expected finite numbers, found {v}"),
        ))
    }
}

/// A rotation from `x, y, z, w`, normalized if nearly of unit length.
///
/// # Errors
/// The length found, as text, if it is further than [`QUATERNION_SLACK`] from 1.
pub(crate) fn quaternion(xyzw: [f64; 4]) -> Result<DQuat, String> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if length.is_finite() && (length - 1.0).abs() <= QUATERNION_SLACK {
        Ok(q.normalize())
    } else {
        Err(format!("length {length}"))
    }
}

fn not_a_rotation(name: &str, found: &str) -> String {
    format!(
        "{name}: expected a unit quaternion x, y, z, w (within {QUATERNION_SLACK}), found {found}"
    )
}
