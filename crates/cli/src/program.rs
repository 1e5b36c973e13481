//! The program: from the words typed to an exit code.

use std::ffi::OsString;
use std::io::{IsTerminal, Write};

use clap::Parser;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::prelude::*;

use crate::args::Arguments;
use crate::commands;
use crate::exit::Exit;
use crate::terminal::progress::watch_for_interrupts;
use crate::terminal::shown::ShownError;

/// Does what the words of a command line ask for, the first of which is the program's name; prints
/// results and errors, and takes over the process' log and Ctrl-C.
pub fn run(words: impl IntoIterator<Item = OsString>) -> Exit {
    let arguments = match Arguments::try_parse_from(words) {
        Ok(arguments) => arguments,
        // Wrong usage, or help and version, which are no mistakes.
        Err(said) => {
            // Fails only if nobody reads it any more.
            let _ = said.print();
            return match said.use_stderr() {
                true => Exit::BadInput,
                false => Exit::Success,
            };
        }
    };
    print_logs();
    shape_errors();
    watch_for_interrupts();
    match commands::run(&arguments) {
        Ok(()) => Exit::Success,
        Err(error) => {
            let exit = error.exit();
            let report = miette::Report::new(ShownError::from(error));
            // Coloured by miette itself; fails only if nobody reads it any more.
            let _ = writeln!(std::io::stderr(), "{report:?}");
            exit
        }
    }
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

/// Wraps error text for people only: programs get every message on one line.
fn shape_errors() {
    let terminal = std::io::stderr().is_terminal();
    // Fails only if a hook is already installed, and this is the only place that installs one.
    let _ = miette::set_hook(Box::new(move |_| {
        Box::new(
            miette::MietteHandlerOpts::new()
                .terminal_links(false)
                .wrap_lines(terminal)
                .break_words(false)
                .build(),
        )
    }));
}
