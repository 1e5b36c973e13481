//! Scores, energies and wrenches of a rigid pair over SE(3), by FFT correlation and by direct
//! quadrature, and tables that interpolate them.
//!
//! Formulas, signs, FFT normalization and quaternion order are fixed in `docs/conventions.md`.

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
mod lane_fft;
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
pub mod taps;
pub mod translation;
pub mod well;

pub use bake::{BakeError, BakeReport, PairEnergies, Share, bake};
pub use correlate::{CorrelateError, Correlator, CorrelatorPlan, CorrelatorScratch, ProductPlan};
pub use correlate_fields::correlate_fields;
pub use deaverage::{averaging_strength, deaveraged};
pub use direct::{Condition, DirectError, DirectEvaluator, DirectOptions};
pub use dock::{
    DockError, DockOptions, DockedPose, Docking, FoundPose, SearchDomain, SearchError,
    SearchLattices, SearchOptions, SearchReport, decide, dock, domain_rotations, search,
    search_rotations, symmetry_group,
};
pub use encode::{Numbers, Storage};
pub use energy::{EnergySource, Response, Scratch};
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
pub use store::{StoreError, TableStore};
pub use table::{EnergyTable, FieldSampling, NodeEnergies, TableError, TableSpec};
pub use table_error::{ErrorReport, Excess, measure_error, random_pose, typical_condition};
pub use taps::Interpolation;
pub use translation::TranslationWindow;
pub use well::{Well, WellError, WellOptions};
