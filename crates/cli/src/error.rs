//! What can go wrong in a command, and the exit code each case maps to.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use fft_correlate::StoreError;
use miette::{Diagnostic, NamedSource, SourceSpan};
use pegfit_scene::poses::PoseError;
use pegfit_scene::{ImportError, LineError, SceneError};

use crate::memory::display_bytes;

/// Every failure of a command.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum CommandError {
    /// A value in an argument or an input file is not acceptable.
    #[error("{file}: {item}: expected {expected}, found {found}")]
    Input {
        /// The file, or `command line`.
        file: String,
        /// The key, column, row or option.
        item: String,
        /// What would have been accepted.
        expected: String,
        /// What was there.
        found: String,
    },
    /// A line of the scene file is not acceptable.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Line(Box<SceneFileError>),
    /// The scene cannot be used for another reason.
    #[error(transparent)]
    Scene(Box<SceneError>),
    /// No scene can be made of a file.
    #[error(transparent)]
    Import(ImportError),
    /// Rows of poses cannot be read.
    #[error(transparent)]
    Poses(#[from] PoseError),
    /// A mesh file cannot be used.
    #[error(transparent)]
    Mesh(Box<sdf_grid::MeshError>),
    /// The computation would need more memory than the machine has free.
    #[error(
        "{what} needs about {} of memory but only {} can be used: coarsen the lattice, shrink the \
         window, or raise --memory",
        display_bytes(*.needed), display_bytes(*.budget)
    )]
    Memory {
        /// The computation.
        what: String,
        /// Its estimate, bytes.
        needed: u64,
        /// What it may use, bytes.
        budget: u64,
    },
    /// The operating system refused to read or write a file.
    #[error("cannot {action} {}", path.display())]
    Io {
        /// `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// `pegfit check` found unusable meshes; the report has been printed.
    #[error("{count} of {total} meshes cannot be used")]
    UnusableMeshes {
        /// How many.
        count: usize,
        /// Of how many examined.
        total: usize,
    },
    /// `pegfit table` found damaged chunks; the description has been printed.
    #[error("{table}: {count} of {total} rotations are damaged: bake with --resume")]
    DamagedTable {
        /// The table.
        table: String,
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
    },
    /// A library refused or failed for a reason not listed above.
    #[error("{context}")]
    Library {
        /// What was being done, and to which file.
        context: String,
        /// The library's error.
        source: Box<dyn std::error::Error + Send + Sync>,
        /// True if the input is at fault, false if the machine is.
        input: bool,
        /// What to do about it.
        #[help]
        next: Option<String>,
    },
    /// There is no way between two poses to be looked for.
    #[error(transparent)]
    Path(pegfit_path::PathError),
    /// A page could not be served, or the loop not run on it.
    #[error(transparent)]
    Play(#[from] pegfit_play::PlayError),
    /// A picture could not be drawn.
    #[error(transparent)]
    Picture(#[from] pegfit_pictures::PictureError),
    /// No table of the scene meets the tolerance that was asked for.
    #[error(
        "errors of force and torque of {:.3} % asked for, {:.3} % reached: {part} is what cannot be met, {reason}",
        100.0 * asked, 100.0 * reached
    )]
    Tolerance {
        /// `the lattice`, `the rotation step` or `the whole table`.
        part: &'static str,
        /// Share of the rms force.
        asked: f64,
        /// The least share found.
        reached: f64,
        /// At which setting it was found, and why there is no finer one.
        reason: String,
    },
    /// A table is further from the truth than it says.
    #[error(
        "{table}: {count} of 6 errors are beyond what the table states, by more than the margin"
    )]
    Claim {
        /// The table.
        table: String,
        /// How many.
        count: usize,
    },
    /// The user asked to stop.
    #[error("interrupted; finished results are kept")]
    Interrupted,
}

/// What is wrong with a line of a scene file, with the text so that the line can be shown.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{said}")]
pub struct SceneFileError {
    /// File, line, expected and found.
    said: String,
    /// The whole scene file.
    #[source_code]
    text: NamedSource<String>,
    /// The offending bytes.
    #[label("here")]
    span: SourceSpan,
    /// What to do about it.
    #[help]
    next: Option<String>,
}

