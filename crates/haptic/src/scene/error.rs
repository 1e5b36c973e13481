//! Why a scene could not be started.

use crate::scene::pair::LoadFailure;

/// Why a scene could not be started.
#[derive(Debug, thiserror::Error)]
pub enum LiveSceneError {
    /// The pairs in reach at the start need more than the budget.
    #[error(
        "the pairs in reach at the start ({pairs}) need {needed} bytes, the scene's memory budget is {budget}"
    )]
    Memory {
        /// Their names.
        pairs: String,
        /// What they need together, bytes.
        needed: u64,
        /// What they may take, bytes.
        budget: u64,
    },
    /// A pair in reach at the start could not be loaded.
    #[error("{pair}: {source}")]
    Load {
        /// Its name.
        pair: String,
        /// Why.
        source: LoadFailure,
    },
    /// The loading thread could not be started.
    #[error("the loading thread could not be started: {0}")]
    Thread(std::io::Error),
}
