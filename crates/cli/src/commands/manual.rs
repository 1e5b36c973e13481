//! `pegfit completions` and `pegfit man`: what the argument parser knows, for shells and readers.

use clap::{Command, CommandFactory};
use sdf_grid::atomic;

use crate::args::{Arguments, CompletionsArgs, ManArgs};
use crate::error::CommandError;

/// Prints a shell's completions.
pub(super) fn complete(args: &CompletionsArgs) {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Arguments::command(), "pegfit", &mut text);
    say!("{}", String::from_utf8_lossy(&text));
}

/// Writes `pegfit.1` and a page for each command.
pub(super) fn write(args: &ManArgs) -> Result<(), CommandError> {
    if !args.folder.is_dir() {
        let folder = args.folder.display().to_string();
        return Err(CommandError::input(
            folder,
            "folder",
            "an existing folder",
            "none",
        ));
    }
    let mut command = Arguments::command();
    command.build();
    page(&command, "pegfit", args)?;
    for each in command.get_subcommands().filter(|c| c.get_name() != "help") {
        page(each, &format!("pegfit-{}", each.get_name()), args)?;
    }
    Ok(())
}

fn page(command: &Command, name: &str, args: &ManArgs) -> Result<(), CommandError> {
    let path = args.folder.join(format!("{name}.1"));
    let mut text = Vec::new();
    clap_mangen::Man::new(command.clone())
        .title(name)
        .render(&mut text)
        .map_err(|e| CommandError::write(&path, e))?;
    atomic::write(&path, &text)?;
    say!("{}", path.display());
    Ok(())
}