impl From<LineError> for SceneFileError {
    fn from(error: LineError) -> Self {
        Self {
            said: error.to_string(),
            next: other_file(&error.path),
            text: NamedSource::new(error.path.display().to_string(), visible(&error.text)),
            span: SourceSpan::from(error.span),
        }
    }
}

/// The text with characters of the same lengths in the place of those that would act on a terminal.
fn visible(text: &str) -> String {
    let kept = |c: char| !sdf_grid::text::acts(c) || matches!(c, '\n' | '\r' | '\t');
    let stands_in = |c: char| match (kept(c), c.len_utf8()) {
        (true, _) => c,
        (false, 1) => '?',
        (false, 2) => '¿',
        (false, _) => char::REPLACEMENT_CHARACTER,
    };
    text.chars().map(stands_in).collect()
}

impl From<SceneError> for CommandError {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Read { path, source } => no_scene(&path, source),
            SceneError::Line(e) => Self::Line(Box::new(SceneFileError::from(*e))),
            SceneError::FixedPart {
                path,
                wanted: None,
                found,
            } => Self::input(
                path.display().to_string(),
                "fixed",
                "one part, or --fixed NAME to choose",
                found,
            ),
            SceneError::Mesh(e) => Self::Mesh(e),
            SceneError::Table(e) => Self::table(*e),
            SceneError::Memory {
                path,
                what,
                needed,
                limit,
            } => Self::Memory {
                what: format!("{}: {what}", path.display()),
                needed,
                budget: limit,
            },
            SceneError::Cancelled => Self::Interrupted,
            other => Self::Scene(Box::new(other)),
        }
    }
}

impl From<ImportError> for CommandError {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Read { path, source } => Self::read(&path, source),
            ImportError::Mesh(e) => Self::Mesh(e),
            ImportError::Write(e) => Self::write(&e.path, e.source),
            other => Self::Import(other),
        }
    }
}

impl From<pegfit_path::PathError> for CommandError {
    fn from(error: pegfit_path::PathError) -> Self {
        match error {
            pegfit_path::PathError::Cancelled => Self::Interrupted,
            other => Self::Path(other),
        }
    }
}

impl From<sdf_grid::atomic::AtomicError> for CommandError {
    fn from(error: sdf_grid::atomic::AtomicError) -> Self {
        Self::write(&error.path, error.source)
    }
}

impl From<sdf_grid::MeshError> for CommandError {
    fn from(error: sdf_grid::MeshError) -> Self {
        Self::Mesh(Box::new(error))
    }
}

impl CommandError {
    /// An unacceptable value in `file`.
    pub fn input(
        file: impl Into<String>,
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::Input {
            file: file.into(),
            item: item.into(),
            expected: expected.into(),
            found: found.to_string(),
        }
    }

    /// An unacceptable command-line option.
    pub fn option(
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::input("command line", item, expected, found)
    }

    /// A plane of a slice that cannot be used.
    pub fn slice(error: pegfit_pictures::SliceTextError) -> Self {
        Self::option(
            "--slice",
            pegfit_pictures::SliceTextError::EXPECTED,
            error.found,
        )
    }

    /// A table that cannot be used; where there is none, how to come by one.
    pub fn table(error: StoreError) -> Self {
        let missing = match &error {
            StoreError::Missing { path } => Some(path.display().to_string()),
            _ => None,
        };
        let failed = Self::bad_input("table", error);
        match missing {
            Some(path) => failed.with_next(format!("`pegfit bake SCENE -o {path}` makes one")),
            None => failed,
        }
    }

