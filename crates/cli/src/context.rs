//! What every command gets besides its own arguments.

use crate::terminal::progress::Progress;

/// What every command gets besides its own arguments.
#[derive(Debug)]
pub struct Context {
    /// Progress bars and the Ctrl-C flag.
    pub progress: Progress,
    /// Print machine-readable results.
    pub json: bool,
    /// Bytes that computations may plan to use.
    pub memory: u64,
}
