//! Arguments of the command line.

pub(crate) mod device_choice;
mod examples;
pub(crate) mod global;

use std::net::IpAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use clap_complete::Shell;
use sdf_grid::LengthUnit;
use sdf_grid::mesh_io::ReadOptions;

use crate::args::device_choice::DeviceChoice;
use crate::args::global::Global;

/// Assembly forces from two meshes: density fields, FFT docking, tables and a haptic loop.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100, after_help = AFTER)]
pub(crate) struct Arguments {
    /// What every command understands.
    #[command(flatten)]
    pub(crate) global: Global,
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

const AFTER: &str = concat!(
    "Exit codes: 0 success, 1 failure, 2 unusable arguments or input, 3 unusable mesh (check), ",
    "4 damaged table (table), 130 interrupted.\n",
    "PEGFIT_LOG chooses what -v prints, as in PEGFIT_LOG=fft_correlate=debug; NO_COLOR=1 means ",
    "--color never.\n\nManual: ",
    env!("CARGO_PKG_REPOSITORY")
);

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run everything on three pegs and holes, with pictures and a page that explains them
    #[command(after_help = examples::DEMO)]
    Demo(DemoArgs),
    /// Check whether meshes, or those of a scene, can be used, and print what had to be repaired
    #[command(after_help = examples::CHECK)]
    Check(CheckArgs),
    /// Make a scene of a file of solids (STEP, 3MF, glTF, ...) or of a robot (URDF, MJCF)
    #[command(after_help = examples::SCENE)]
    Scene(SceneArgs),
    /// Compute the density field of one mesh and write it for ParaView
    #[command(after_help = examples::FIELD)]
    Field(FieldArgs),
    /// Tabulate a scene's energy over its whole domain
    #[command(after_help = examples::BAKE)]
    Bake(BakeArgs),
    /// Print a table's contents, size and stated error
    #[command(after_help = examples::TABLE)]
    Table(TableArgs),
    /// Measure a table's error at fresh poses and compare it with the stated one
    #[command(after_help = examples::VERIFY)]
    Verify(VerifyArgs),
    /// Score, energy, force and torque at listed poses
    #[command(after_help = examples::SCORE)]
    Score(ScoreArgs),
    /// Search a scene's whole domain for the best poses
    #[command(after_help = examples::DOCK)]
    Dock(DockArgs),
    /// Dock every part of a library on one part: which fit, where, and how well
    #[command(after_help = examples::SCREEN)]
    Screen(ScreenArgs),
    /// Find an insertion path to the fit, with the forces along it, or prove that there is none
    #[command(after_help = examples::PATH)]
    Path(PathArgs),
    /// Find the order in which the parts of a scene come apart, with a removal path for each
    #[command(after_help = examples::DISASSEMBLE)]
    Disassemble(DisassembleArgs),
    /// Put loose parts together: which part belongs to which, where, and in which order
    #[command(after_help = examples::ASSEMBLE)]
    Assemble(AssembleArgs),
    /// Run the 1 kHz loop on a page, with the mouse as operator and the forces shown
    #[command(after_help = examples::PLAY)]
    Play(PlayArgs),
    /// Run the 1 kHz haptic loop
    #[command(after_help = examples::FEEL)]
    Feel(FeelArgs),
    /// List the haptic devices attached and what each can do
    #[command(after_help = examples::DEVICES)]
    Devices(DevicesArgs),
    /// Draw one of the paper's figures for a scene
    #[command(after_help = examples::PLOT)]
    Plot(PlotArgs),
    /// Print a shell's completions of these commands
    #[command(after_help = examples::COMPLETIONS)]
    Completions(CompletionsArgs),
    /// Write the manual pages of these commands into a folder
    #[command(after_help = examples::MAN)]
    Man(ManArgs),
}

/// Arguments of `pegfit demo`.
#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Folder to write to; made if absent
    #[arg(long, default_value = "pegfit-demo")]
    pub(crate) out: PathBuf,
}

