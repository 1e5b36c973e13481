//! The program: from the words typed to an exit code.

use std::ffi::OsString;
use std::io::Write;

use clap::{CommandFactory, FromArgMatches};
use sdf_grid::text::shown_lines;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::prelude::*;

use crate::args::Arguments;
use crate::args::global::Coloring;
use crate::commands;
use crate::commands::interrupted::interrupted;
use crate::error::CommandError;
use crate::error::Exit;
use crate::terminal::error_text::{error_json, error_text};
use crate::terminal::output;
use crate::terminal::progress::watch_for_interrupts;

/// Does what the words of a command line ask for, the first of which is the program's name; prints
/// results and errors, and takes over the process' log and Ctrl-C.
pub fn run(words: impl IntoIterator<Item = OsString>) -> Exit {
    let words: Vec<OsString> = words.into_iter().collect();
    Coloring::of(&words).apply();
    let as_json = words.iter().any(|word| word == "--json");
    let arguments = match parse(&words) {
        Ok(arguments) => arguments,
        // Wrong usage, or help and version, which are no mistakes.
        Err(said) => {
            return match (said.use_stderr(), as_json) {
                (true, true) => with_output(Err(CommandError::usage(&said)), true),
                (true, false) => {
                    // Fails only if nobody reads it any more.
                    let _ = said.print();
                    Exit::BadInput
                }
                (false, _) => {
                    let _ = output::heeded(|| said.print());
                    with_output(Ok(()), as_json)
                }
            };
        }
    };
    print_logs(arguments.global.verbose);
    watch_for_interrupts();
    take_size_limits_as_errors();
    let ended = commands::run(&arguments).map_err(|error| match error {
        CommandError::Interrupted => interrupted(&arguments.command, &words),
        other => other,
    });
    with_output(ended, as_json)
}

/// The exit code of a command that ended so, if what it printed has left; prints what went wrong.
fn with_output(ended: Result<(), CommandError>, as_json: bool) -> Exit {
    let printed = output::finish().map_err(|e| CommandError::write("standard output".as_ref(), e));
    let mut exit = Exit::Success;
    // A reader that went away wants no more, and nothing is lost that anybody wanted.
    let errors = [ended, printed].into_iter().filter_map(Result::err);
    for error in errors.filter(|error| !error.is_closed_pipe()) {
        if exit == Exit::Success {
            exit = error.exit();
        }
        let text = match as_json {
            true => error_json(&error),
            // With the colours of a terminal.
            false => error_text(&error),
        };
        // Does nothing if nobody reads any more.
        let _ = writeln!(std::io::stderr(), "{text}");
    }
    exit
}

/// A file that may not grow any more (`ulimit -f`) is an error of the write, not a signal that ends
/// the process with a device in hand.
#[cfg(unix)]
fn take_size_limits_as_errors() {
    // SAFETY: a signal that is ignored runs no code.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

#[cfg(not(unix))]
fn take_size_limits_as_errors() {}

/// The arguments, else what is wrong with them, said of words without what a terminal would obey: a
/// shell puts names of files in place of `*`.
fn parse(words: &[OsString]) -> Result<Arguments, clap::Error> {
    let parsed = |words: Vec<OsString>| {
        let command = Arguments::command().color(Coloring::of(&words).into());
        let matches = command.try_get_matches_from(words)?;
        Arguments::from_arg_matches(&matches)
    };
    parsed(words.to_vec()).map_err(|said| {
        let shown = |word: &OsString| shown_lines(&word.to_string_lossy()).into_owned().into();
        parsed(words.iter().map(shown).collect())
            .err()
            .unwrap_or(said)
    })
}

/// Library messages go to standard error; `-v` says how many, and `PEGFIT_LOG` which: a level, or a
/// crate and its level, as in `fft_correlate=debug`; several between commas.
fn print_logs(verbose: u8) {
    let level = match verbose {
        0 => LevelFilter::WARN,
        1 => LevelFilter::INFO,
        2 => LevelFilter::DEBUG,
        _ => LevelFilter::TRACE,
    };
    let filter: Targets = std::env::var("PEGFIT_LOG")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or_else(|| Targets::new().with_default(level));
    let lines = fmt::layer()
        .with_writer(std::io::stderr)
        .with_ansi(console::colors_enabled_stderr())
        .with_target(false);
    // Fails only if the process logs already.
    let _ = tracing_subscriber::registry()
        .with(lines.with_filter(filter))
        .try_init();
}
