//! The commands: from parsed arguments through validation to library calls and printed results.

use std::path::Path;

use crate::args::{Arguments, Command, Global};
use crate::error::CommandError;
use crate::memory;
use crate::progress::Progress;

mod bake;
mod check;
mod demo;
mod devices;
mod dock;
mod feel;
mod feel_report;
mod field;
mod hand;
mod pairs;
mod plot;
mod score;
mod table;
mod tolerance;
mod verify;

/// What every command gets besides its own arguments.
#[derive(Debug)]
pub struct Context {
    /// Progress bars and the Ctrl-C flag.
    pub progress: Progress,
    /// Print machine-readable results.
    pub json: bool,
    /// Bytes that computations may plan to use.
    pub memory: u64,
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
        memory: memory_budget(&arguments.global)?,
    };
    match &arguments.command {
        Command::Check(args) => check::run(args, &context),
        Command::Field(args) => field::run(args, &context),
        Command::Score(args) => score::run(args, &context),
        Command::Demo(args) => demo::run(args, &context),
        Command::Bake(args) => bake::run(args, &context),
        Command::Table(args) => table::run(args, &context),
        Command::Verify(args) => verify::run(args, &context),
        Command::Dock(args) => dock::run(args, &context),
        Command::Feel(args) => feel::run(args, &context),
        Command::Devices(args) => devices::run(args, &context),
        Command::Plot(args) => plot::run(args, &context),
    }
}

fn memory_budget(global: &Global) -> Result<u64, CommandError> {
    match global.memory {
        Some(gib) if gib.is_finite() && gib > 0.0 => {
            Ok(memory::budget(Some((gib * f64::from(1 << 30)) as u64)))
        }
        Some(gib) => Err(CommandError::option(
            "--memory",
            "a positive number of GiB",
            gib,
        )),
        None => Ok(memory::budget(None)),
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

/// Refuses an output whose folder does not exist before anything is computed.
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

/// Prints a result for programs.
fn print_json(value: &impl serde::Serialize) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| CommandError::failure("writing JSON", e))?;
    crate::say!("{text}");
    Ok(())
}
