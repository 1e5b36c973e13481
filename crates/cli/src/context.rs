//! What every command gets besides its own arguments.

use crate::terminal::progress::Progress;

/// What every command gets besides its own arguments.
#[derive(Debug)]
pub(crate) struct Context {
    /// Progress bars and the Ctrl-C flag.
    pub(crate) progress: Progress,
    /// Print machine-readable results.
    pub(crate) json: bool,
    /// Bytes that computations may plan to use.
    pub(crate) memory: u64,
}