/// Arguments of `pegfit check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// Mesh files: OBJ, STL, PLY, glTF, 3MF or STEP; or scene files, whose meshes are checked as
    /// the scene reads them
    #[arg(required = true)]
    pub(crate) meshes: Vec<PathBuf>,
    /// Length unit of files that state none: m, cm, mm, um, inch or foot; a scene states its own
    #[arg(long, default_value = "mm")]
    pub(crate) unit: LengthUnit,
    /// What is read of the files.
    #[command(flatten)]
    pub(crate) choice: MeshChoice,
}

/// How a file of solids is read.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct ReadChoice {
    /// STEP: edges around a full turn of a curved face, 6 to 1000
    #[arg(long, default_value_t = 64, value_name = "N")]
    pub(crate) segments_per_turn: u32,
    /// STEP: processor time after which a converter is stopped
    #[arg(long, default_value_t = 120, value_name = "SECONDS",
          value_parser = clap::value_parser!(u64).range(1..=86400))]
    pub(crate) step_time_limit: u64,
    /// Leave out what changes a solid and cannot be read (negative parts of slicers, beam lattices,
    /// free-form surfaces), instead of refusing it; what is left out is listed
    #[arg(long)]
    pub(crate) lossy: bool,
}

/// What is read of a mesh file.
#[derive(Debug, Clone, PartialEq, Args)]
pub(crate) struct MeshChoice {
    /// Use only this solid of the file, by its name or its number as `pegfit check` lists them
    #[arg(long, value_name = "NAME")]
    pub(crate) solid: Option<String>,
    /// How it is read.
    #[command(flatten)]
    pub(crate) reading: ReadChoice,
}

impl MeshChoice {
    /// The same for the reading library, with the unit of files that state none.
    pub(crate) fn options(&self, unit: LengthUnit) -> ReadOptions {
        let reading = &self.reading;
        let limit = Duration::from_secs(reading.step_time_limit);
        ReadOptions::choosing(unit, self.solid.clone(), reading.segments_per_turn)
            .within(limit, reading.lossy)
    }
}

/// Arguments of `pegfit field`.
#[derive(Debug, Args)]
pub(crate) struct FieldArgs {
    /// Mesh file: OBJ, STL, PLY, glTF, 3MF or STEP
    pub(crate) mesh: PathBuf,
    /// Length unit of the lengths below, and of the file unless it states its own: m, cm, mm, um,
    /// inch or foot
    #[arg(long, default_value = "mm")]
    pub(crate) unit: LengthUnit,
    /// What is read of the file.
    #[command(flatten)]
    pub(crate) choice: MeshChoice,
    /// Distance between lattice nodes [default: the longest side / 48]
    #[arg(long)]
    pub(crate) spacing: Option<f64>,
    /// Lattice margin around the mesh [default: a quarter of the longest side]
    #[arg(long)]
    pub(crate) margin: Option<f64>,
    /// Kernel thickness, 0.03 to 0.5
    #[arg(long, default_value_t = 0.1)]
    pub(crate) sigma: f64,
    /// Relative L2 error allowed, 1e-5 to 1e-2
    #[arg(long, default_value_t = 1e-3)]
    pub(crate) tolerance: f64,
    /// VTK image file to write
    #[arg(short, long, value_name = "FIELD.vti")]
    pub(crate) output: Option<PathBuf>,
    /// Plane of the picture, such as y=0, in the length unit
    #[arg(long, value_name = "AXIS=VALUE")]
    pub(crate) slice: Option<String>,
    /// Picture of the slice to write
    #[arg(long, value_name = "P.png")]
    pub(crate) png: Option<PathBuf>,
    /// Picture of the skeleton in space to write: nodes where the density is high
    #[arg(long, value_name = "P.png")]
    pub(crate) skeleton: Option<PathBuf>,
}

/// A scene with one fixed part.
#[derive(Debug, Args)]
pub(crate) struct SceneChoice {
    /// Scene file
    #[arg(value_name = "SCENE")]
    pub(crate) file: PathBuf,
    /// Name of the fixed part, in a scene with several
    #[arg(long, value_name = "NAME")]
    pub(crate) fixed: Option<String>,
}

