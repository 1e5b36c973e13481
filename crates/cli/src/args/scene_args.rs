//! What `pegfit scene` understands.

use std::path::PathBuf;

use clap::Args;
use sdf_grid::LengthUnit;

/// Arguments of `pegfit scene`.
#[derive(Debug, Args)]
pub struct SceneArgs {
    /// File of several solids (STEP, 3MF, glTF, OBJ, STL), or a robot's description (URDF, MJCF)
    pub file: PathBuf,
    /// What moves: a solid, link or body by its name or number; more than once if several move
    /// together [default: none: only list what there is]
    #[arg(long, value_name = "NAME")]
    pub moving: Vec<String>,
    /// What stays [default: all others that are in reach]
    #[arg(long, value_name = "NAME", requires = "moving")]
    pub fixed: Vec<String>,
    /// Scene file to write; meshes that it needs go into a folder beside it
    #[arg(short, long, value_name = "SCENE.toml", requires = "moving")]
    pub output: Option<PathBuf>,
    /// Each solid that stays is a part of its own; else they are one
    #[arg(long)]
    pub separate: bool,
    /// Length unit of OBJ and STL files: m, cm, mm, um, inch or foot
    #[arg(long, default_value = "mm")]
    pub unit: LengthUnit,
    /// STEP: edges around a full turn of a curved face, 6 to 1000
    #[arg(long, default_value_t = 64, value_name = "N")]
    pub segments_per_turn: u32,
    /// STEP: processor time after which a converter is stopped
    #[arg(long, default_value_t = 120, value_name = "SECONDS",
          value_parser = clap::value_parser!(u64).range(1..=86400))]
    pub step_time_limit: u64,
    /// Leave out what changes a solid and cannot be read (negative parts of slicers, beam lattices,
    /// free-form surfaces), instead of refusing it; what is left out is listed
    #[arg(long)]
    pub lossy: bool,
    /// URDF, MJCF: of links that have both, the shapes to look at instead of those to collide with
    #[arg(long)]
    pub visual: bool,
}
