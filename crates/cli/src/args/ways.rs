//! Arguments of the commands that look for ways.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `pegfit path`.
#[derive(Debug, Args)]
pub struct PathArgs {
    /// Scene file
    pub scene: PathBuf,
    /// Which fixed part of a scene with several, by its name
    #[arg(long, value_name = "NAME")]
    pub fixed: Option<String>,
    /// Where the way leads: `fit` (the scene's), `best` (docks first), or a pose
    /// x,y,z,qx,qy,qz,qw in metres
    #[arg(
        long,
        value_name = "POSE",
        default_value = "fit",
        allow_hyphen_values = true
    )]
    pub to: String,
    /// Where it begins: `outside`, or a pose x,y,z,qx,qy,qz,qw in metres
    #[arg(
        long,
        value_name = "POSE",
        default_value = "outside",
        allow_hyphen_values = true
    )]
    pub from: String,
    /// Poses along the way, with energy, force, torque and overlap; - is standard output
    #[arg(short, long, value_name = "PATH.csv")]
    pub output: Option<PathBuf>,
    /// Overlaps up to this depth count as contact, in the scene's unit [default: a thousandth of the
    /// moving part's radius]
    #[arg(long, value_name = "T")]
    pub tolerance: Option<f64>,
    /// Largest motion of any point of the part from one pose to the next, in the scene's unit
    /// [default: a thirtieth of its radius]
    #[arg(long, value_name = "D")]
    pub step: Option<f64>,
    /// Give up after so many seconds of searching
    #[arg(long, default_value_t = 60.0)]
    pub seconds: f64,
    /// Go on where a search for the same way ended that ran out of time or was stopped: what it has
    /// explored is read from FILE, and written there if this one is not decided either
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
    /// Go on if the parts overlap at the goal or at the start
    #[arg(long)]
    pub allow_overlap: bool,
    /// Look at the solids only: no fields, no energies, no forces
    #[arg(long)]
    pub solids_only: bool,
    /// Draw energy and force along the way
    #[arg(long, value_name = "P.png", conflicts_with = "solids_only")]
    pub png: Option<PathBuf>,
    /// Write a page that plays the way: both parts, energy and force; it needs no other file
    #[arg(long, value_name = "PAGE.html")]
    pub html: Option<PathBuf>,
}

/// Arguments of `pegfit disassemble`.
#[derive(Debug, Args)]
pub struct DisassembleArgs {
    /// Scene file: all its fixed parts, and the moving one where it fits
    pub scene: PathBuf,
    /// Folder for the ways, one CSV per step, and order.json; made if absent
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Most parts that are moved together
    #[arg(long, default_value_t = 3, value_name = "N")]
    pub group: usize,
    /// Overlaps up to this depth count as contact, in the scene's unit [default: a thousandth of the
    /// radius of what is moved]
    #[arg(long, value_name = "T")]
    pub tolerance: Option<f64>,
    /// Largest motion of any point from one pose to the next, in the scene's unit [default: a
    /// thirtieth of the radius of what is moved]
    #[arg(long, value_name = "D")]
    pub step: Option<f64>,
    /// Give up on one part or group after so many seconds
    #[arg(long, default_value_t = 60.0)]
    pub seconds: f64,
    /// Go on where a disassembly of the same parts ended that was stopped or left parts undecided: what
    /// it has tried is read from FILE, and written there if this one is not decided either
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
    /// Go on if parts overlap where they are assembled
    #[arg(long)]
    pub allow_overlap: bool,
    /// Write a page that plays all steps one after the other; it needs no other file
    #[arg(long, value_name = "PAGE.html")]
    pub html: Option<PathBuf>,
}