/// Arguments of `pegfit bake`.
#[derive(Debug, Args)]
pub(crate) struct BakeArgs {
    /// The scene.
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Table to write, a Zarr folder; or its URL (file://, and with the cargo feature `cloud` s3://,
    /// gs://, http://, https://)
    #[arg(short, long, value_name = "TABLE.zarr")]
    pub(crate) output: PathBuf,
    /// Continue a table that was interrupted
    #[arg(long)]
    pub(crate) resume: bool,
    /// Which of --size workers this is, from 0 [default: from the launcher's environment]
    #[arg(long, value_name = "R")]
    pub(crate) rank: Option<usize>,
    /// How many workers share the table
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<usize>,
    /// Only print how much of the table is there
    #[arg(long)]
    pub(crate) status: bool,
    /// Choose lattice and rotation step so that the rms errors of force and torque are at most this
    /// share of the rms of either, such as 5% or 0.05
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub(crate) tolerance: Option<f64>,
    /// How energies are stored: always in half precision
    #[arg(long, hide = true, value_parser = float16)]
    pub(crate) numbers: Option<String>,
    /// Leave out bricks of 8 x 8 x 8 displacements in which no energy differs from the far one by
    /// more than this share of the largest; 0 keeps all
    #[arg(long, value_name = "SHARE", default_value = "0.0005", value_parser = share)]
    pub(crate) leave_out: f64,
    /// Held-out poses at which the error of the finished table is measured [default: 1000, or 300
    /// with --tolerance, as the reference takes eight times as long on half the spacing]
    #[arg(long, value_name = "N")]
    pub(crate) poses: Option<usize>,
}

/// The only kind of stored numbers, of which there were others before.
fn float16(text: &str) -> Result<String, String> {
    match text {
        "float16" => Ok(text.into()),
        _ => Err(
            "tables hold float16 only, which is as accurate as int16; leave --numbers out".into(),
        ),
    }
}

/// A share written as `0.05` or `5%`.
fn share(text: &str) -> Result<f64, String> {
    let number = |t: &str| t.trim().parse::<f64>().map_err(|e| e.to_string());
    let found = match text.strip_suffix('%') {
        Some(percent) => number(percent)? / 100.0,
        None => number(text)?,
    };
    match (0.0..=1.0).contains(&found) {
        true => Ok(found),
        false => Err("expected 0 to 1, or 0% to 100%".into()),
    }
}

/// Arguments of `pegfit table`.
#[derive(Debug, Args)]
pub(crate) struct TableArgs {
    /// Table, a Zarr folder
    #[arg(value_name = "TABLE.zarr")]
    pub(crate) table: PathBuf,
}

/// Arguments of `pegfit verify`.
#[derive(Debug, Args)]
pub(crate) struct VerifyArgs {
    /// Table, a Zarr folder
    #[arg(value_name = "TABLE.zarr")]
    pub(crate) table: PathBuf,
    /// The scene it was baked from
    #[arg(long, value_name = "SCENE.toml")]
    pub(crate) scene: PathBuf,
    /// Name of the fixed part, in a scene with several
    #[arg(long, value_name = "NAME")]
    pub(crate) fixed: Option<String>,
    /// Seed of the poses [default: one more than that of the table's own measurement]
    #[arg(long)]
    pub(crate) seed: Option<u64>,
    /// How many poses
    #[arg(long, default_value_t = 1000, value_name = "N")]
    pub(crate) poses: usize,
    /// How much more than stated is still accepted, as a share of it: 0.5 allows half as much again
    #[arg(long, default_value = "0.5", value_parser = share)]
    pub(crate) margin: f64,
}

/// Arguments of `pegfit score`.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("source").required(true).args(["scene", "table"]))]
pub(crate) struct ScoreArgs {
    /// Evaluate directly, from this scene's meshes
    #[arg(long, value_name = "SCENE.toml")]
    pub(crate) scene: Option<PathBuf>,
    /// Interpolate this table
    #[arg(long, value_name = "TABLE.zarr")]
    pub(crate) table: Option<PathBuf>,
    /// Name of the fixed part, in a scene with several
    #[arg(long, value_name = "NAME", conflicts_with = "table")]
    pub(crate) fixed: Option<String>,
    /// Poses: columns x,y,z,qx,qy,qz,qw in metres, any order; - is standard input
    #[arg(long, value_name = "IN.csv")]
    pub(crate) poses: PathBuf,
    /// Choose the lattice so that the rms errors of force and torque at these poses (200 of the first
    /// 16384) are at most this share of the rms of either, such as 5% or 0.05
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "table")]
    pub(crate) tolerance: Option<f64>,
    /// Add a column with the score's condition number, the sum of its absolute terms over itself;
    /// some hundred times slower
    #[arg(long, conflicts_with = "table")]
    pub(crate) condition: bool,
    /// Scores; - is standard output
    #[arg(short, long, value_name = "OUT.csv", default_value = "-")]
    pub(crate) output: PathBuf,
}

