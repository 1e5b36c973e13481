//! How long functions and files are, counted in lines of source as rustfmt lays it out.

/// Functions of a file's text with the number of lines from `fn` to the closing brace; unit tests
/// at the end of the file are left out.
pub fn function_lengths(text: &str) -> Vec<(String, usize)> {
    let lines: Vec<&str> = product(text).collect();
    let mut found = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let Some(name) = function(line) else { continue };
        let indent = &line[..line.len() - line.trim_start().len()];
        let closing = format!("{indent}}}");
        let head = lines[first..].iter();
        let Some(last) = head.clone().position(|l| l.ends_with(['{', ';', '}'])) else {
            continue;
        };
        let length = match lines[first + last].ends_with('{') {
            true => lines[first..].iter().position(|l| *l == closing),
            // Without a body, or all on one line.
            false => Some(last),
        };
        found.push((
            name.to_owned(),
            length.map_or(lines.len() - first, |n| n + 1),
        ));
    }
    found
}

/// The lines before inline unit tests.
fn product(text: &str) -> impl Iterator<Item = &str> {
    let mut lines = text.lines().peekable();
    std::iter::from_fn(move || {
        let line = lines.next()?;
        let tests = line == "#[cfg(test)]"
            && lines
                .peek()
                .is_some_and(|next| next.starts_with("mod ") && next.ends_with('{'));
        (!tests).then_some(line)
    })
}

/// Lines of a file's text without inline unit tests.
pub fn file_length(text: &str) -> usize {
    product(text).count()
}

/// The name of the function that a line begins.
fn function(line: &str) -> Option<&str> {
    let (before, after) = line.split_once("fn ")?;
    let word = |w: &str| {
        w.starts_with("pub")
            || w.starts_with('"')
            || ["const", "unsafe", "async", "extern"].contains(&w)
    };
    // `pub(in a::b)` is not written here.
    if !before.split_whitespace().all(word) {
        return None;
    }
    let end = after.find(|c: char| !c.is_alphanumeric() && c != '_')?;
    (end > 0).then_some(&after[..end])
}
