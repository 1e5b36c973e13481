//! A pair of a scene: a fixed part, and how to get the energy of the moving part against it.

use std::path::PathBuf;
use std::sync::Arc;

use fft_correlate::{
    DirectError, DirectEvaluator, DirectOptions, EnergySource, Pair, PartialTable, Placement,
    ScoreModel, StoreError, TableSpec, TableStore,
};
use glam::DVec3;
use sdf_grid::Aabb;

/// What a loader may fail with.
pub type LoadFailure = Box<dyn std::error::Error + Send + Sync>;

/// Makes the energy source of a pair; called on the loading thread, as often as the pair is loaded, with
/// the place of the moving part's pivot in the fixed shape's frame, metres.
pub type Loader = Box<dyn FnMut(DVec3) -> Result<LoadedPair, LoadFailure> + Send>;

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
pub struct LoadedPair {
    /// Its energy.
    pub content: Content,
    /// Where the moving part's pivot must be, in the fixed shape's frame, for the energy to differ
    /// from zero, metres.
    pub reach: Aabb,
    /// Where in its reach the energy is right, if not everywhere: the pair is loaded again before the
    /// pivot leaves it.
    pub right: Option<Aabb>,
}

/// A fixed part and how to get the energy of the moving part against it.
///
/// See the example of [`LiveScene`](crate::LiveScene).
pub struct PairSpec {
    /// For reports.
    pub name: String,
    /// Where both shapes are in the scene.
    pub placement: Placement,
    /// What [`LoadedPair::reach`] will be; known before anything is loaded.
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

/// A cell's worth of a halo: the densities end within one.
const SLACK: f64 = 0.05;

impl LoadedPair {
    /// A pair evaluated directly, its points merged as far as real time needs. `fixed` bounds the
    /// fixed part, `radius` the moving part about the pivot that reaches speak of, metres.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn direct(pair: &Pair, fixed: &Aabb, radius: f64) -> Result<Self, DirectError> {
        let source = DirectEvaluator::new(pair, &DirectOptions::REAL_TIME)?;
        Ok(Self {
            content: Content::Whole {
                bytes: source.describe().bytes,
                source: Arc::new(source) as Arc<dyn EnergySource>,
            },
            reach: direct_reach(pair.model(), pair.fixed().provenance.halo, fixed, radius),
            right: None,
        })
    }

    /// A table on disk; `pivot` is what reaches speak of, metres, moving part's frame.
    ///
    /// # Errors
    /// If the table cannot be read in part.
    pub fn table(store: TableStore, pivot: DVec3) -> Result<Self, StoreError> {
        let reach = table_reach(store.spec(), pivot);
        Ok(Self {
            content: Content::Table(Box::new(PartialTable::new(store)?)),
            reach,
            right: None,
        })
    }
}

/// Where the pivot must be, in the fixed part's frame, for a pair evaluated directly to have
/// energy. Beyond the halo of one part and the bounds of the other there is none; with a separation
/// weight the halos of both meet.
pub fn direct_reach(model: &ScoreModel, halo: f64, fixed: &Aabb, radius: f64) -> Aabb {
    let halos = match model.separation_weight {
        0.0 => halo,
        _ => 2.0 * halo,
    };
    fixed.grown(halos + SLACK * halo + radius)
}

/// The same for a table: [`TableSpec::fade_length`] beyond its window it has faded out. `pivot` is
/// the point of the moving part that reaches speak of, metres, its frame.
pub fn table_reach(spec: &TableSpec, pivot: DVec3) -> Aabb {
    let (window, own) = (&spec.window, spec.pivot());
    let last = DVec3::from_array(window.shape().map(|n| n as f64 - 1.0)) * window.spacing();
    let first = own + window.origin();
    Aabb {
        min: first,
        max: first + last,
    }
    .grown(spec.fade_length() + own.distance(pivot))
}

/// Does work on all cores but one, which the loop keeps; on the only one, if there is one.
///
/// # Errors
/// If the threads cannot be started.
pub fn with_spare_core<T: Send>(
    work: impl FnOnce() -> T + Send,
) -> Result<T, rayon::ThreadPoolBuildError> {
    let threads = rayon::current_num_threads() - 1;
    if threads == 0 {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    Ok(pool.install(work))
}
