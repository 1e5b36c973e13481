//! Why a surface cannot be summed over.

/// Why a surface cannot be summed over.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// The smoothing has no width.
    #[error("width of the smoothing: expected more than 0 m, found {found}")]
    Width {
        /// What was given, metres.
        found: f64,
    },
    /// The samples are to be no distance apart.
    #[error("distance of surface samples: expected more than 0 m, found {found}")]
    Distance {
        /// What was given, metres.
        found: f64,
    },
    /// The part has too many faces, or they are cut too finely.
    #[error("{what}: expected at most {most}, found {found:.0} or more")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// The most.
        most: usize,
        /// How many there would be.
        found: f64,
    },
    /// No triangle has an area.
    #[error("mesh: expected a triangle with an area, found none")]
    EmptyMesh,
}
