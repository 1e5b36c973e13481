//! One screen of a page: parts in space and numbers on one side, figures by their buttons on the
//! other.

/// The script of a page with a [`Screen`].
pub(crate) const SCRIPT: &str = concat!(include_str!("player.js"), include_str!("tabs.js"));

/// A figure that a button shows.
pub(crate) struct Figure<'a> {
    /// Part of its address.
    pub(crate) kind: &'a str,
    /// On its button.
    pub(crate) name: &'a str,
    /// Under it.
    pub(crate) caption: &'a str,
    pub(crate) html: &'a str,
}

/// What one screen shows; all of it is HTML.
pub(crate) struct Screen<'a> {
    /// Its address on the page.
    pub(crate) id: &'a str,
    /// With its tags; may be empty.
    pub(crate) heading: String,
    /// The parts in space; may be empty.
    pub(crate) player: &'a str,
    /// Numbers and their names.
    pub(crate) rows: Vec<(String, String)>,
    pub(crate) figures: Vec<Figure<'a>>,
    /// Below all; may be empty.
    pub(crate) end: String,
}

impl Screen<'_> {
    pub(crate) fn html(&self) -> String {
        let id = self.id;
        let figures = || self.figures.iter().enumerate();
        let tab = |(i, figure): (usize, &Figure<'_>)| {
            format!(
                "<button type=\"button\" role=\"tab\" id=\"{id}-{0}-tab\" \
                 aria-controls=\"{id}-{0}\" aria-selected=\"{1}\">{2}</button>",
                figure.kind,
                i == 0,
                figure.name
            )
        };
        let panel = |(i, figure): (usize, &Figure<'_>)| {
            let hidden = if i == 0 { "" } else { " hidden" };
            format!(
                "<figure role=\"tabpanel\" id=\"{id}-{0}\" aria-labelledby=\"{id}-{0}-tab\"{hidden}>\
                 {1}<figcaption>{2}</figcaption></figure>\n",
                figure.kind, figure.html, figure.caption
            )
        };
        let row =
            |(name, value): &(_, String)| format!("<dt>{name}</dt><dd>{}</dd>\n", unbroken(value));
        format!(
            "<section class=\"pair\" id=\"{id}\">\n{}\n<div class=\"parts\">\n{}\n<dl>{}</dl>\n</div>\n\
             <div class=\"figures\">\n<div role=\"tablist\" aria-label=\"Figures\">{}</div>\n{}</div>\n\
             {}</section>",
            self.heading,
            self.player,
            self.rows.iter().map(row).collect::<String>(),
            figures().map(tab).collect::<String>(),
            figures().map(panel).collect::<String>(),
            self.end
        )
    }
}

/// No line breaks between a number and its unit.
fn unbroken(text: &str) -> String {
    let mut before = ' ';
    let mut keep = |letter: char| {
        let kept = match letter {
            ' ' if before.is_ascii_digit() => '\u{a0}',
            _ => letter,
        };
        before = letter;
        kept
    };
    text.chars().map(&mut keep).collect()
}

/// A count, in groups of three digits.
pub(crate) fn grouped(count: usize) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stay_with_their_units() {
        assert_eq!(grouped(7), "7");
        assert_eq!(grouped(256_400), "256\u{202f}400");
        assert_eq!(grouped(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(unbroken("1.5 mm, a joint"), "1.5\u{a0}mm, a joint");
    }
}
