//! The page of `pegfit play` without a program: what its workers ask of the libraries, compiled to
//! WebAssembly.
//!
//! [`Play`] is a session of two parts: its owner steps the loop, hands requests and frames on, and
//! asks for surfaces, densities and fits. [`Meshes`] are files dropped onto the page, with the
//! verdict of `pegfit check` on each. The page is in `crates/play/page`, `just wasm` builds it.
//!
//! Elsewhere only its tests are compiled.
#![cfg(any(target_family = "wasm", test))]

mod meshes;
mod opened;
mod progress;
#[cfg(target_family = "wasm")]
mod stage;

pub use meshes::Meshes;
#[cfg(target_family = "wasm")]
pub use stage::{Play, pairs, version};
