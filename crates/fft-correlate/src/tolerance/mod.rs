//! Choosing lattices and rotation steps that meet a tolerance.

pub(crate) mod direct;
pub(crate) mod error;
mod refine;
pub(crate) mod table;

pub use direct::TolerantDirect;
pub use error::{Limit, ToleranceError};
pub use refine::{TRIALS, Trial};
pub use table::{LATTICE_SHARE, TolerantPlan};
