//! What `pegfit completions` and `pegfit man` understand.

use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

/// Arguments of `pegfit completions`.
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Arguments of `pegfit man`.
#[derive(Debug, Args)]
pub struct ManArgs {
    /// The folder, which must exist
    pub folder: PathBuf,
}
