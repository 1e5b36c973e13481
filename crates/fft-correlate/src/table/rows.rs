//! Where a table's energies lie: all rotation nodes in one piece, or each by itself and some
//! absent.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use sdf_grid::large;

/// The stored numbers of one rotation node, arranged by a layout, on their own.
#[derive(Debug)]
pub(crate) struct Row {
    codes: Vec<u16>,
    /// Bytes of all such rows of the table that are still in memory, wherever they are held.
    held: Arc<AtomicU64>,
}

impl Row {
    pub(crate) fn new(codes: Vec<u16>, held: &Arc<AtomicU64>) -> Self {
        held.fetch_add(2 * codes.len() as u64, Ordering::Relaxed);
        Self {
            codes,
            held: Arc::clone(held),
        }
    }
}

impl Drop for Row {
    fn drop(&mut self) {
        let bytes = 2 * self.codes.len() as u64;
        self.held.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// The stored numbers of a table, by slot.
#[derive(Debug, Clone)]
pub(crate) enum Rows {
    /// Slot after slot.
    Whole(Vec<u16>),
    /// Slots that are in memory; shared with other states of the same table.
    Parts {
        rows: Vec<Option<Arc<Row>>>,
        /// All of them.
        all: bool,
    },
}

impl Rows {
    /// The numbers of a slot; `None` if they are not in memory.
    #[inline]
    pub(crate) fn get(&self, slot: usize, length: usize) -> Option<&[u16]> {
        match self {
            Self::Whole(codes) => Some(&codes[slot * length..][..length]),
            Self::Parts { rows, .. } => rows[slot].as_ref().map(|row| &row.codes[..]),
        }
    }

    /// Whether a slot is in memory.
    pub(crate) fn has(&self, slot: usize) -> bool {
        match self {
            Self::Whole(_) => true,
            Self::Parts { rows, .. } => rows[slot].is_some(),
        }
    }

    /// Whether every slot is in memory.
    pub(crate) fn all(&self) -> bool {
        match self {
            Self::Whole(_) => true,
            Self::Parts { all, .. } => *all,
        }
    }

    /// Bytes of the numbers in memory.
    pub(crate) fn bytes(&self) -> u64 {
        let numbers = match self {
            Self::Whole(codes) => codes.len(),
            Self::Parts { rows, .. } => rows.iter().flatten().map(|row| row.codes.len()).sum(),
        };
        2 * numbers as u64
    }
}

/// Zeros in as few pages as the system can make of them: a query reads some hundred places, and
/// with small pages most of them would miss the processor's page cache.
pub(crate) fn zeroed_pages(length: usize) -> Vec<u16> {
    let zeros = vec![0u16; length];
    large::ask_for_large_pages(&zeros);
    zeros
}
