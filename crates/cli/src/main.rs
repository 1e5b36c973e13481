//! The `pegfit` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    pegfit::program::run(std::env::args_os()).into()
}