/// Arguments of `pegfit dock`.
#[derive(Debug, Args)]
pub(crate) struct DockArgs {
    /// The scene.
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// How many poses to keep
    #[arg(long, default_value_t = 10, value_name = "K")]
    pub(crate) top: usize,
    /// Poses found, best first; - is standard output
    #[arg(short, long, value_name = "OUT.csv", default_value = "-")]
    pub(crate) output: PathBuf,
    /// Report to write: poses, model, rotations, times
    #[arg(long, value_name = "REPORT.json")]
    pub(crate) report: Option<PathBuf>,
    /// Rank poses by how contact holds the part, or by energy
    #[arg(long, value_enum, default_value_t = RankChoice::Contact, value_name = "BY")]
    pub(crate) rank: RankChoice,
    /// Only poses near this one, x,y,z,qx,qy,qz,qw in metres: within a quarter of the moving part's
    /// size and 30 degrees
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pub(crate) near: Option<String>,
    /// The moving part turns about this axis of the scene: a point in metres and a direction,
    /// px,py,pz,dx,dy,dz
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true)]
    pub(crate) axis: Option<String>,
    /// Parts that are there already, in the scene's frame and unit: the moving part may touch them but
    /// does not overlap them
    #[arg(long, value_name = "PART", num_args = 1..)]
    pub(crate) keep_apart: Vec<PathBuf>,
    /// Keep scored rotations of a search by energy in this file, and continue from it if it exists
    #[arg(long, value_name = "STATE.json")]
    pub(crate) state: Option<PathBuf>,
    /// Search by energy: score every rotation, not only those that a coarse screening on twice the
    /// spacing chooses
    #[arg(long)]
    pub(crate) exhaustive: bool,
    /// Faces at most this far apart count as mating, in the scene's unit [default: 4 % of the moving
    /// part's root mean square radius]
    #[arg(long, value_name = "C")]
    pub(crate) mating_clearance: Option<f64>,
    /// Write the best pose as a robot description with its joint; meshes FILE-fixed.obj and
    /// FILE-moving.obj appear beside it
    #[arg(long, value_name = "FILE.urdf")]
    pub(crate) urdf: Option<PathBuf>,
    /// Write the best pose as a MuJoCo model with its joint, with meshes beside it as well
    #[arg(long, value_name = "FILE.xml")]
    pub(crate) mjcf: Option<PathBuf>,
    /// Write the mates of the best pose for CAD: the faces that lie on each other, and the joint;
    /// with meshes beside it as well
    #[arg(long, value_name = "FILE.json")]
    pub(crate) mates: Option<PathBuf>,
}

/// What ranks docked poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum RankChoice {
    /// How contact holds the part: the information of contact, less what interpenetrates
    Contact,
    /// The energy, lowest first
    Energy,
}

