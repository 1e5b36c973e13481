//! The program: from the words typed to an exit code.

use std::ffi::OsString;
use std::io::Write;

use clap::Parser;
use sdf_grid::text::shown_lines;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::prelude::*;

use crate::args::Arguments;
use crate::commands;
use crate::error::CommandError;
use crate::error::Exit;
use crate::terminal::error_text::error_text;
use crate::terminal::output;
use crate::terminal::progress::watch_for_interrupts;

/// Does what the words of a command line ask for, the first of which is the program's name; prints
/// results and errors, and takes over the process' log and Ctrl-C.
pub fn run(words: impl IntoIterator<Item = OsString>) -> Exit {
    let arguments = match parse(words) {
        Ok(arguments) => arguments,
        // Wrong usage, or help and version, which are no mistakes.
        Err(said) => {
            return match said.use_stderr() {
                true => {
                    // Fails only if nobody reads it any more.
                    let _ = said.print();
                    Exit::BadInput
                }
                false => {
                    let _ = output::heeded(|| said.print());
                    with_output(Ok(()))
                }
            };
        }
    };
    print_logs();
    watch_for_interrupts();
    take_size_limits_as_errors();
    with_output(commands::run(&arguments))
}

/// The exit code of a command that ended so, if what it printed has left; prints what went wrong.
fn with_output(ended: Result<(), CommandError>) -> Exit {
    let printed = output::finish().map_err(|e| CommandError::write("standard output".as_ref(), e));
    let mut exit = Exit::Success;
    // A reader that went away wants no more, and nothing is lost that anybody wanted.
    let errors = [ended, printed].into_iter().filter_map(Result::err);
    for error in errors.filter(|error| !error.is_closed_pipe()) {
        if exit == Exit::Success {
            exit = error.exit();
        }
        // With the colours of a terminal; does nothing if nobody reads any more.
        let _ = writeln!(std::io::stderr(), "{}", error_text(&error));
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
fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Arguments, clap::Error> {
    let words: Vec<OsString> = words.into_iter().collect();
    Arguments::try_parse_from(&words).map_err(|said| {
        let shown = words
            .iter()
            .map(|word| shown_lines(&word.to_string_lossy()).into_owned());
        Arguments::try_parse_from(shown).err().unwrap_or(said)
    })
}

/// Library messages go to standard error; `PEGFIT_LOG` chooses which: a level, or a crate and its
/// level, as in `fft_correlate=debug`; several between commas.
fn print_logs() {
    let filter: Targets = std::env::var("PEGFIT_LOG")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or_else(|| Targets::new().with_default(LevelFilter::WARN));
    let lines = fmt::layer().with_writer(std::io::stderr).with_target(false);
    // Fails only if the process logs already.
    let _ = tracing_subscriber::registry()
        .with(lines.with_filter(filter))
        .try_init();
}
