//! The request of a path search.

use std::time::Duration;

use fft_correlate::Pose;

use crate::error::PathError;

/// Where a path begins.
///
/// See the example of [`PathRequest`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// Anywhere beside the fixed part.
    #[default]
    Outside,
    /// At a pose of the shapes.
    Pose(Pose),
}

/// Options of a path search.
///
/// ```
/// use std::{sync::Arc, time::Duration};
///
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use pegfit_path::{PathRequest, PathSearch, Start};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(2e-4)?;
/// let above = Pose::from_translation(DVec3::Z * 0.035);
/// let request = PathRequest {
///     tolerance: Some(1e-4),
///     time_limit: Duration::from_secs(10),
///     start: Start::Pose(above),
///     others: 0.0,
///     ..PathRequest::default()
/// };
/// let search = PathSearch::new(Arc::new(hole), Arc::new(peg), request)?;
/// assert_eq!(search.tolerance(), 1e-4);
/// let result = search.find(&Pose::IDENTITY, None, &Silent)?;
/// assert_eq!(result.poses[0].pose, above);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PathRequest {
    /// Overlaps up to this depth count as contact, metres; a thousandth of the moving part's radius
    /// about its centroid if absent. Passages narrower than half of it may be missed.
    pub tolerance: Option<f64>,
    /// Largest motion of any point between two poses of the answer, metres; a thirtieth of the radius if
    /// absent, and more where there would be more than 2000 poses.
    pub step: Option<f64>,
    /// The search gives up after this time.
    pub time_limit: Duration,
    /// Where the path begins.
    pub start: Start,
    /// Go on if the parts overlap at the goal or start: overlaps as deep as that then count as contact.
    pub allow_overlap: bool,
    /// How long to look for other paths, as a share of the time that the first one took.
    pub others: f64,
}

impl Default for PathRequest {
    /// From outside, a minute, other paths for as long as the first one took.
    fn default() -> Self {
        Self {
            tolerance: None,
            step: None,
            time_limit: Duration::from_secs(60),
            start: Start::Outside,
            allow_overlap: false,
            others: 1.0,
        }
    }
}

impl PathRequest {
    pub(crate) fn validate(&self) -> Result<(), PathError> {
        let lengths = [("tolerance", self.tolerance), ("step", self.step)];
        for (name, value) in lengths {
            if let Some(found) = value.filter(|v| !(v.is_finite() && *v > 0.0)) {
                return Err(PathError::Option {
                    name,
                    expected: "a positive number of metres",
                    found,
                });
            }
        }
        if !(self.others.is_finite() && self.others >= 0.0) {
            return Err(PathError::Option {
                name: "others",
                expected: "0 or more",
                found: self.others,
            });
        }
        match self.start {
            Start::Pose(pose) if !pose.is_valid() => Err(PathError::Pose { which: "start" }),
            _ => Ok(()),
        }
    }
}
