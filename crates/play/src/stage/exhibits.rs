//! What a page may ask about a stage, besides frames.

use serde_json::Value;

/// What a page may ask about a stage, besides frames; asked by the threads that serve, while the
/// loop runs.
pub trait Exhibits: Send + Sync {
    /// What the page needs to know, as JSON; `docs/play.md` lists its keys.
    fn description(&self) -> Value;

    /// The bytes called `name` (`mesh/0`, `slice/1`, `skeleton/0`, ...), or `None` if there is no
    /// such thing.
    fn bytes(&self, name: &str) -> Option<Vec<u8>>;

    /// Looks for poses in which the moving part fits, best first, as a JSON list; may take minutes.
    ///
    /// # Errors
    /// In words, why there are none.
    fn dock(&self) -> Result<Value, String>;
}

/// Nothing but the loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoExhibits;

impl Exhibits for NoExhibits {
    fn description(&self) -> Value {
        Value::Null
    }

    fn bytes(&self, _: &str) -> Option<Vec<u8>> {
        None
    }

    fn dock(&self) -> Result<Value, String> {
        Err("there is nothing to look for".to_owned())
    }
}
