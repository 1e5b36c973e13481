//! Pages that need no other file: one head, one style, and helpers for text, tables and charts.

use pegfit_pictures::{COLOURS, PictureError};

const STYLE: &str = include_str!("page.css");

/// Width and height of a chart where there is room.
pub(crate) const CHART: (u32, u32) = (960, 310);

/// The same on a telephone: type keeps its size.
const NARROW: (u32, u32) = (380, 280);

/// A drawing for a page at `size` and for a telephone: `draw` gives an SVG element of a width and a
/// height, and the page shows the one that fits.
///
/// # Errors
/// If it cannot be drawn.
pub(crate) fn chart(
    size: (u32, u32),
    draw: impl Fn((u32, u32)) -> Result<String, PictureError>,
) -> Result<String, PictureError> {
    let (wide, narrow) = (draw(size)?, draw(NARROW)?);
    Ok(format!(
        "<div class=\"drawn wide\">{wide}</div>\n<div class=\"drawn narrow\">{narrow}</div>\n"
    ))
}

/// A page that is being written.
pub(crate) struct Page(String);

impl Page {
    /// A page with a title, which is text, as its heading.
    pub(crate) fn new(title: &str) -> Self {
        let title = escaped(title);
        Self(format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{COLOURS}{STYLE}</style>\n<main>\n<h1>{title}</h1>\n"
        ))
    }

    /// Adds HTML.
    pub(crate) fn push(&mut self, html: &str) {
        self.0 += html;
        self.0.push('\n');
    }

    /// Adds a paragraph, which is HTML.
    pub(crate) fn paragraph(&mut self, html: &str) {
        self.push(&format!("<p>{html}</p>"));
    }

    /// Adds a table of cells that are HTML, with a head unless it is empty; all columns but the first
    /// are numbers if `numbers`. A table without rows is a word. On a telephone tables are scrolled,
    /// not the page.
    pub(crate) fn table(
        &mut self,
        numbers: bool,
        head: &[&str],
        rows: impl IntoIterator<Item = Vec<String>>,
    ) {
        let class = if numbers { " class=\"num\"" } else { "" };
        let cells = |name: &str, texts: &[&str]| {
            let first = format!("<{name}>{}</{name}>", texts[0]);
            let cell = |text: &&str| format!("<{name}{class}>{text}</{name}>");
            format!(
                "<tr>{first}{}</tr>\n",
                texts[1..].iter().map(cell).collect::<String>()
            )
        };
        let mut rows = rows.into_iter().peekable();
        if rows.peek().is_none() {
            return self.paragraph("None.");
        }
        self.push("<div class=\"table\"><table>");
        if !head.is_empty() {
            self.0 += &cells("th", head);
        }
        for row in rows {
            let row: Vec<&str> = row.iter().map(String::as_str).collect();
            self.0 += &cells("td", &row);
        }
        self.push("</table></div>");
    }

    /// Adds what `add` adds, folded behind a heading, which is HTML; gives what `add` gives.
    pub(crate) fn folded<T>(&mut self, heading: &str, add: impl FnOnce(&mut Self) -> T) -> T {
        self.push(&format!("<details>\n<summary>{heading}</summary>"));
        let given = add(self);
        self.push("</details>");
        given
    }

    /// The page as HTML, with a script at its end.
    pub(crate) fn finish(self, script: &str) -> String {
        let script = match script {
            "" => String::new(),
            _ => format!("<script>\n{script}</script>\n"),
        };
        format!("{}</main>\n{script}</html>\n", self.0)
    }
}

/// Text that may stand in HTML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('\'', "&#39;")
        .replace('"', "&quot;")
}
