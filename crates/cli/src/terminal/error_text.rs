//! Errors as text.

use std::borrow::Cow;
use std::error::Error;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use sdf_grid::text::shown_lines;

use crate::error::CommandError;

/// An error with all its causes, the line of the scene that it is about, and what helps. In colours
/// on a terminal, unless the text has something that a terminal would obey: names and lines come
/// from files.
pub(crate) fn error_text(error: &CommandError) -> String {
    let plain = render(error, &Renderer::plain());
    match shown_lines(&plain) {
        Cow::Borrowed(_) if console::colors_enabled_stderr() => render(error, &Renderer::styled()),
        Cow::Borrowed(_) => plain,
        Cow::Owned(escaped) => escaped,
    }
}

fn render(error: &CommandError, renderer: &Renderer) -> String {
    let title = error.to_string();
    let causes: Vec<_> = std::iter::successors(error.source(), |e| (*e).source())
        .map(ToString::to_string)
        .collect();
    let title = Level::ERROR.primary_title(title);
    let mut group = match error {
        CommandError::Line(line) => {
            let here = AnnotationKind::Primary
                .span(line.span.clone())
                .label("here");
            let snippet = Snippet::source(&line.text)
                .path(&line.file)
                .annotation(here);
            title.element(snippet)
        }
        _ => Group::with_title(title),
    };
    for cause in causes {
        group = group.element(Level::NOTE.with_name("caused by").message(cause));
    }
    if let Some(help) = error.help() {
        group = group.element(Level::HELP.message(help));
    }
    renderer.render(&[group])
}

#[cfg(test)]
mod tests {
    use super::*;

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
