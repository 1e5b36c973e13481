//! What can go wrong in a command, and the exit code of each case.

use std::error::Error;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use fft_correlate::StoreError;
use pegfit_assemble::AssemblyError;
use pegfit_path::PathError;
use pegfit_pictures::{PictureError, SliceTextError};
use pegfit_play::PlayError;
use pegfit_scene::poses::PoseError;
use pegfit_scene::{ExportError, ImportError, LineError, SceneError, shell_word};
use sdf_grid::MeshError;
use sdf_grid::atomic::AtomicError;

use crate::bytes::display_bytes;

/// A library's error.
type Cause = Box<dyn Error + Send + Sync>;

/// Every failure of a command.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CommandError {
    /// A value in an argument or an input file is not acceptable.
    #[error("{file}: {item}: expected {expected}, found {found}")]
    Input {
        file: String,
        item: String,
        expected: String,
        found: String,
    },
    /// A line of the scene file is not acceptable.
    #[error(transparent)]
    Line(Box<SceneFileError>),
    /// A library refuses the input, in its own words.
    #[error(transparent)]
    Refused(Cause),
    /// A library failed, in its own words: the input is not to blame.
    #[error(transparent)]
    Failed(Cause),
    /// The operating system refused to read or write a file.
    #[error("cannot {action} {}", path.display())]
    Io {
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// The result of the command is bad; a report may have been printed.
    #[error("{0}")]
    Verdict(String, Exit),
    /// A library refused the input, or failed, in a context.
    #[error("{context}")]
    Library {
        context: String,
        source: Cause,
        /// Whether the input is at fault; else the machine is.
        input: bool,
        /// What helps.
        next: Option<String>,
    },
    /// The user asked to stop; what is kept is not known here.
    #[error("interrupted")]
    Interrupted,
    /// The user asked to stop.
    #[error("interrupted: {kept}")]
    Stopped {
        /// What is kept of what was done.
        kept: String,
        /// The command that goes on.
        next: Option<String>,
    },
}

/// What is wrong with a line of a scene file, with the text so that the line can be shown.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub(crate) struct SceneFileError {
    /// File, line, expected and found.
    message: String,
    pub(crate) file: String,
    /// The whole scene file.
    pub(crate) text: String,
    /// The offending bytes.
    pub(crate) span: Range<usize>,
    /// What helps.
    next: Option<String>,
}

impl From<LineError> for SceneFileError {
    fn from(error: LineError) -> Self {
        Self {
            message: error.to_string(),
            next: other_file(&error.path),
            file: error.path.display().to_string(),
            text: visible(&error.text),
            span: error.span,
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
            SceneError::Mesh(e) => (*e).into(),
            SceneError::Table(e) => Self::table(*e),
            SceneError::Memory {
                path,
                what,
                needed,
                limit,
            } => Self::memory(&format!("{}: {what}", path.display()), needed, limit),
            SceneError::Cancelled => Self::Interrupted,
            other => Self::Refused(Box::new(other)),
        }
    }
}

impl From<ImportError> for CommandError {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Read { path, source } => Self::read(&path, source),
            ImportError::Mesh(e) => (*e).into(),
            ImportError::Write(e) => Self::write(&e.path, e.source),
            other => Self::Refused(Box::new(other)),
        }
    }
}

impl From<ExportError> for CommandError {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Write(e) => Self::write(&e.path, e.source),
            ExportError::Mesh(e) => Self::Failed(e),
            other => Self::Refused(Box::new(other)),
        }
    }
}

impl From<PathError> for CommandError {
    fn from(error: PathError) -> Self {
        match error {
            PathError::Cancelled => Self::Interrupted,
            other => Self::Refused(Box::new(other)),
        }
    }
}

impl From<AssemblyError> for CommandError {
    fn from(error: AssemblyError) -> Self {
        match error {
            AssemblyError::Cancelled => Self::Interrupted,
            other => Self::Refused(Box::new(other)),
        }
    }
}

impl From<AtomicError> for CommandError {
    fn from(error: AtomicError) -> Self {
        Self::write(&error.path, error.source)
    }
}

/// Errors that need no word besides their own.
macro_rules! kept {
    ($($error:ty => $kind:ident),*) => {$(
        impl From<$error> for CommandError {
            fn from(error: $error) -> Self {
                Self::$kind(Box::new(error))
            }
        }
    )*};
}
kept!(MeshError => Refused, PoseError => Refused, PictureError => Failed);

impl From<PlayError> for CommandError {
    fn from(error: PlayError) -> Self {
        match error {
            PlayError::Scene(error) => (*error).into(),
            other => Self::Failed(Box::new(other)),
        }
    }
}

