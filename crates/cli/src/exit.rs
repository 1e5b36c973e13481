//! Exit codes of the `pegfit` command, all in one place.

use std::process::ExitCode;

/// How a run of `pegfit` ended, as the shell sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The command did what it was asked to.
    Success = 0,
    /// Something failed that the input cannot be blamed for: a disk, a device, a library.
    Failure = 1,
    /// The arguments, or a file they name, cannot be used: nothing was computed.
    BadInput = 2,
    /// `pegfit check` found a mesh that no other command would accept.
    UnusableMesh = 3,
    /// `pegfit table` found chunks that cannot be read: every command that interpolates the table
    /// would refuse it, `pegfit bake --resume` mends it. Missing chunks are no damage.
    DamagedTable = 4,
    /// Stopped by Ctrl-C or a termination signal; finished results are kept.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}
