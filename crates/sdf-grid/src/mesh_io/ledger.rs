//! The ledger of a reader: items read, ignored and assumed.

use std::fmt;

use serde::Serialize;

/// The treatment of an item of a file by its reader.
///
/// See the example of [`Ledger`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LedgerKind {
    /// The item is part of the result.
    Read,
    /// The item is not part of the result.
    Ignored,
    /// The file does not state it; the reader chose it.
    Assumed,
}

impl LedgerKind {
    /// The kind as one lower-case word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Read => "read",
            Self::Ignored => "ignored",
            Self::Assumed => "assumed",
        }
    }
}

/// One line of a [`Ledger`].
///
/// See the example of [`Ledger`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LedgerEntry {
    /// How the reader treated it.
    pub kind: LedgerKind,
    /// The item, in the format's own words, in the singular: `line element`, `texture`, `unit`.
    pub item: String,
    /// How many of them the file has.
    pub count: u64,
    /// Why it was ignored, or what was assumed; empty for what was read.
    pub reason: String,
}

impl fmt::Display for LedgerEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.kind.word(), self.item)?;
        if self.count != 1 {
            write!(f, " ({} times)", self.count)?;
        }
        if !self.reason.is_empty() {
            write!(f, ": {}", self.reason)?;
        }
        Ok(())
    }
}

/// Items that a reader read, ignored and assumed, in the order of their first occurrence.
///
/// Items that never change a solid (textures, comments that hold metadata) are listed as well, so
/// that a user can see that nothing was lost. An unreadable item that would change a solid is an
/// error of the reader instead, unless its options allow it.
///
/// ```
/// use sdf_grid::{Ledger, LedgerKind};
///
/// let mut ledger = Ledger::default();
/// ledger.add(LedgerKind::Ignored, "line element", "it encloses no volume");
/// ledger.add(LedgerKind::Ignored, "line element", "it encloses no volume");
/// let entry = &ledger.entries()[0];
/// assert_eq!(entry.count, 2);
/// assert_eq!(entry.to_string(), "ignored: line element (2 times): it encloses no volume");
/// ```
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Ledger {
    entries: Vec<LedgerEntry>,
}

impl Ledger {
    /// Counts one item.
    pub fn add(&mut self, kind: LedgerKind, item: &str, reason: &str) {
        self.add_many(kind, item, reason, 1);
    }

    /// Counts several alike items; none adds nothing.
    pub fn add_many(&mut self, kind: LedgerKind, item: &str, reason: &str, count: u64) {
        if count == 0 {
            return;
        }
        let known = self
            .entries
            .iter_mut()
            .find(|e| e.kind == kind && e.item == item && e.reason == reason);
        match known {
            Some(entry) => entry.count += count,
            None => self.entries.push(LedgerEntry {
                kind,
                item: item.to_owned(),
                count,
                reason: reason.to_owned(),
            }),
        }
    }

    /// Adds all entries of another ledger.
    pub fn extend(&mut self, other: &Self) {
        for entry in &other.entries {
            self.add_many(entry.kind, &entry.item, &entry.reason, entry.count);
        }
    }

    /// The entries, one per kind, item and reason.
    pub fn entries(&self) -> &[LedgerEntry] {
        &self.entries
    }

    /// The entries of one kind.
    pub fn of_kind(&self, kind: LedgerKind) -> impl Iterator<Item = &LedgerEntry> {
        self.entries.iter().filter(move |e| e.kind == kind)
    }
}
