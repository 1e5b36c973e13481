//! Errors as text.

use std::borrow::Cow;
use std::fmt;
use std::io::IsTerminal;

use miette::{Diagnostic, MietteHandler, MietteHandlerOpts, ReportHandler};
use sdf_grid::text::shown_lines;

/// An error with all its causes. In colours where there are any, unless it has something in it that
/// a terminal would obey: names and lines come from files.
pub(crate) fn error_text(error: &dyn Diagnostic) -> String {
    let plain = text(error, options().color(false).build());
    match shown_lines(&plain) {
        Cow::Borrowed(_) => text(error, options().build()),
        Cow::Owned(escaped) => escaped,
    }
}

/// Wraps text for people only: programs get every message on one line.
fn options() -> MietteHandlerOpts {
    MietteHandlerOpts::new()
        .terminal_links(false)
        .wrap_lines(std::io::stderr().is_terminal())
        .break_words(false)
}

fn text(error: &dyn Diagnostic, handler: MietteHandler) -> String {
    struct Text<'e>(&'e dyn Diagnostic, MietteHandler);
    impl fmt::Debug for Text<'_> {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            self.1.debug(self.0, f)
        }
    }
    format!("{:?}", Text(error, handler))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::CommandError;

    #[test]
    fn what_a_terminal_would_obey_is_escaped_in_every_cause() {
        let evil = std::io::Error::other("\u{1b}]0;mine\u{7}");
        let error = CommandError::failure("part\u{1b}[2J.obj", evil);
        let text = error_text(&error);
        for escaped in [r"part\u001b[2J.obj", r"\u001b]0;mine\u0007"] {
            assert!(text.contains(escaped), "{text}");
        }
        assert!(
            text.chars().all(|c| c == '\n' || !c.is_control()),
            "{text:?}"
        );
    }
}
