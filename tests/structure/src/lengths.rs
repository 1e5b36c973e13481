//! How long files are, counted in lines of source as rustfmt lays it out.

/// Lines of a file's text without inline unit tests.
pub fn file_length(text: &str) -> usize {
    let mut lines = text.lines().peekable();
    std::iter::from_fn(|| {
        let line = lines.next()?;
        let tests = line == "#[cfg(test)]"
            && lines
                .peek()
                .is_some_and(|next| next.starts_with("mod ") && next.ends_with('{'));
        (!tests).then_some(line)
    })
    .count()
}
