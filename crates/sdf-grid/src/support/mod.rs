//! Basics of the whole crate: files, provenances, progress and memory.

pub(crate) mod angle;
pub mod atomic;
pub mod growing;
#[doc(hidden)]
pub mod large;
#[doc(hidden)]
pub mod level;
pub(crate) mod monitor;
pub(crate) mod place;
#[doc(hidden)]
pub mod prefetch;
pub mod provenance;
pub mod regular;
pub mod text;
