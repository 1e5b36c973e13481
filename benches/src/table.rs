//! Tables of results: on the screen, as CSV, and as parts of the page `docs/report.md`.

pub use sdf_grid::text::significant;
use std::fmt::Write as _;
use std::path::Path;

use crate::Outcome;

/// One table, its cells as they are shown everywhere.
#[derive(Debug, Clone)]
pub struct Table {
    /// File name without ending.
    pub name: String,
    /// Above it.
    pub title: String,
    /// What was measured, against what, and how to read it, in words.
    pub about: String,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    pub fn new(name: &str, title: &str, about: &str, columns: &[&str]) -> Self {
        Self {
            name: name.into(),
            title: title.into(),
            about: about.into(),
            columns: columns.iter().map(ToString::to_string).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If it has more or fewer cells than there are columns.
    pub fn push(&mut self, cells: impl IntoIterator<Item = String>) {
        let cells: Vec<String> = cells.into_iter().collect();
        assert_eq!(cells.len(), self.columns.len(), "a cell per column");
        self.rows.push(cells);
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// As plain text: columns as wide as they need, numbers to the right.
    pub fn to_text(&self) -> String {
        let mut text = format!("\n{}\n", self.title);
        let wide: Vec<usize> = (0..self.columns.len())
            .map(|c| {
                let cells = self.rows.iter().map(|r| r[c].chars().count());
                cells.fold(self.columns[c].chars().count(), usize::max)
            })
            .collect();
        for row in std::iter::once(&self.columns).chain(&self.rows) {
            for (c, cell) in row.iter().enumerate() {
                let (wide, gap) = (wide[c], if c == 0 { "" } else { "  " });
                let _ = match self.is_numeric(c) {
                    true => write!(text, "{gap}{cell:>wide$}"),
                    false => write!(text, "{gap}{cell:<wide$}"),
                };
            }
            text.truncate(text.trim_end().len());
            text.push('\n');
        }
        text
    }

    /// As a part of a page; `picture` is a file beside it.
    pub fn to_markdown(&self, picture: Option<&str>) -> String {
        let mut page = format!("### {}\n\n{}\n\n", self.title, wrapped(&self.about));
        if let Some(file) = picture {
            let _ = write!(page, "![{}]({file})\n\n", self.name);
        }
        let line = |cells: &[String]| {
            let safe = cells.iter().map(|c| c.replace('|', "\\|"));
            format!("| {} |\n", safe.collect::<Vec<_>>().join(" | "))
        };
        page += &line(&self.columns);
        for c in 0..self.columns.len() {
            page += if self.is_numeric(c) { "|---:" } else { "|---" };
        }
        page += "|\n";
        self.rows.iter().for_each(|row| page += &line(row));
        page.push('\n');
        page
    }

    /// Writes columns and rows to a file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_csv(&self, file: &Path) -> Outcome<()> {
        let mut csv = csv::Writer::from_path(file)?;
        csv.write_record(&self.columns)?;
        self.rows.iter().try_for_each(|row| csv.write_record(row))?;
        Ok(csv.flush()?)
    }

    /// Whether a column holds numbers, or nothing where there is none.
    fn is_numeric(&self, column: usize) -> bool {
        let plain = |cell: &str| cell.is_empty() || cell == "-" || cell.parse::<f64>().is_ok();
        self.rows.iter().all(|row| plain(&row[column]))
    }
}

/// A share in percent, three digits.
pub fn percent(share: f64) -> String {
    significant(100.0 * share, 3)
}

/// Words in lines of at most 100 characters.
pub fn wrapped(words: &str) -> String {
    let mut text = String::new();
    let mut line = 0;
    for word in words.split_whitespace() {
        let length = word.chars().count();
        if line > 0 {
            let fits = line + 1 + length <= 100;
            text.push(if fits { ' ' } else { '\n' });
            line = if fits { line + 1 } else { 0 };
        }
        text += word;
        line += length;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        let cases = [
            (0.0, "0"),
            (0.001_234, "0.00123"),
            (-12.345, "-12.3"),
            (123_456.0, "123456"),
            (1.234e-6, "1.23e-6"),
            (5.678e8, "5.68e8"),
            (f64::INFINITY, "inf"),
        ];
        for (value, text) in cases {
            assert_eq!(significant(value, 3), text);
        }
    }

    #[test]
    fn pages_and_screens_show_the_same_cells() {
        let mut table = Table::new("t", "Title", "Words.", &["mesh", "error"]);
        table.push(["a|b".into(), "1.5".into()]);
        table.push(["c".into(), String::new()]);
        let page = "### Title\n\nWords.\n\n![t](t.png)\n\n\
                    | mesh | error |\n|---|---:|\n| a\\|b | 1.5 |\n| c |  |\n\n";
        assert_eq!(table.to_markdown(Some("t.png")), page);
        assert_eq!(table.to_text(), "\nTitle\nmesh  error\na|b     1.5\nc\n");
    }

    #[test]
    fn lines_are_at_most_100_characters() {
        let text = wrapped(&"nine char ".repeat(50));
        assert!(text.lines().count() > 4, "{text}");
        assert!(
            text.lines()
                .all(|l| (85..=100).contains(&l.len()) || text.ends_with(l))
        );
    }
}