/// Arguments of `pegfit feel`.
#[derive(Debug, Args)]
pub(crate) struct FeelArgs {
    /// Scene file
    pub(crate) scene: PathBuf,
    /// Interpolate this table instead of evaluating directly
    #[arg(long, value_name = "TABLE.zarr")]
    pub(crate) table: Option<PathBuf>,
    /// Operator that holds the moving part: simulated, auto, replay:LOG.csv, openhaptics, force-dimension,
    /// haply, pid or spacemouse (the last five with :PATH, :NAME, :SERIAL or :VENDOR:PRODUCT to
    /// choose among several; see `pegfit devices`)
    #[arg(long, value_name = "DEVICE", default_value = "simulated")]
    pub(crate) device: DeviceChoice,
    /// What the simulated operator does
    #[arg(long, value_enum, default_value_t = ScriptChoice::Snap)]
    pub(crate) script: ScriptChoice,
    /// Keep the part on the motions that a joint leaves free: that of the first pose in a report of
    /// `pegfit dock --report`
    #[arg(long, value_name = "REPORT.json")]
    pub(crate) joint: Option<PathBuf>,
    /// How long, seconds [default: 5, or as long as the log that is replayed]
    #[arg(long)]
    pub(crate) seconds: Option<f64>,
    /// Write every tick; .csv or .parquet, and beside it what the device is, for a replay
    #[arg(long, value_name = "LOG.csv")]
    pub(crate) log: Option<PathBuf>,
    /// Draw force against time
    #[arg(long, value_name = "P.png")]
    pub(crate) png: Option<PathBuf>,
    /// Write a page with force, energy bookkeeping, rate, histograms and events
    #[arg(long, value_name = "R.html")]
    pub(crate) report: Option<PathBuf>,
}

/// Arguments of `pegfit play`.
#[derive(Debug, Args)]
pub(crate) struct PlayArgs {
    /// Scene file [default: the paper's three pairs, to choose among on the page]
    pub(crate) scene: Option<PathBuf>,
    /// Interpolate this table instead of evaluating directly
    #[arg(long, value_name = "TABLE.zarr", requires = "scene")]
    pub(crate) table: Option<PathBuf>,
    /// A path in that the operator can follow, as `pegfit path -o` writes it
    // `--way` was its name.
    #[arg(long, alias = "way", value_name = "PATH.csv", requires = "scene")]
    pub(crate) path: Option<PathBuf>,
    /// Keep the part on the motions that a joint leaves free: that of the first pose in a report of
    /// `pegfit dock --report`
    #[arg(long, value_name = "REPORT.json", requires = "scene")]
    pub(crate) joint: Option<PathBuf>,
    /// Only print the page's address
    #[arg(long)]
    pub(crate) no_open: bool,
    /// Port to listen on [default: one that is free]
    #[arg(long, default_value_t = 0, hide_default_value = true)]
    pub(crate) port: u16,
    /// Address to listen on; any other than 127.0.0.1 lets others of a network in that have the
    /// page's whole address, unencrypted
    #[arg(long, value_name = "IP", default_value = "127.0.0.1")]
    pub(crate) bind: IpAddr,
    /// Let pages of this machine, as a notebook's, show the page in a frame
    #[arg(long)]
    pub(crate) embed: bool,
}

/// Arguments of `pegfit devices`.
#[derive(Debug, Args)]
pub(crate) struct DevicesArgs {
    /// Show a device's axes and buttons as they move, until Ctrl-C
    #[arg(long)]
    pub(crate) probe: bool,
    /// Which one to probe, as listed: a path such as haply:049D, a serial number or VENDOR:PRODUCT
    /// [default: the first]
    #[arg(value_name = "DEVICE", requires = "probe")]
    pub(crate) device: Option<String>,
    /// Stop probing after so many seconds
    #[arg(long, requires = "probe")]
    pub(crate) seconds: Option<f64>,
}

/// Scripts of the simulated operator, after the paper's two tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ScriptChoice {
    /// Push the part into the rim beside the fit.
    Collision,
    /// Bring the part near the fit and let go.
    Snap,
    /// Hold the part and let the forces move it.
    Free,
}

