//! The commands: from parsed arguments through validation to library calls and printed results.

use crate::args::{Arguments, Command, Global};
use crate::error::CommandError;
use crate::progress::Progress;

mod check;

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
    let context = Context {
        progress: Progress::new(arguments.global.quiet),
        json: arguments.global.json,
        quiet: arguments.global.quiet,
    };
    match &arguments.command {
        Command::Check(args) => check::run(args, &context),
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

/// Prints a result for programs.
fn print_json(value: &impl serde::Serialize) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| CommandError::failure("writing JSON", e))?;
    println!("{text}");
    Ok(())
}
