//! What devices, drivers and services say of themselves, made fit to be shown: a terminal obeys
//! some characters, and whatever was plugged in may send them.

use sdf_grid::text;

/// Most characters of a text that are shown.
const LONGEST: usize = 200;

/// The text on one line without what a terminal would obey ([`text::shown`]), cut after 200
/// characters.
///
/// ```
/// let name = haptic::device::text::printable("Stick\u{1b}[2J");
/// assert_eq!(name, r"Stick\u001b[2J");
/// ```
pub fn printable(text: &str) -> String {
    let end = text.char_indices().nth(LONGEST).map(|(at, _)| at);
    let mut out = text::shown(&text[..end.unwrap_or(text.len())]).into_owned();
    if end.is_some() {
        out.push('…');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_between_characters() {
        assert_eq!(printable("µ\u{9b}K"), "µ\\u009bK");
        let long = "µ".repeat(LONGEST);
        assert_eq!(printable(&long), long);
        assert_eq!(printable(&(long.clone() + "x")), long + "…");
    }
}
