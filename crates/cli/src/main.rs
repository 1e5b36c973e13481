//! The `pegfit` command.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use pegfit::args::Arguments;
use pegfit::terminal::progress::watch_for_interrupts;
use pegfit::{Exit, commands};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::prelude::*;

fn main() -> ExitCode {
    // Clap ends the process itself: with 2 for wrong usage, 0 for help and version.
    let arguments = Arguments::parse();
    print_logs();
    shape_errors();
    watch_for_interrupts();
    match commands::run(&arguments) {
        Ok(()) => Exit::Success.into(),
        Err(error) => {
            let exit = error.exit();
            pegfit::remark!("{:?}", miette::Report::new(error));
            exit.into()
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
    tracing_subscriber::registry()
        .with(lines.with_filter(filter))
        .init();
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
