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

mod correlate;
pub mod direct;
pub mod dock;
mod energy;
mod geometry;
mod level;
pub mod pair;
mod rotations;
mod setup;
mod sweep;
pub mod table;
pub mod tolerance;
mod vectors;
pub mod well;

pub use correlate::{
    CorrelateError, Correlator, CorrelatorPlan, CorrelatorScratch, PairSupport, ProductPlan, Real,
    StageTimes,
};
pub use direct::condition::Condition;
pub use direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
pub use dock::decide::decide;
pub use dock::docking::{Docking, DockingOptions, DockingReport, MATING_ANGLE};
pub use dock::docking_error::DockingError;
pub use dock::domain::{SearchDomain, SearchPairs};
pub use dock::error::SearchError;
pub use dock::lattices::{SearchLattices, domain_rotations};
pub use dock::options::SearchOptions;
pub use dock::peaks::{Peak, PoseSpacing, half_width, top_peaks};
pub use dock::plan::DockingPlan;
pub use dock::refine::Descent;
pub use dock::report::{FoundPose, SearchReport};
pub use dock::rotations::{search_rotations, symmetry_group};
pub use dock::search::search;
pub use dock::sketch::wants_sketch;
pub use dock::told::DockingPose;
pub use energy::{EnergySource, Response, Scratch};
pub use geometry::half_turn::{HalfTurn, HalfTurnGroup, half_turn_groups};
pub use geometry::placement::Placement;
pub use geometry::rotation_sum::RotationSum;
pub use geometry::se3::{Pose, Twist, Wrench};
pub use geometry::translation::TranslationWindow;
pub use pair::builder::{PairBuildError, PairBuilder, PairPlan};
pub use pair::fields::{Pair, PairError};
pub use pair::lattice_step::LatticeStep;
pub use pair::model::{ModelError, ScoreModel};
pub use pair::recipe::PairRecipe;
pub use rotations::domain::{AxisSymmetry, Part, RotationDomain, RotationError};
pub use rotations::grid::RotationGrid;
pub use rotations::symmetry::{from_fit, symmetry_on_lattice, table_symmetry};
pub use setup::energy_scale::{EnergyScale, EnergyScaleError};
pub use setup::in_scene::InScene;
pub use setup::pair_setup::{PairSetup, PairSetupError};
pub use sweep::pair_energies::PairEnergies;
pub use sweep::producer::NodeEnergies;
pub use table::accuracy::{ErrorReport, Excess, measure_error, random_pose, typical_condition};
pub use table::bake::{BakeError, BakeReport, Share, bake, bake_files};
pub use table::design::{TableDesign, TableDesignError, TablePlan};
pub use table::energy_table::EnergyTable;
pub use table::error::TableError;
pub use table::launcher::Launcher;
pub use table::parts::PartialTable;
pub use table::spec::TableSpec;
pub use table::storage::Storage;
pub use table::store::error::StoreError;
pub use table::store::files::TableFiles;
pub use table::store::table_store::TableStore;
pub use well::analysis::{Well, WellOptions};
pub use well::error::WellError;
