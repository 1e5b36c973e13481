//! Errors of path searches.

/// Why a search for a path cannot begin, or did not end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PathError {
    /// An option is out of range.
    #[error("path option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// A pose is not one.
    #[error("{which} pose must be finite with a unit quaternion")]
    Pose {
        /// `goal` or `start`.
        which: &'static str,
    },
    /// The parts overlap where a path is to begin or end.
    #[error(
        "at the {which} the parts overlap by {:.4} mm, {:.4} mm³ in all, where {:.4} mm count as \
         contact: allow it, or give the pose more exactly",
        1e3 * depth, 1e9 * volume, 1e3 * tolerance
    )]
    Overlap {
        /// `goal` or `start`.
        which: &'static str,
        /// Of the deepest point, metres.
        depth: f64,
        /// Cubic metres.
        volume: f64,
        /// What counts as contact, metres.
        tolerance: f64,
    },
    /// Two parts overlap where they are assembled.
    #[error(
        "the parts `{}` and `{}` overlap by {:.4} mm, {:.4} mm³ in all, where they are assembled; \
         {:.4} mm count as contact: allow it, or place them more exactly",
        parts[0], parts[1], 1e3 * depth, 1e9 * volume, 1e3 * tolerance
    )]
    PartsOverlap {
        /// Their names.
        parts: [String; 2],
        /// Of the deepest point, metres.
        depth: f64,
        /// Cubic metres.
        volume: f64,
        /// What counts as contact, metres.
        tolerance: f64,
    },
    /// The parts lie beside each other at the goal: there is nothing to go into.
    #[error(
        "at the goal the parts lie beside each other, {:.4} mm apart: no path leads in; is it the \
         pose where the part belongs?",
        1e3 * gap
    )]
    Outside {
        /// Between the parts' extents, metres.
        gap: f64,
    },
    /// The visited poses belong to another request.
    #[error("the visited poses belong to another request: {item} differs")]
    Visited {
        /// What differs.
        item: &'static str,
    },
    /// The source of energies had no answer ([`fft_correlate::EnergySource::has_failed`]).
    #[error("the energies along the path cannot be computed")]
    Energies,
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}