impl CommandError {
    /// An unacceptable value in `file`.
    pub(crate) fn input(
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
    pub(crate) fn option(
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::input("command line", item, expected, found)
    }

    /// The user asked to stop a command that has kept something and does not go on.
    pub(crate) fn stopped(kept: impl Into<String>) -> Self {
        let kept = kept.into();
        Self::Stopped { kept, next: None }
    }

    /// Words of a command line that cannot be used.
    pub(crate) fn usage(said: &clap::Error) -> Self {
        let text = said.to_string();
        let text = text.strip_prefix("error: ").unwrap_or(&text);
        Self::Verdict(text.trim_end().to_owned(), Exit::BadInput)
    }

    /// A plane of a slice that cannot be used.
    pub(crate) fn slice(error: SliceTextError) -> Self {
        Self::option("--slice", SliceTextError::EXPECTED, error.found)
    }

    /// A computation would need more memory than it may use; both in bytes.
    pub(crate) fn memory(what: &str, needed: u64, budget: u64) -> Self {
        let (needed, budget) = (display_bytes(needed), display_bytes(budget));
        Self::Verdict(
            format!(
                "{what} needs about {needed} of memory but only {budget} can be used: coarsen the \
                 lattice, shrink the window, or raise --memory"
            ),
            Exit::BadInput,
        )
    }

    /// No table of the scene meets the tolerance that was asked for; both as shares of the rms force.
    pub(crate) fn tolerance(part: &str, [asked, reached]: [f64; 2], reason: &str) -> Self {
        Self::Verdict(
            format!(
                "errors of force and torque of {:.3} % asked for, {:.3} % reached: {part} is what \
                 cannot be met, {reason}",
                100.0 * asked,
                100.0 * reached
            ),
            Exit::Failure,
        )
    }

    /// A table that cannot be used; where there is none, how to come by one.
    pub(crate) fn table(error: StoreError) -> Self {
        match &error {
            StoreError::Missing { path } => {
                let next = format!("`pegfit bake SCENE -o {}` makes one", shell_word(path));
                Self::bad_input("no table to read", error).with_next(next)
            }
            _ => Self::bad_input("the table cannot be used", error),
        }
    }

    /// A file that cannot be read.
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::io("read", path, source)
    }

    /// A file that cannot be written.
    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::io("write", path, source)
    }

    /// A file for which an action fails.
    pub(crate) fn io(action: &'static str, path: &Path, source: std::io::Error) -> Self {
        let path = path.to_owned();
        Self::Io {
            action,
            path,
            source,
        }
    }

    /// A library error that the input is to blame for.
    pub(crate) fn bad_input(context: impl Into<String>, source: impl Into<Cause>) -> Self {
        Self::library(context, source, true)
    }

    /// A library error that is nobody's fault.
    pub(crate) fn failure(context: impl Into<String>, source: impl Into<Cause>) -> Self {
        Self::library(context, source, false)
    }

    fn library(context: impl Into<String>, source: impl Into<Cause>, input: bool) -> Self {
        Self::Library {
            context: context.into(),
            source: source.into(),
            input,
            next: None,
        }
    }

    /// What helps, if that is known.
    pub(crate) fn help(&self) -> Option<&str> {
        match self {
            Self::Line(error) => error.next.as_deref(),
            Self::Library { next, .. } | Self::Stopped { next, .. } => next.as_deref(),
            _ => None,
        }
    }

    /// The same with what to do about it, if it is a library's.
    #[must_use]
    pub(crate) fn with_next(mut self, advice: impl Into<String>) -> Self {
        if let Self::Library { next, .. } = &mut self {
            *next = Some(advice.into());
        }
        self
    }

    /// Whether whoever was to read what is written went away, as `head` does when it has enough.
    pub(crate) fn is_closed_pipe(&self) -> bool {
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
    pub(crate) fn exit(&self) -> Exit {
        match self {
            Self::Verdict(_, exit) => *exit,
            Self::Input { .. } | Self::Line(_) | Self::Refused(_) => Exit::BadInput,
            // A file that is missing is a wrong argument; one that cannot be written is not.
            Self::Library { input: true, .. } | Self::Io { action: "read", .. } => Exit::BadInput,
            Self::Library { .. } | Self::Io { .. } | Self::Failed(_) => Exit::Failure,
            Self::Interrupted | Self::Stopped { .. } => Exit::Interrupted,
        }
    }
}

/// Refuses a command-line option.
///
/// # Errors
/// Always.
pub(crate) fn refuse<T>(
    item: impl Into<String>,
    expected: impl Into<String>,
    found: impl ToString,
) -> Result<T, CommandError> {
    Err(CommandError::option(item, expected, found))
}

/// A scene that cannot be read, and how to come by one.
fn no_scene(path: &Path, source: std::io::Error) -> CommandError {
    let is_missing = source.kind() == std::io::ErrorKind::NotFound;
    let error = CommandError::bad_input(format!("cannot read {}", path.display()), source);
    match other_file(path) {
        Some(advice) => error.with_next(advice),
        None if is_missing => error.with_next(format!(
            "`pegfit scene SOLIDS --moving NAME -o {}` makes a scene of a file of solids; of two \
             meshes it is three lines: unit = \"mm\", fixed = \"hole.stl\", moving = \"peg.stl\"",
            shell_word(path)
        )),
        None => error,
    }
}

/// What to do with a file that is not called as scenes are.
fn other_file(path: &Path) -> Option<String> {
    let ending = path.extension().unwrap_or_default();
    if ending == "toml" {
        return None;
    }
    let file = shell_word(path);
    Some(match ending == "zarr" {
        true => format!("tables are read by `--table {file}`; a scene is a file scene.toml"),
        false => format!(
            "a scene is a file of its own (scene.toml): `pegfit scene {file}` makes one of solids or \
             a robot"
        ),
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
