//! Numbers, places and rotations as a scene writes them.

use std::ops::Range;
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use glam::{DQuat, DVec3};
use toml::Spanned;

use crate::error::{LineError, SceneError};

/// How far a quaternion may be from unit length and still be taken as a rotation.
const QUATERNION_SLACK: f64 = 1e-3;

/// What turns values of a scene file into metres, paths and poses.
pub(super) struct Values<'a> {
    pub(super) source: Source<'a>,
    /// What paths are relative to.
    pub(super) folder: PathBuf,
    /// The file's unit in metres.
    pub(super) metres: f64,
}

impl Values<'_> {
    /// An error at a byte range of the file.
    pub(super) fn error(&self, span: Range<usize>, message: impl Into<String>) -> SceneError {
        self.source.error(span, message)
    }

    pub(super) fn positive(&self, value: &Spanned<f64>, name: &str) -> Result<f64, SceneError> {
        let v = *value.get_ref();
        if v.is_finite() && v > 0.0 {
            return Ok(v);
        }
        let message = format!("{name}: expected a positive number, found {v}");
        Err(self.error(value.span(), message))
    }

    /// Zero or a positive number.
    pub(super) fn natural(&self, value: &Spanned<f64>, name: &str) -> Result<f64, SceneError> {
        match *value.get_ref() {
            0.0 => Ok(0.0),
            _ => self.positive(value, name),
        }
    }

    pub(super) fn finite(
        &self,
        value: &Spanned<[f64; 3]>,
        name: &str,
    ) -> Result<DVec3, SceneError> {
        let v = DVec3::from_array(*value.get_ref());
        if v.is_finite() {
            return Ok(v);
        }
        let message = format!("{name}: expected finite numbers, found {v}");
        Err(self.error(value.span(), message))
    }

    /// A positive length, metres.
    pub(super) fn length(
        &self,
        value: &Option<Spanned<f64>>,
        name: &str,
    ) -> Result<Option<f64>, SceneError> {
        let Some(value) = value else {
            return Ok(None);
        };
        Ok(Some(self.positive(value, name)? * self.metres))
    }

    /// A place, metres; the origin if absent.
    pub(super) fn point(
        &self,
        value: &Option<Spanned<[f64; 3]>>,
        name: &str,
    ) -> Result<DVec3, SceneError> {
        match value {
            Some(value) => Ok(self.finite(value, name)? * self.metres),
            None => Ok(DVec3::ZERO),
        }
    }

    pub(super) fn pose(
        &self,
        position: &Option<Spanned<[f64; 3]>>,
        rotation: &Option<Spanned<[f64; 4]>>,
    ) -> Result<Pose, SceneError> {
        let translation = self.point(position, "position")?;
        let rotation = match rotation {
            Some(q) => quaternion(*q.get_ref()).map_err(|length| {
                let message = format!(
                    "rotation: expected a unit quaternion x, y, z, w (within {QUATERNION_SLACK}), \
                     found length {length}"
                );
                self.error(q.span(), message)
            })?,
            None => DQuat::IDENTITY,
        };
        Ok(Pose::new(rotation, translation))
    }
}

/// A rotation from `x, y, z, w`, normalized if nearly of unit length.
///
/// # Errors
/// The length found, if it is further than [`QUATERNION_SLACK`] from 1.
pub(crate) fn quaternion(xyzw: [f64; 4]) -> Result<DQuat, f64> {
    let q = DQuat::from_array(xyzw);
    let length = q.length();
    if length.is_finite() && (length - 1.0).abs() <= QUATERNION_SLACK {
        Ok(q.normalize())
    } else {
        Err(length)
    }
}

/// The text of a scene file, for errors that show the line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

impl Source<'_> {
    /// An error at a byte range of the text.
    pub(super) fn error(&self, span: Range<usize>, message: impl Into<String>) -> SceneError {
        let start = span.start.min(self.text.len());
        let before = &self.text.as_bytes()[..start];
        SceneError::Line(Box::new(LineError {
            path: self.path.to_owned(),
            line: before.iter().filter(|&&b| b == b'\n').count() + 1,
            message: message.into(),
            text: self.text.to_owned(),
            span: start..span.end.clamp(start, self.text.len()),
        }))
    }
}