    /// A file that cannot be read.
    pub fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            action: "read",
            path: path.to_owned(),
            source,
        }
    }

    /// A file that cannot be written.
    pub fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Io {
            action: "write",
            path: path.to_owned(),
            source,
        }
    }

    /// A library error that the input is to blame for.
    pub fn bad_input(
        context: impl Into<String>,
        source: impl std::error::Error + Send + Sync + 'static,
    ) -> Self {
        Self::Library {
            context: context.into(),
            source: Box::new(source),
            input: true,
            next: None,
        }
    }

    /// A library error that is nobody's fault.
    pub fn failure(
        context: impl Into<String>,
        source: impl std::error::Error + Send + Sync + 'static,
    ) -> Self {
        Self::Library {
            context: context.into(),
            source: Box::new(source),
            input: false,
            next: None,
        }
    }

    /// The same with what to do about it, if it is a library's.
    #[must_use]
    pub fn with_next(mut self, advice: impl Into<String>) -> Self {
        if let Self::Library { next, .. } = &mut self {
            *next = Some(advice.into());
        }
        self
    }

    /// Whether whoever was to read what is written went away, as `head` does when it has enough.
    pub fn is_closed_pipe(&self) -> bool {
        let broken = |error: &std::io::Error| error.kind() == std::io::ErrorKind::BrokenPipe;
        match self {
            Self::Io {
                action: "write",
                source,
                ..
            } => broken(source),
            Self::Library { source, .. } => match source.downcast_ref().map(csv::Error::kind) {
                Some(csv::ErrorKind::Io(source)) => broken(source),
                _ => false,
            },
            _ => false,
        }
    }

    /// The exit code of a run that ended with this error.
    pub fn exit(&self) -> Exit {
        match self {
            Self::Input { .. }
            | Self::Line(_)
            | Self::Scene(_)
            | Self::Import(_)
            | Self::Poses(_)
            | Self::Mesh(_)
            | Self::Path(_)
            | Self::Memory { .. } => Exit::BadInput,
            Self::Tolerance { .. } | Self::Claim { .. } => Exit::Failure,
            Self::Library { input: true, .. } => Exit::BadInput,
            // A file that is missing is a wrong argument; one that cannot be written is not.
            Self::Io { action: "read", .. } => Exit::BadInput,
            Self::Io { .. } | Self::Library { .. } | Self::Picture(_) | Self::Play(_) => {
                Exit::Failure
            }
            Self::UnusableMeshes { .. } => Exit::UnusableMesh,
            Self::DamagedTable { .. } => Exit::DamagedTable,
            Self::Interrupted => Exit::Interrupted,
        }
    }
}

/// A scene that cannot be read, and how to come by one.
fn no_scene(path: &Path, source: std::io::Error) -> CommandError {
    let is_missing = source.kind() == std::io::ErrorKind::NotFound;
    let file = path.display();
    let error = CommandError::bad_input(format!("cannot read {file}"), source);
    match (other_file(path), is_missing) {
        (_, true) => error.with_next(format!(
            "`pegfit scene SOLIDS --moving NAME -o {file}` makes a scene of a file of solids; of two \
             meshes it is three lines: unit = \"mm\", fixed = \"hole.stl\", moving = \"peg.stl\""
        )),
        (Some(advice), false) => error.with_next(advice),
        (None, false) => error,
    }
}

/// What to do with a file that is not called as scenes are.
fn other_file(path: &Path) -> Option<String> {
    let is_scene = path.extension().is_some_and(|e| e == "toml");
    let file = path.display();
    (!is_scene).then(|| {
        format!(
            "a scene is a file of its own (scene.toml): `pegfit scene {file}` makes one of solids or \
             a robot"
        )
    })
}

/// How a run of `pegfit` ended, as the shell sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The command did what it was asked to.
    Success = 0,
    /// Something failed that the input cannot be blamed for: a disk, a device, a library.
    Failure = 1,
    /// The arguments, or a file they name, cannot be used: nothing was computed.
    BadInput = 2,
    /// `pegfit check` found a mesh that no other command would accept.
    UnusableMesh = 3,
    /// `pegfit table` found chunks that cannot be read: every command that interpolates the table
    /// would refuse it, `pegfit bake --resume` mends it. Missing chunks are no damage.
    DamagedTable = 4,
    /// Stopped by Ctrl-C or a termination signal; finished results are kept.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
