//! Sources that scenes share and exchange, told apart by number.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use fft_correlate::{EnergySource, Pose, Response, Scratch};

/// The number of a source, given once while the program runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SourceId(u64);

impl SourceId {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        // 2^64 sources are more than any run loads.
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// An energy source that pairs, and sums exchanged for one another, may hold together.
///
/// Clones are the same source. Two that were made by [`SharedSource::new`] are two, even if the
/// second one comes to lie where the first one was in memory.
#[derive(Clone)]
pub struct SharedSource {
    id: SourceId,
    source: Arc<dyn EnergySource>,
}

impl SharedSource {
    /// A source that was not there before.
    pub fn new(source: Arc<dyn EnergySource>) -> Self {
        Self {
            id: SourceId::new(),
            source,
        }
    }

    /// The same source with another part of it in memory: `source` must give what this one gives
    /// wherever both are [loaded](EnergySource::is_loaded).
    #[must_use]
    pub fn with_part(&self, source: Arc<dyn EnergySource>) -> Self {
        Self {
            id: self.id,
            source,
        }
    }

    pub(crate) fn id(&self) -> SourceId {
        self.id
    }

    /// Its address.
    #[cfg(test)]
    pub(crate) fn place(&self) -> usize {
        Arc::as_ptr(&self.source).addr()
    }
}

impl EnergySource for SharedSource {
    fn scratch(&self) -> Scratch {
        self.source.scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        self.source.evaluate(pose, scratch)
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        self.source.refresh(pose, scratch)
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        self.source.is_loaded(pose, scratch)
    }
}
