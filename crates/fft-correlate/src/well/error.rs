//! Why a well cannot be analysed.

/// Why a well cannot be analysed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WellError {
    /// An option is out of range.
    #[error("well option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The energy is no lower at the minimum found than far away.
    #[error("no well here: energy {minimum} J at its lowest, {far} J far away")]
    NoWell {
        /// Lowest energy found near the pose, joules.
        minimum: f64,
        /// Energy far away, joules.
        far: f64,
    },
}
