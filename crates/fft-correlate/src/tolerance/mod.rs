//! Choosing lattices and rotation steps for an error that was asked for.

pub(crate) mod direct;
pub(crate) mod error;
pub(crate) mod table;

pub use direct::TRIALS;
pub use direct::TolerantDirect;
pub use error::{Limit, ToleranceError};
pub use table::{LATTICE_SHARE, TolerantDesign, Trial};
