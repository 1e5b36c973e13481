//! The commands: from parsed arguments through validation to library calls and printed results.

use crate::args::global::Global;
use crate::args::{Arguments, Command};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::memory;
use crate::terminal::progress::Progress;

mod assemble;
mod assemble_export;
mod bake;
mod check;
mod demo;
mod devices;
mod disassemble;
mod dock;
mod dock_export;
mod docked_pose;

mod feel;
mod field;

mod haptic_session;
pub(crate) mod interrupted;
mod joint;
mod manual;
mod part_files;
mod path;
mod play;
mod plot;
mod resume;

mod scene;
mod scenes;
mod score;
mod screen;
mod screen_rows;
mod stored;
mod table;
mod tolerance;
mod verify;
mod worker_share;

/// Runs the command that was asked for.
///
/// # Errors
/// Whatever stopped it; [`CommandError::exit`] has the exit code.
pub(crate) fn run(arguments: &Arguments) -> Result<(), CommandError> {
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
        Command::Screen(args) => screen::run(args, &context),
        Command::Path(args) => path::run(args, &context),
        Command::Disassemble(args) => disassemble::run(args, &context),
        Command::Assemble(args) => assemble::run(args, &context),
        Command::Play(args) => play::run(args, &context),
        Command::Feel(args) => feel::run(args, &context),
        Command::Devices(args) => devices::run(args, &context),
        Command::Plot(args) => plot::run(args, &context),
        Command::Scene(args) => scene::run(args, &context),
        Command::Completions(args) => {
            manual::complete(args);
            Ok(())
        }
        Command::Man(args) => manual::write(args),
    }
}

fn memory_budget(global: &Global) -> Result<u64, CommandError> {
    match global.memory {
        Some(gib) if gib.is_finite() && gib > 0.0 => {
            Ok(memory::budget(Some((gib * f64::from(1 << 30)) as u64)))
        }
        Some(gib) => refuse("--memory", "a positive number of GiB", gib),
        None => Ok(memory::budget(None)),
    }
}

fn start_threads(global: &Global) -> Result<(), CommandError> {
    let Some(threads) = global.threads else {
        return Ok(());
    };
    if threads == 0 || threads > 4096 {
        return refuse("--threads", "1 to 4096", threads);
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|e| CommandError::failure("starting worker threads", e))
}
