//! The energy of the model for a pair of closed polyhedral meshes, and its force and torque,
//! without a lattice: what everything that states an error states it against.
//!
//! # The integral
//!
//! The score (`docs/conventions.md`) is an integral over space of a product of densities that jump
//! across the surfaces of both parts. [`Truth`]
//!
//! - fits each part's exterior and interior density, each continued beyond the surface, by quadratic
//!   polynomials in the cells of an octree of its own, refined until exact values agree; within
//!   tubes about sharp edges, where densities depend on direction alone, it reads them at the tube;
//! - for a pose cuts space by the fixed part's octree, further where the moving part's is finer and
//!   near sharp edges of either, and each cell by the planes of all faces in it: each piece lies on
//!   one side of both surfaces, whatever the shape of the parts, and is integrated with one-sided
//!   densities only, by rules that are exact for quadratic functions;
//! - takes force and torque by the exact derivative: gradients of the fits in the volume, and on both
//!   surfaces the jump of the density times the normal.
//!
//! Volumes and areas are exact; what errs is the fits and, where sharp edges of both parts meet, the
//! quadrature. `cargo run --release -p pegfit-benches --bin truth` measures how much, by truths of
//! turned and shifted parts (other cells, other fits), by differences of the energy, and by
//! [`sampled_energy`], which shares neither densities nor cells with it.
//!
//! # Limits
//!
//! At walls that coincide the energy has a crease and the wrench is the mean of the slopes to
//! both sides. Torques err several times as much as forces: near edges densities vary on the
//! scale of the distance to them, down to the smallest cells. Faces cost time one by one: parts
//! of hundreds of planes are fine, scans are not. Parts must be closed.
//!
//! ```
//! use fft_correlate::{Pose, ScoreModel};
//! use glam::DVec3;
//! use pegfit_truth::{Truth, TruthOptions};
//! use sdf_grid::shapes::PegInHole;
//!
//! let (hole, peg) = PegInHole::Rectangular.pair(1e-4)?;
//! let options = TruthOptions { tolerance: 0.05, smallest: 0.2, ..TruthOptions::COARSE };
//! let truth = Truth::new(&hole, &peg, &ScoreModel::GUIDED, &options)?;
//! // Pressed against the wall at +x: pushed back.
//! let found = truth.at(&Pose::from_translation(DVec3::X * 5e-4));
//! assert!(found.energy < 0.0 && found.wrench.force.x < 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod check;
mod error;
mod geometry;
mod halo;
mod integral;
mod options;
mod table;

pub use check::sampled::{SampledEnergy, sampled_energy};
pub use error::TruthError;
pub use integral::truth::{TrueResponse, Truth};
pub use options::{Densities, TruthOptions};
