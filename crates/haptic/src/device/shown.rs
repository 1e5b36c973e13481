//! What devices, drivers and services say of themselves, made fit to be shown: a terminal obeys some
//! characters, and whatever was plugged in may send them.

use std::borrow::Cow;

/// Most characters of a text that are shown.
const LONGEST: usize = 200;

/// The text with [escapes](escape) for what a terminal would obey, cut after 200 characters.
///
/// ```
/// let name = haptic::device::shown::shown("Stick\u{1b}[2J");
/// assert_eq!(name, r"Stick\u001b[2J");
/// ```
pub fn shown(text: &str) -> String {
    let mut chars = text.chars();
    let mut shown = String::new();
    chars
        .by_ref()
        .take(LONGEST)
        .for_each(|c| push(&mut shown, c, is_obeyed(c)));
    if chars.next().is_some() {
        shown.push('…');
    }
    shown
}

/// The text with `\u001b` and the like, which JSON understands too, for what a terminal would obey;
/// ends of lines and tabs stay.
///
/// ```
/// let line = haptic::device::shown::escape("a\tb\u{1b}[2J\n");
/// assert_eq!(line, "a\tb\\u001b[2J\n");
/// ```
pub fn escape(text: &str) -> Cow<'_, str> {
    let stays = |c: char| matches!(c, '\n' | '\t') || !is_obeyed(c);
    if text.chars().all(stays) {
        return text.into();
    }
    let mut escaped = String::new();
    text.chars().for_each(|c| push(&mut escaped, c, !stays(c)));
    escaped.into()
}

fn push(text: &mut String, c: char, escaped: bool) {
    match escaped {
        true => text.push_str(&format!("\\u{:04x}", u32::from(c))),
        false => text.push(c),
    }
}

/// Control characters, ends of lines and paragraphs, and marks that turn the direction of writing.
fn is_obeyed(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}'..='\u{200f}' | '\u{2028}'..='\u{202e}');
    c.is_control() || turns || matches!(c, '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_escaped() {
        let evil = "Stick\u{1b}]0;owned\u{7}\r\n\u{9b}2J\u{202e}kcits\u{7f}";
        let safe = shown(evil);
        assert_eq!(
            safe,
            r"Stick\u001b]0;owned\u0007\u000d\u000a\u009b2J\u202ekcits\u007f"
        );
        for plain in ["", "Größe 5 µm, 力"] {
            assert_eq!(
                (shown(plain).as_str(), escape(plain).as_ref()),
                (plain, plain)
            );
        }
        assert_eq!(escape("a\tb\r\n\u{7f}"), "a\tb\\u000d\n\\u007f");
    }

    #[test]
    fn a_long_text_is_cut() {
        assert_eq!(shown(&"é".repeat(LONGEST)), "é".repeat(LONGEST));
        assert_eq!(shown(&"é".repeat(1 << 20)), "é".repeat(LONGEST) + "…");
    }
}
