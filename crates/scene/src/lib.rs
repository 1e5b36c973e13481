//! Scene files of mechanical assemblies: read, checked, and ready to be scored, docked or felt.
//!
//! A scene is TOML. Three lines suffice: the unit and the two meshes. Every key is described in
//! `docs/scene.md`.
//!
//! ```text
//! Scene::read -> SceneSetup::read -> Assembly::new -> LivePairs::start
//! checked text   meshes              fields           several pairs beside a loop
//! ```
//!
//! ```no_run
//! use fft_correlate::{DirectOptions, EnergySource};
//! use pegfit_scene::{Assembly, Scene};
//! use sdf_grid::Silent;
//!
//! let scene = Scene::read("scene.toml")?;
//! let assembly = Assembly::load(scene, 4 << 30, &Silent)?;
//! let source = assembly.source(&DirectOptions::FULL)?;
//! let response = source.evaluate(&assembly.assembled(), &mut source.scratch());
//! println!("{} J", response.energy);
//! # Ok::<(), pegfit_scene::SceneError>(())
//! ```
//!
//! Nothing here prints: what a user should know comes as [`SceneWarning`]s, what goes wrong as
//! [`SceneError`]s. [`poses`] reads and writes poses as comma-separated rows.

mod assembly;
mod check;
mod error;
mod examples;
mod file;
mod joint_export;
mod live;
pub mod poses;
mod scene;
mod setup;
mod shell;
mod solids;

pub use assembly::{Assembly, Motion, ProfilePoint};

pub use check::fit_verdict::{FACETS, FitVerdict, TOUCHING};
pub use check::ledger::ledger_lines;
pub use check::mesh_verdict::MeshVerdict;
pub use examples::example_text;

pub use error::{LineError, Refusal, SceneError};
pub use joint_export::{
    DockedPair, ExportError, GlbPart, JointRecord, JointedPart, MateKind, MateRecord, MateSide,
    Mates, PartRecord, PartTree, PoseRecord, TravelRecord, mates, write_glb, write_mates,
    write_mjcf, write_tree_mjcf, write_tree_urdf, write_urdf,
};
pub use live::LivePairs;
pub use scene::{FitChoice, LatticeChoice, Loading, Part, PlacedMesh, Scene, WindowChoice};
pub use setup::parts::FitSolids;
pub use setup::parts::SceneWarning;
pub use setup::scene_setup::PlacedParts;
pub use setup::scene_setup::SceneSetup;
pub use setup::tables::{TableReference, held_out_poses};
pub use shell::shell_word;
pub use solids::draft::SceneDraft;
pub use solids::error::ImportError;
pub use solids::mjcf::geom::MujocoOptions;
pub use solids::solid_set::{PlacedSolid, SolidOptions, SolidSet};
pub use solids::write::unique_name;
