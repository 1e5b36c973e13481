//! What every command gets besides its own arguments.

use serde::Serialize;

use crate::error::CommandError;
use crate::report::output::print_json;
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

impl Context {
    /// Prints a result: as JSON for programs, else by `print` for people.
    pub(crate) fn show(
        &self,
        result: &impl Serialize,
        print: impl FnOnce(),
    ) -> Result<(), CommandError> {
        match self.json {
            true => print_json(result),
            false => {
                print();
                Ok(())
            }
        }
    }
}
