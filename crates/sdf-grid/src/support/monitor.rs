//! How a long computation reports progress and learns that it should stop.

/// Receives progress from a long computation and may ask it to stop.
///
/// Implementations are called from many threads; `advance` is called at most a few thousand times
/// per computation, never in an inner loop.
pub trait Monitor: Sync {
    /// `steps` more units of work are finished, out of the `total` announced by [`Monitor::begin`].
    fn advance(&self, steps: u64) {
        let _ = steps;
    }

    /// A stage named `stage` of `total` units begins.
    fn begin(&self, stage: &str, total: u64) {
        let _ = (stage, total);
    }

    /// True once the caller wants the computation to end early. Checked between units of work;
    /// the computation then returns its `Cancelled` error and leaves finished results in place.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Reports nothing and never cancels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Monitor for Silent {}
