//! Why a scene cannot be used.

use std::ops::Range;
use std::path::{Path, PathBuf};

use fft_correlate::tolerance::Limit;
use fft_correlate::{
    CorrelateError, DirectError, DockingError, EnergyScaleError, PairBuildError, RotationError,
    StoreError, TableError, TileError, WellError,
};
use haptic::scene::LiveSceneError;
use sdf_grid::provenance::Difference;
use sdf_grid::{LatticeError, LengthUnit, MeshError};

/// Why a scene cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The scene file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The scene file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A line of the scene file is not acceptable.
    #[error(transparent)]
    Line(Box<LineError>),
    /// The scene has several fixed parts and none was named, or none of that name.
    #[error(
        "{}: fixed: expected {}, found {found}",
        path.display(),
        wanted.as_ref().map_or("the name of one part".to_owned(), |w| format!("a part called `{w}`"))
    )]
    FixedPart {
        /// The scene file.
        path: PathBuf,
        /// The name given.
        wanted: Option<String>,
        /// The names there are.
        found: String,
    },
    /// A mesh file cannot be used.
    #[error(transparent)]
    Mesh(Box<MeshError>),
    /// A part lies between the nodes of its lattice.
    #[error(
        "{}: {part} part {name}: expected at least a lattice cell of {:.4} {unit} across, found \
         {:.3e} {unit}: is it in {unit}?",
        path.display(), spacing / unit.in_metres(), size / unit.in_metres()
    )]
    TooSmall {
        /// The scene file.
        path: PathBuf,
        /// `fixed` or `moving`.
        part: &'static str,
        /// The part's name.
        name: String,
        /// Its largest extent, metres.
        size: f64,
        /// The lattice spacing, metres.
        spacing: f64,
        /// The scene's unit.
        unit: LengthUnit,
    },
    /// A computation would need more memory than is allowed.
    #[error("{}: {what} needs {needed} bytes, expected at most {limit}", path.display())]
    Memory {
        /// The scene file.
        path: PathBuf,
        /// `the density fields` or `the correlation`.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// The pairs in reach at the start need more than the scene lets them take.
    #[error(
        "{}: loading.memory_mib: expected at least {:.1} for {pairs}, found {:.1}",
        path.display(), mebibytes(*needed), mebibytes(*budget)
    )]
    Loading {
        /// The scene file.
        path: PathBuf,
        /// Names of the fixed parts.
        pairs: String,
        /// Bytes that they need together.
        needed: u64,
        /// Bytes that they may take.
        budget: u64,
    },
    /// A table was baked from other parts, another model or other fields.
    #[error(
        "{}: {}: expected that of the table {}, {}, found {}",
        path.display(), difference.key, table.display(), difference.stored, difference.given
    )]
    OtherTable {
        /// The scene file.
        path: PathBuf,
        /// The table.
        table: PathBuf,
        /// What differs first.
        difference: Difference,
    },
    /// No table of the scene meets the tolerance that was asked for.
    #[error(
        "{}: errors of force and torque of {asked} of the rms asked for, {reached} reached: {limit}",
        path.display()
    )]
    Tolerance {
        /// The scene file.
        path: PathBuf,
        /// Share of the rms force.
        asked: f64,
        /// The least share found.
        reached: f64,
        /// Why there is no finer table.
        limit: Limit,
    },
    /// A library refuses what a part of the scene asks for.
    #[error("{}", subject(path, item))]
    Refused {
        /// The scene file.
        path: PathBuf,
        /// The key or the work, if it is known; empty otherwise.
        item: &'static str,
        /// Why.
        source: Box<Refusal>,
    },
    /// A table cannot be opened or read.
    #[error("table")]
    Table(#[source] Box<StoreError>),
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// What the libraries refuse.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The rotations are none, or too many.
    #[error(transparent)]
    Rotations(#[from] RotationError),
    /// The fields cannot be had.
    #[error(transparent)]
    Fields(#[from] PairBuildError),
    /// The energy scale cannot be had.
    #[error(transparent)]
    Energy(#[from] EnergyScaleError),
    /// The translations do not make a window.
    #[error(transparent)]
    Window(#[from] LatticeError),
    /// The correlation cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
    /// A part has no interior on its lattice.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// What poses reach cannot be loaded.
    #[error(transparent)]
    Tiles(#[from] TileError),
    /// Docking cannot start or go on.
    #[error(transparent)]
    Docking(#[from] DockingError),
    /// A table in memory cannot be had.
    #[error(transparent)]
    Table(#[from] TableError),
    /// There is no well about the fit.
    #[error(transparent)]
    Well(#[from] WellError),
    /// The scene cannot be kept in memory beside a loop.
    #[error(transparent)]
    Live(#[from] LiveSceneError),
}

/// A line of a scene file that is not acceptable; carries the text so that the line can be shown.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}, line {line}: {message}", path.display())]
pub struct LineError {
    /// The scene file.
    pub path: PathBuf,
    /// Line of the trouble, counted from 1.
    pub line: usize,
    /// What is wrong, with expected and found.
    pub message: String,
    /// The whole scene file.
    pub text: String,
    /// The offending bytes of it.
    pub span: Range<usize>,
}

impl From<MeshError> for SceneError {
    fn from(error: MeshError) -> Self {
        Self::Mesh(Box::new(error))
    }
}

impl From<StoreError> for SceneError {
    fn from(error: StoreError) -> Self {
        Self::Table(Box::new(error))
    }
}

impl SceneError {
    /// `item` of the scene file at `path` is refused.
    pub(crate) fn refused(path: &Path, item: &'static str, source: impl Into<Refusal>) -> Self {
        Self::Refused {
            path: path.to_owned(),
            item,
            source: Box::new(source.into()),
        }
    }
}

fn subject(path: &Path, item: &str) -> String {
    match item {
        "" => path.display().to_string(),
        item => format!("{}: {item}", path.display()),
    }
}

fn mebibytes(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 20)
}
