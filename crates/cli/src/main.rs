//! The `pegfit` command.

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use pegfit::args::Arguments;
use pegfit::terminal::progress::watch_for_interrupts;
use pegfit::{Exit, commands};
use tracing_subscriber::EnvFilter;

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

/// Library messages go to standard error; `PEGFIT_LOG` chooses which.
fn print_logs() {
    let filter = EnvFilter::try_from_env("PEGFIT_LOG").unwrap_or_else(|_| EnvFilter::new("warn"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_target(false)
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
