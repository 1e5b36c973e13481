//! The page of `pegfit play` without a program: what its workers ask of the libraries, compiled to
//! WebAssembly.
//!
//! [`Play`] is a session of two parts: its owner steps the loop, hands requests and frames on, and
//! asks for surfaces, densities and fits. [`Meshes`] are files dropped onto the page, with the
//! verdict of `pegfit check` on each. The page is in `crates/play/page`, `just wasm` builds it.

mod meshes;
mod opened;
mod progress;
mod stage;

pub use meshes::Meshes;
pub use stage::{Play, pairs, version};
