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
//! [`Condition::at`] says how far the terms of a score cancel; [`measure_error`] compares a table
//! with any other source at poses it has never seen.

pub mod basin;
mod correlate;
pub mod direct;
pub mod dock;
mod energy;
mod geometry;
pub mod pair;
mod rotations;
mod sweep;
pub mod table;
pub mod tolerance;
mod vectors;

pub use basin::WellError;
pub use basin::{Well, WellOptions};
pub use correlate::{
    CorrelateError, Correlator, CorrelatorPlan, CorrelatorScratch, PairSupport, ProductPlan, Real,
    StageTimes,
};
pub use direct::condition::Condition;
pub use direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
pub use dock::descend::{FoundPose, SearchReport};
pub use dock::docking::DockingPlan;
pub use dock::docking::DockingPose;
pub use dock::docking::{Docking, DockingOptions, DockingReport, MATING_ANGLE};
pub use dock::error::DockingError;
pub use dock::error::SearchError;
pub use dock::lattices::{SearchLattices, domain_rotations};
pub use dock::options::SearchOptions;
pub use dock::options::{SearchDomain, SearchPairs};
pub use dock::peaks::{Peak, PoseSpacing, half_width, top_peaks};
pub use dock::refine::Descent;
pub use dock::rotations::{search_rotations, symmetry_group};
pub use dock::search::decide;
pub use dock::search::search;
pub use dock::search::wants_sketch;
pub use energy::InScene;
pub use energy::{EnergySource, Response, Scratch};
pub use geometry::half_turn::RotationSum;
pub use geometry::half_turn::{HalfTurn, HalfTurnGroup, half_turn_groups};
pub use geometry::placement::Placement;
pub use geometry::se3::{Pose, Twist, Wrench};
pub use geometry::translation::TranslationWindow;
pub use pair::builder::{PairBuildError, PairBuilder, PairPlan};
pub use pair::fields::{Pair, PairError};
pub use pair::model::PairRecipe;
pub use pair::model::{ModelError, ScoreModel};
pub use pair::setup::LatticeStep;
pub use pair::setup::{EnergyScale, EnergyScaleError};
pub use pair::setup::{PairSetup, PairSetupError};
pub use rotations::domain::{AxisSymmetry, Part, RotationDomain, RotationError};
pub use rotations::grid::RotationGrid;
pub use rotations::symmetry::{from_fit, symmetry_on_lattice, table_symmetry};
pub use sweep::NodeEnergies;
pub use sweep::PairEnergies;
pub use table::accuracy::{ErrorReport, Excess, measure_error, random_pose, typical_condition};
pub use table::bake::{BakeError, BakeReport, Share, bake, bake_files};
pub use table::design::{TableDesign, TableDesignError, TablePlan};
pub use table::energy_table::EnergyTable;
pub use table::error::TableError;
pub use table::launcher::Launcher;
pub use table::parts::PartialTable;
pub use table::spec::Storage;
pub use table::spec::TableSpec;
pub use table::store::error::StoreError;
pub use table::store::files::TableFiles;
pub use table::store::table_store::TableStore;