/// Arguments of `pegfit plot`.
#[derive(Debug, Args)]
pub(crate) struct PlotArgs {
    /// Which figure
    #[arg(value_enum)]
    pub(crate) kind: PlotKind,
    /// The scene.
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Picture to write (not for `well`, which prints numbers)
    #[arg(short, long, value_name = "P.png")]
    pub(crate) output: Option<PathBuf>,
    /// Plane of a slice, such as y=0, in the scene's unit [default: y through the fit]
    #[arg(long, value_name = "AXIS=VALUE")]
    pub(crate) slice: Option<String>,
    /// The two translations of a score surface, such as xz, or the motion of a curve: x, y, z for
    /// translations, rx, ry, rz for rotations
    #[arg(long)]
    pub(crate) along: Option<String>,
}

/// The paper's figures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum PlotKind {
    /// Both parts' densities on a plane (figures 4b, 4c)
    Density,
    /// The product of the densities at the assembled pose (figure 4d)
    Overlap,
    /// The score over two translations (figure 5)
    Score,
    /// The energy along one translation or rotation (figure 6)
    Energy,
    /// Force against time in the collision and snap tests (figure 7)
    Force,
    /// Depth, stiffness, diameter and barriers of the well, in numbers
    Well,
}

/// Arguments of `pegfit screen`.
#[derive(Debug, Args)]
pub(crate) struct ScreenArgs {
    /// Part that stays, a mesh file: OBJ, STL, PLY, glTF, 3MF or STEP
    pub(crate) fixed: PathBuf,
    /// Folder of the parts to try, with the folders in it: files of the same formats, each one part
    #[arg(long, value_name = "FOLDER")]
    pub(crate) library: PathBuf,
    /// Table to write, a row for each part, the best first; .parquet with the cargo feature
    /// `parquet`. Rows are kept in OUT.csv.rows/ on the way
    #[arg(short, long, value_name = "OUT.csv", default_value = "screen.csv")]
    pub(crate) output: PathBuf,
    /// Keep the rows of an earlier run that are of the same parts and options
    #[arg(long)]
    pub(crate) resume: bool,
    /// Which of --size workers this is, from 0 [default: from the launcher's environment]
    #[arg(long, value_name = "R")]
    pub(crate) rank: Option<usize>,
    /// How many workers share the library
    #[arg(long, value_name = "N")]
    pub(crate) size: Option<usize>,
    /// Only print how much of the library is there
    #[arg(long)]
    pub(crate) status: bool,
    /// Each solid of each file of the library is a part
    #[arg(long)]
    pub(crate) solids: bool,
    /// Parts that are there already, in the fixed part's frame: the others may touch them but do not
    /// overlap them
    #[arg(long, value_name = "PART", num_args = 1..)]
    pub(crate) keep_apart: Vec<PathBuf>,
    /// Faces at most this far apart count as mating, in the unit of --unit [default: 4 % of each
    /// part's root mean square radius]
    #[arg(long, value_name = "C")]
    pub(crate) mating_clearance: Option<f64>,
    /// Length unit of files that state none: m, cm, mm, um, inch or foot
    #[arg(long, default_value = "mm")]
    pub(crate) unit: LengthUnit,
    /// What is read of the fixed part, and how files are read.
    #[command(flatten)]
    pub(crate) choice: MeshChoice,
}

