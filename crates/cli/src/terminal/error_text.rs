//! Errors as text.

use std::error::Error;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use sdf_grid::text::shown_lines;
use serde_json::json;

use crate::error::CommandError;

/// An error with all its causes, the line of the scene that it is about, and what helps; in colours
/// on a terminal. Characters that act on a terminal are escaped: names and lines come from files.
pub(crate) fn error_text(error: &CommandError) -> String {
    let renderer = match console::colors_enabled_stderr() {
        true => Renderer::styled(),
        false => Renderer::plain(),
    };
    let title = error.to_string();
    let title = Level::ERROR.primary_title(shown_lines(&title));
    let mut group = match error {
        CommandError::Line(line) => {
            let here = AnnotationKind::Primary.span(line.span.clone());
            let snippet = Snippet::source(&line.text)
                .path(shown_lines(&line.file))
                .annotation(here.label("here"));
            title.element(snippet)
        }
        _ => Group::with_title(title),
    };
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = shown_lines(&error.to_string()).into_owned();
        group = group.element(Level::NOTE.with_name("caused by").message(text));
        cause = error.source();
    }
    if let Some(help) = error.help() {
        group = group.element(Level::HELP.message(shown_lines(help)));
    }
    renderer.render(&[group])
}

/// The same for programs, in one line: `error` has `message`, `causes`, `help` (or null), `exit` and, of
/// a value that is not acceptable, `file`, `item`, `expected` and `found`.
pub(crate) fn error_json(error: &CommandError) -> String {
    let mut causes: Vec<String> = Vec::new();
    let mut cause = error.source();
    while let Some(error) = cause {
        causes.push(error.to_string());
        cause = error.source();
    }
    let mut said = json!({
        "message": error.to_string(),
        "causes": causes,
        "help": error.help(),
        "exit": error.exit() as u8,
    });
    match error {
        CommandError::Input {
            file,
            item,
            expected,
            found,
        } => {
            said["file"] = json!(file);
            said["item"] = json!(item);
            said["expected"] = json!(expected);
            said["found"] = json!(found);
        }
        CommandError::Line(line) => {
            said["file"] = json!(line.file);
            said["bytes"] = json!([line.span.start, line.span.end]);
        }
        _ => {}
    }
    json!({ "error": said }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn programs_get_what_people_read() {
        let error = CommandError::option("--top", "1 to 100", 0);
        let found: serde_json::Value = serde_json::from_str(&error_json(&error)).unwrap();
        let found = &found["error"];
        assert_eq!(found["message"], error.to_string());
        assert_eq!(found["found"], "0");
        assert_eq!(found["exit"], 2);
        assert!(found["help"].is_null());
    }

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
