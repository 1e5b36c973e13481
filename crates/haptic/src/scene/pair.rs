//! A pair of a scene: a fixed part, and how to get the energy of the moving part against it.

use std::path::PathBuf;
use std::sync::Arc;

use fft_correlate::{EnergySource, PartialTable, Placement};
use sdf_grid::Aabb;

/// What a loader may fail with.
pub type LoadFailure = Box<dyn std::error::Error + Send + Sync>;

/// Makes the energy source of a pair; called on the loading thread, as often as the pair is loaded.
pub type Loader = Box<dyn FnMut() -> Result<Loaded, LoadFailure> + Send>;

/// The energy of a pair.
pub enum Content {
    /// All in memory.
    Whole {
        /// Energy at poses of the shapes.
        source: Arc<dyn EnergySource>,
        /// Memory it takes, bytes.
        bytes: u64,
    },
    /// A table on disk, of which the rotations near the part's own are kept in memory.
    Table(Box<PartialTable>),
}

/// A pair ready to be asked.
pub struct Loaded {
    /// Its energy.
    pub content: Content,
    /// Where the moving part's pivot must be, in the fixed shape's frame, for the energy to differ
    /// from zero, metres.
    pub reach: Aabb,
}

/// A fixed part and how to get the energy of the moving part against it.
pub struct PairSpec {
    /// For reports.
    pub name: String,
    /// Where both shapes are in the scene.
    pub placement: Placement,
    /// What [`Loaded::reach`] will be; known before anything is loaded.
    pub reach: Aabb,
    /// Memory that it will take if it is whole, as far as it is known; 0 for a table that is kept
    /// in part.
    pub bytes: u64,
    /// The pair is loaded again when one of these changes.
    pub files: Vec<PathBuf>,
    /// The pair before it in the list whose source is this one's too, if the parts are the same but
    /// for where they stand: they share memory, and what is loaded for one serves all. Their
    /// `files` are the same, their `load` gives the same.
    pub same_as: Option<usize>,
    /// Loads it.
    pub load: Loader,
}