/// Arguments of `pegfit path`.
#[derive(Debug, Args)]
pub(crate) struct PathArgs {
    /// The scene.
    #[command(flatten)]
    pub(crate) scene: SceneChoice,
    /// Goal of the path: `fit` (the scene's), `best` (docks first), or a pose
    /// x,y,z,qx,qy,qz,qw in metres
    #[arg(
        long,
        value_name = "POSE",
        default_value = "fit",
        allow_hyphen_values = true
    )]
    pub(crate) to: String,
    /// Start of the path: `outside`, or a pose x,y,z,qx,qy,qz,qw in metres
    #[arg(
        long,
        value_name = "POSE",
        default_value = "outside",
        allow_hyphen_values = true
    )]
    pub(crate) from: String,
    /// Poses along the path, with energy, force, torque and overlap; - is standard output
    #[arg(short, long, value_name = "PATH.csv")]
    pub(crate) output: Option<PathBuf>,
    /// Overlaps up to this depth count as contact, in the scene's unit [default: a thousandth of the
    /// moving part's radius]
    #[arg(long, value_name = "T")]
    pub(crate) tolerance: Option<f64>,
    /// Largest motion of any point of the part from one pose to the next, in the scene's unit
    /// [default: a thirtieth of its radius]
    #[arg(long, value_name = "D")]
    pub(crate) step: Option<f64>,
    /// Give up after so many seconds of searching
    #[arg(long, default_value_t = 60.0)]
    pub(crate) seconds: f64,
    /// Continue a search for the same path that ran out of time or was stopped: its visited poses are
    /// read from FILE, and written there if this search is not decided either
    #[arg(long, value_name = "FILE")]
    pub(crate) resume: Option<PathBuf>,
    /// Continue if the parts overlap at the goal or at the start
    #[arg(long)]
    pub(crate) allow_overlap: bool,
    /// Use the solids only: no fields, no energies, no forces
    #[arg(long)]
    pub(crate) solids_only: bool,
    /// Draw energy and force along the path
    #[arg(long, value_name = "P.png", conflicts_with = "solids_only")]
    pub(crate) png: Option<PathBuf>,
    /// Write a page that plays the path: both parts, energy and force; it needs no other file
    #[arg(long, value_name = "PAGE.html")]
    pub(crate) html: Option<PathBuf>,
}

/// Arguments of `pegfit disassemble`.
#[derive(Debug, Args)]
pub(crate) struct DisassembleArgs {
    /// Scene file: all its fixed parts, and the moving one where it fits
    pub(crate) scene: PathBuf,
    /// Folder for the paths, one CSV per step, and order.json; made if absent
    #[arg(short, long, value_name = "DIR")]
    pub(crate) output: Option<PathBuf>,
    /// Most parts that are moved together
    #[arg(long, default_value_t = 3, value_name = "N")]
    pub(crate) group: usize,
    /// Overlaps up to this depth count as contact, in the scene's unit [default: a thousandth of the
    /// radius of what is moved]
    #[arg(long, value_name = "T")]
    pub(crate) tolerance: Option<f64>,
    /// Largest motion of any point from one pose to the next, in the scene's unit [default: a
    /// thirtieth of the radius of what is moved]
    #[arg(long, value_name = "D")]
    pub(crate) step: Option<f64>,
    /// Give up on one part or group after so many seconds
    #[arg(long, default_value_t = 60.0)]
    pub(crate) seconds: f64,
    /// Continue a disassembly of the same parts that was stopped or left parts undecided: its attempts
    /// are read from FILE, and written there if this one is not decided either
    #[arg(long, value_name = "FILE")]
    pub(crate) resume: Option<PathBuf>,
    /// Continue if parts overlap where they are assembled
    #[arg(long)]
    pub(crate) allow_overlap: bool,
    /// Write a page that plays all steps one after the other; it needs no other file
    #[arg(long, value_name = "PAGE.html")]
    pub(crate) html: Option<PathBuf>,
}

