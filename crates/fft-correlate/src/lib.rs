//! Scores, energies and wrenches of a rigid pair over SE(3), by FFT correlation and by direct
//! quadrature, and tables that interpolate them.
//!
//! Formulas, signs, FFT normalization and quaternion order are fixed in `docs/conventions.md`.
//!
//! # Energy, force and torque at any pose
//!
//! - [`DirectEvaluator`]: any rotation and translation, the exact gradient of its quadrature; 0.1 to
//!   10 ms.
//! - [`EnergyTable::respond`], [`EnergyTable::respond_many`]: within the table's rotations and
//!   window, the exact gradient of its interpolant; microseconds.
//! - [`Correlator::gradient`]: one rotation, all displacements of a window at once, the exact
//!   gradient of [`Correlator::score`]; six correlations.
//!
//! The first two answer through one trait, [`EnergySource::evaluate`], with energy, wrench (torque
//! first, about the moving part's origin, fixed frame) and coverage:
//!
//! ```
//! use fft_correlate::{DirectEvaluator, DirectOptions, EnergySource, PairBuilder, Pose, ScoreModel};
//! use glam::DVec3;
//! use sdf_grid::{Silent, shapes::PegInHole};
//!
//! let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
//! let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
//! let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
//! let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
//! // 2 mm out of the fit: drawn back in.
//! let pose = Pose::from_translation(DVec3::new(0.0, 0.0, 0.002));
//! let response = source.evaluate(&pose, &mut source.scratch());
//! assert!(response.energy < 0.0 && response.wrench.force.z < 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`Condition::at`] measures how far the terms of a score cancel; [`measure_error`] compares a table
//! with any other source at held-out poses.

pub(crate) mod basin;
pub mod correlate;
pub mod direct;
pub mod dock;
mod energy;
mod geometry;
pub mod mating;
pub mod pair;
mod rotations;
mod sweep;
pub mod table;
pub mod tolerance;
mod vectors;

pub use basin::{Well, WellError, WellOptions, peak_force};
pub use correlate::correlator::Correlator;
pub use correlate::support::CorrelateError;
pub use direct::condition::Condition;
pub use direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
pub use direct::tiles::{TileError, TiledEvaluator, WatchedTiles};
pub use dock::docking::{Docking, DockingPose, DockingRequest, DockingResult};
pub use dock::error::DockingError;
pub use dock::peaks::{Peak, top_peaks};
pub use energy::{EnergySource, InScene, Response, Scratch};
pub use geometry::placement::Placement;
pub use geometry::se3::{Pose, Twist, Wrench};
pub use geometry::side::Side;
pub use geometry::translation::TranslationWindow;
pub use pair::builder::{PairBuildError, PairBuilder};
pub use pair::fields::{FieldNodes, Pair, PairError};
pub use pair::model::{ModelError, PairProvenance, ScoreModel};
pub use pair::setup::{EnergyScale, EnergyScaleError, LatticeStep, PairSetup, PairSetupError};
pub use rotations::domain::{AxisSymmetry, RotationDomain, RotationError};
pub use rotations::grid::RotationGrid;
pub use rotations::search_rotations::symmetry_group;
pub use rotations::symmetry::{from_fit, symmetry_on_lattice};
pub use sweep::{NodeEnergies, PairEnergies};
pub use table::accuracy::{ErrorReport, Excess, measure_error, typical_condition};
pub use table::bake::{BakeError, BakeResult, Share, bake};
pub use table::energy_table::EnergyTable;
pub use table::launcher::Launcher;
pub use table::parts::PartialTable;
pub use table::plan::{TablePlan, TablePlanError};
pub use table::spec::TableError;
pub use table::spec::{Storage, TableSpec};
pub use table::store::error::StoreError;
pub use table::store::files::TableFiles;
pub use table::store::table_store::TableStore;

/// Inner parts that only the tests and benchmarks of this workspace use; they may change at any
/// time.
#[doc(hidden)]
pub mod testing {
    pub use crate::direct::terms::{Blend, Term, score_terms};
    pub use crate::dock::options::{SearchDomain, SearchOptions, SearchPairs};
    pub use crate::dock::refine::Descent;
    pub use crate::dock::search::search;
    pub use crate::geometry::half_turn::half_turn_groups;
    pub use crate::rotations::search_rotations::search_rotations;
    pub use crate::table::accuracy::random_pose;
    pub use crate::table::bake::bake_files;
}
