//! What a reader read, ignored and assumed of a file, for people.

use sdf_grid::text::shown;
use sdf_grid::{Ledger, LedgerKind};

/// Entries of one kind listed one by one.
const MOST_LISTED: usize = 20;

/// What was read in one line, then a line for each item that was ignored or assumed.
pub fn ledger_lines(ledger: &Ledger) -> Vec<String> {
    let read: Vec<String> = ledger
        .of_kind(LedgerKind::Read)
        .map(|e| format!("{} {}", e.count, shown(&e.item)))
        .collect();
    let mut lines = Vec::new();
    if !read.is_empty() {
        lines.push(format!(
            "  {:<12} {}",
            LedgerKind::Read.word(),
            read.join(", ")
        ));
    }
    for kind in [LedgerKind::Ignored, LedgerKind::Assumed] {
        let title = kind.word();
        let entries = ledger.of_kind(kind);
        lines.extend(entries.take(MOST_LISTED).map(|e| match e.count {
            1 => format!("  {title:<12} {}: {}", shown(&e.item), shown(&e.reason)),
            n => {
                let (item, reason) = (shown(&e.item), shown(&e.reason));
                format!("  {title:<12} {item} ({n} times): {reason}")
            }
        }));
        let more = ledger.of_kind(kind).skip(MOST_LISTED).count();
        if more > 0 {
            lines.push(format!("  {title:<12} and {more} more: --json has all"));
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_read_takes_one_line_and_the_rest_one_each() {
        let mut ledger = Ledger::default();
        ledger.add_many(LedgerKind::Read, "v", "", 8);
        ledger.add_many(LedgerKind::Ignored, "vn", "it says nothing of the solid", 6);
        ledger.add(LedgerKind::Assumed, "unit", "mm");
        ledger.add_many(LedgerKind::Read, "f", "", 12);
        let expected = [
            "  read         8 v, 12 f",
            "  ignored      vn (6 times): it says nothing of the solid",
            "  assumed      unit: mm",
        ];
        assert_eq!(ledger_lines(&ledger), expected);
        for item in 0..30 {
            ledger.add(LedgerKind::Ignored, &item.to_string(), "one of many");
        }
        let said = ledger_lines(&ledger);
        assert_eq!(said.len(), 1 + 20 + 1 + 1);
        assert!(said.contains(&"  ignored      and 11 more: --json has all".to_owned()));
    }
}
