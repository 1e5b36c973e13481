//! Energy, force and torque of a pair of polyhedra that know no lattice.
//!
//! To be completed.

mod error;
mod geometry;
mod integral;
mod options;
mod table;

pub use error::TruthError;
pub use integral::truth::{TrueResponse, Truth};
pub use options::{Densities, TruthOptions};
