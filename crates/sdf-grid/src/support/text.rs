//! Text from files, made fit to be shown.

use std::borrow::Cow;
use std::fmt::Write;

/// Text on one line whose control characters stand as such: a name in a file that holds an escape
/// sequence neither colours a terminal nor clears it, and direction marks do not turn words around.
///
/// ```
/// use sdf_grid::text::shown;
///
/// assert_eq!(shown("lid\x1b[2J"), "lid\\u001b[2J");
/// assert_eq!(shown("two\nlines"), "two\\nlines");
/// assert_eq!(shown("Schraube M4×10"), "Schraube M4×10");
/// ```
pub fn shown(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// As [`shown`], but line breaks and tabs stay: for text of several lines.
///
/// ```
/// use sdf_grid::text::shown_lines;
///
/// assert_eq!(shown_lines("two\nlines\x07"), "two\nlines\\u0007");
/// ```
pub fn shown_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| matches!(c, '\n' | '\t'))
}

/// As [`shown`], between quotation marks: a name or a word of the user's in a sentence.
///
/// ```
/// assert_eq!(sdf_grid::text::quoted("C:\\lid\x07"), "\"C:\\lid\\u0007\"");
/// ```
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", shown(text))
}

fn escaped(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    let hidden = |c: char| acts(c) && !stays(c);
    if !text.contains(hidden) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match (hidden(c), c) {
            (false, c) => safe.push(c),
            (true, '\n' | '\r' | '\t') => safe.extend(c.escape_default()),
            // As JSON understands it. Writing to a string does not fail.
            (true, c) => drop(write!(safe, "\\u{:04x}", u32::from(c))),
        }
    }
    Cow::Owned(safe)
}

/// A number with so many significant digits, as short as it can be read.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let exponent = value.abs().log10().floor() as i32;
    let after = digits as i32 - 1 - exponent;
    match exponent {
        -4..6 => format!("{value:.*}", after.max(0) as usize),
        _ => format!("{value:.*e}", digits.saturating_sub(1)),
    }
}

/// Whether a character does something instead of being seen: control characters of both sets, ends
/// of lines, and marks of the direction of writing.
///
/// ```
/// assert!(sdf_grid::text::acts('\u{9b}'));
/// assert!(!sdf_grid::text::acts('ü'));
/// ```
pub fn acts(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{061c}' | '\u{200e}' | '\u{200f}' | '\u{2028}' | '\u{2029}'
        )
        || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_that_acts_is_shown() {
        for c in [
            '\0', '\x07', '\x08', '\x1b', '\x7f', '\u{9b}', '\u{202e}', '\u{2066}',
        ] {
            let text = format!("a{c}b");
            assert!(!shown(&text).contains(c), "{c:?}");
            assert!(!shown_lines(&text).contains(c), "{c:?}");
            assert!(shown(&text).starts_with("a\\u"));
        }
        assert_eq!(shown("\r\n\t"), "\\r\\n\\t");
        assert_eq!(shown_lines("\r\n\t"), "\\r\n\t");
        assert!(matches!(shown("plain ü 日本"), Cow::Borrowed(_)));
    }
}
