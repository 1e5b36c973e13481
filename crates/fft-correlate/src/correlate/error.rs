//! Why a pair cannot be correlated over a window.

/// Why a correlator cannot be planned or built.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrelateError {
    /// The window's spacing is not the pair's.
    #[error(
        "translation window: expected the pair's lattice spacing {expected} m, found {found} m"
    )]
    Spacing {
        /// The pair's spacing, metres.
        expected: f64,
        /// The window's spacing, metres.
        found: f64,
    },
    /// The transform would have too many points.
    #[error("transform of {size:?} points: expected at most {limit} in all")]
    Size {
        /// Points per axis.
        size: [usize; 3],
        /// The largest number of points accepted.
        limit: u64,
    },
    /// A density is not finite.
    #[error("density of the {part} part is not finite at lattice node {index:?}")]
    NotFinite {
        /// `fixed` or `moving`.
        part: &'static str,
        /// The first such node.
        index: [usize; 3],
    },
    /// The pair to build for is not the one that was planned for.
    #[error(
        "pair: expected the one that the plan was made for, found other weights, or densities that \
         are nonzero elsewhere"
    )]
    OtherPair,
}
