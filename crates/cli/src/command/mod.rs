//! The commands: from parsed arguments through validation to library calls and printed results.

use std::path::Path;

use crate::args::{Arguments, Command, Global};
use crate::error::CommandError;
use crate::progress::Progress;

/// What every command gets besides its own arguments.
#[derive(Debug)]
pub struct Context {
    /// Progress bars and the Ctrl-C flag.
    pub progress: Progress,
    /// Print machine-readable results.
    pub json: bool,
    /// No remarks.
    pub quiet: bool,
}

/// Runs the command that was asked for.
///
/// # Errors
/// Whatever stopped it; [`CommandError::exit`] has the exit code.
pub fn run(arguments: &Arguments) -> Result<(), CommandError> {
    start_threads(&arguments.global)?;
    let _context = Context {
        progress: Progress::new(arguments.global.quiet),
        json: arguments.global.json,
        quiet: arguments.global.quiet,
    };
    match &arguments.command {
        Command::Check(_) => todo!(),
        _ => todo!(),
    }
}

fn start_threads(global: &Global) -> Result<(), CommandError> {
    let Some(threads) = global.threads else {
        return Ok(());
    };
    if threads == 0 || threads > 4096 {
        return Err(CommandError::option("--threads", "1 to 4096", threads));
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| CommandError::failure("starting worker threads", e))
}

/// Refuses an output folder that does not exist before anything is computed.
fn require_folder(output: &Path) -> Result<(), CommandError> {
    match output.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            Err(CommandError::input(
                output.display().to_string(),
                "folder",
                "an existing folder",
                folder.display(),
            ))
        }
        _ => Ok(()),
    }
}
