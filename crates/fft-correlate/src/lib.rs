//! Scores, energies and wrenches of a rigid pair over SE(3), by FFT correlation and by direct
//! quadrature, and tables that interpolate them.
//!
//! Formulas, signs, FFT normalization and quaternion order are fixed in `docs/conventions.md`.
//!
//! # Energy, force and torque at any pose
//!
//! | what | whose full wrench | cost |
//! |---|---|---|
//! | [`DirectEvaluator`] | any rotation and translation, exact gradient of its quadrature | 0.1 - 10 ms |
//! | [`EnergyTable`] ([`EnergyTable::respond`], [`EnergyTable::respond_many`]) | within the table's rotations and window, exact gradient of its interpolant | microseconds |
//! | [`Correlator::gradient`] | one rotation, all displacements of a window at once: the exact gradient of [`Correlator::score`] | six correlations |
//!
//! The first two answer through one trait, [`EnergySource::evaluate`], with energy, wrench (torque first, about
//! the moving part's origin, fixed frame) and coverage:
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
//! [`Condition::at`] says how far the terms of a score cancel; [`measure_error`] compares a table with
//! any other source at poses it has never seen.

pub mod bake;
mod chart;
pub mod correlate;
pub mod correlate_fields;
mod cost;
pub mod deaverage;
pub mod direct;
pub mod dock;
mod encode;
pub mod energy;
mod fft3;
mod fold;
mod fused;
mod gradient;
pub mod half_turn;
mod hull;
mod lane_fft;
mod lane_plan;
mod lanes;
pub mod launcher;
mod layout;
pub mod model;
mod overlap;
pub mod pair;
pub mod pair_builder;
pub mod peaks;
pub mod query;
mod radix;
mod real;
pub mod refine;
mod resample;
pub mod rotation_domain;
pub mod rotation_grid;
pub mod se3;
mod spectral;
mod spectral_reference;
mod stencil;
pub mod store;
pub mod table;
pub mod table_error;
pub mod table_parts;
mod table_rows;
pub mod taps;
pub mod translation;
pub mod well;

#[path = "pair/budget.rs"]
mod budget;
#[path = "pair/cached.rs"]
mod cached;
#[path = "table/design.rs"]
mod design;
#[path = "dock/docking.rs"]
pub mod docking;
#[path = "pair/energy_scale.rs"]
mod energy_scale;
#[path = "pair/lattice_step.rs"]
mod lattice_step;
#[path = "pair/setup.rs"]
mod setup;
#[path = "rotations/symmetry.rs"]
pub mod symmetry;
#[path = "table/tolerance.rs"]
pub mod tolerance;

pub use design::{TableDesign, TableDesignError};
pub use energy_scale::{EnergyScale, EnergyScaleError};
pub use lattice_step::LatticeStep;
pub use setup::{PairSetup, PairSetupError};

pub use bake::{BakeError, BakeReport, PairEnergies, Share, bake, bake_files};
pub use correlate::{CorrelateError, Correlator, CorrelatorPlan, CorrelatorScratch, ProductPlan};
pub use correlate_fields::correlate_fields;
pub use deaverage::{averaging_strength, deaveraged};
pub use direct::{Condition, DirectError, DirectEvaluator, DirectOptions};
pub use dock::{
    DockError, DockOptions, DockedPose, Docking, FoundPose, SearchDomain, SearchError,
    SearchLattices, SearchOptions, SearchPairs, SearchReport, decide, dock, domain_rotations,
    search, search_rotations, symmetry_group, wants_sketch,
};
pub use encode::{Numbers, Storage};
pub use energy::{EnergySource, Response, Scratch};
pub use half_turn::{HalfTurn, HalfTurnGroup, half_turn_groups};
pub use launcher::Launcher;
pub use model::{ModelError, ScoreModel};
pub use pair::{Pair, PairError};
pub use pair_builder::{PairBuildError, PairBuilder, PairPlan};
pub use peaks::{Peak, PoseSpacing, half_width, top_peaks};
pub use real::Real;
pub use refine::Descent;
pub use rotation_domain::{AxisSymmetry, Part, RotationDomain, RotationError};
pub use rotation_grid::RotationGrid;
pub use se3::{Pose, Twist, Wrench};
pub use spectral::StageTimes;
pub use store::{StoreError, TableFiles, TableStore};
pub use table::{EnergyTable, FieldSampling, NodeEnergies, TableError, TableSpec};
pub use table_error::{ErrorReport, Excess, measure_error, random_pose, typical_condition};
pub use table_parts::PartialTable;
pub use taps::Interpolation;
pub use translation::TranslationWindow;
pub use well::{Well, WellError, WellOptions};
