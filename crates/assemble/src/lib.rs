//! From loose parts to an assembly: which part belongs to which, where, and in which order they go
//! together.
//!
//! 1. Parts of the same shape are found once (`sdf_grid::congruence`).
//! 2. Every two shapes are docked by how contact holds them (`fft_correlate::mating`).
//! 3. A beam search puts parts together, the best-held first: each part is seated against all that is
//!    there already, from its places on single parts, and by a whole search where those lead nowhere.
//! 4. The best assemblies are taken apart (`pegfit_path`): what cannot be is worth less.
//!
//! ```
//! use std::sync::Arc;
//!
//! use fft_correlate::Pose;
//! use glam::{DQuat, DVec3};
//! use pegfit_assemble::{AssemblyRequest, AssemblySearch, LoosePart};
//! use sdf_grid::{Silent, shapes::PegInHole};
//!
//! let (plate, peg) = PegInHole::Rectangular.pair(1e-4)?;
//! let moved = peg.transformed(DQuat::from_rotation_x(0.7), DVec3::new(0.3, 0.0, 0.0));
//! let part = |name: &str, mesh| LoosePart { name: name.into(), mesh: Arc::new(mesh) };
//! let parts = vec![part("plate", plate), part("peg", moved)];
//! let found = AssemblySearch::new(parts, AssemblyRequest::default())?.run(&Silent)?;
//! let best = &found.assemblies[0];
//! assert!(best.left_over.is_empty() && best.placed.len() == 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod beam;
mod error;
mod explode;
mod extensions;
mod families;
mod journal;
mod pairs;
mod places;
mod report;
mod request;
mod result;
mod same;
mod search;
mod seeds;
mod shape;
mod subassembly;
mod tree;

pub use error::AssemblyError;
pub use request::{AssemblyRequest, LoosePart};
pub use result::{Assembly, AssemblyResult, Mate, PairSummary, PlacedPart};
pub use search::AssemblySearch;
pub use tree::AssemblyLink;