/// Arguments of `pegfit assemble`.
#[derive(Debug, Args)]
pub(crate) struct AssembleArgs {
    /// Mesh files (OBJ, STL, PLY, glTF, 3MF, STEP), or folders of such files: each file is a part; of
    /// a single file each solid is one. Where they lie does not matter
    #[arg(required = true)]
    pub(crate) parts: Vec<PathBuf>,
    /// Scene file to write, with all parts in their places; their meshes go into a folder beside it
    #[arg(
        short,
        long,
        value_name = "SCENE.toml",
        default_value = "assembly.toml"
    )]
    pub(crate) output: PathBuf,
    /// Report for programs: places, mates, order, other assemblies, what was tried [default: SCENE
    /// with the ending .json]
    #[arg(long, value_name = "FILE.json")]
    pub(crate) report: Option<PathBuf>,
    /// Write a page that puts the parts together step by step; it needs no other file
    #[arg(long, value_name = "PAGE.html")]
    pub(crate) html: Option<PathBuf>,
    /// Write the assembly as GLB (binary glTF), a node for each part, for viewers
    #[arg(long, value_name = "FILE.glb")]
    pub(crate) glb: Option<PathBuf>,
    /// The same with the parts pushed apart along the ways on which they are taken off
    #[arg(long, value_name = "FILE.glb")]
    pub(crate) exploded: Option<PathBuf>,
    /// Write the assembly as a robot description with the joints of its mates; meshes FILE-PART.obj
    /// appear beside it
    #[arg(long, value_name = "FILE.urdf")]
    pub(crate) urdf: Option<PathBuf>,
    /// Write the assembly as a MuJoCo model with the joints of its mates, with meshes beside it as well
    #[arg(long, value_name = "FILE.xml")]
    pub(crate) mjcf: Option<PathBuf>,
    /// Each solid of each file is a part
    #[arg(long)]
    pub(crate) solids: bool,
    /// Part whose own frame is that of the assembly [default: the largest that is placed]
    #[arg(long, value_name = "PART")]
    pub(crate) fix: Option<String>,
    /// Part whose place is known, in the frame of the assembly; may be repeated: x,y,z in metres and
    /// a quaternion qx,qy,qz,qw
    #[arg(long, value_name = "PART=POSE")]
    pub(crate) place: Vec<String>,
    /// Use only this part; may be repeated [default: all parts]
    #[arg(long, value_name = "PART")]
    pub(crate) only: Vec<String>,
    /// Faces at most so far apart count as mating, in the unit of --unit [default: 4 % of each part's
    /// size]
    #[arg(long, value_name = "C")]
    pub(crate) mating_clearance: Option<f64>,
    /// Subassemblies of the same parts that are kept at a time
    #[arg(long, default_value_t = 4, value_name = "N")]
    pub(crate) beam: usize,
    /// Keep what is found in FILE, and go on from what a search of the same parts found that was
    /// stopped or had a narrower beam
    #[arg(long, value_name = "FILE")]
    pub(crate) resume: Option<PathBuf>,
    /// Assemblies to report
    #[arg(long, default_value_t = 3, value_name = "N")]
    pub(crate) top: usize,
    /// Give up on taking off one part or group after so many seconds; 0 does not take assemblies apart
    #[arg(long, default_value_t = 10.0)]
    pub(crate) seconds: f64,
    /// Length unit of files that state none: m, cm, mm, um, inch or foot
    #[arg(long, default_value = "mm")]
    pub(crate) unit: LengthUnit,
    /// How files are read.
    #[command(flatten)]
    pub(crate) reading: ReadChoice,
}

/// Arguments of `pegfit scene`.
#[derive(Debug, Args)]
pub(crate) struct SceneArgs {
    /// File of several solids (STEP, 3MF, glTF, OBJ, STL), or a robot's description (URDF, MJCF)
    pub(crate) file: PathBuf,
    /// What moves: a solid, link or body by its name or number; more than once if several move
    /// together [default: none: only list what there is]
    #[arg(long, value_name = "NAME")]
    pub(crate) moving: Vec<String>,
    /// What stays [default: all others that are in reach]
    #[arg(long, value_name = "NAME", requires = "moving")]
    pub(crate) fixed: Vec<String>,
    /// Scene file to write; meshes that it needs go into a folder beside it
    #[arg(short, long, value_name = "SCENE.toml", requires = "moving")]
    pub(crate) output: Option<PathBuf>,
    /// Each solid that stays is a part of its own; else they are one
    #[arg(long)]
    pub(crate) separate: bool,
    /// Length unit of OBJ and STL files: m, cm, mm, um, inch or foot
    #[arg(long, default_value = "mm")]
    pub(crate) unit: LengthUnit,
    /// How it is read.
    #[command(flatten)]
    pub(crate) reading: ReadChoice,
    /// URDF, MJCF: of links that have both, the shapes to look at instead of those to collide with
    #[arg(long)]
    pub(crate) visual: bool,
}

/// Arguments of `pegfit completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub(crate) shell: Shell,
}

/// Arguments of `pegfit man`.
#[derive(Debug, Args)]
pub(crate) struct ManArgs {
    /// The folder, which must exist
    pub(crate) folder: PathBuf,
}
