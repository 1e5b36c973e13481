//! Errors fit to be printed: control characters in names from files are shown as such.

use std::error::Error;
use std::fmt;

use miette::{Diagnostic, LabeledSpan, Severity, SourceCode};
use sdf_grid::text::shown_lines;

use crate::error::CommandError;

/// An error of a command, its message and those of its causes fit to be printed.
#[derive(Debug)]
pub struct ShownError {
    error: CommandError,
    said: Said,
}

/// A message and what caused it.
#[derive(Debug)]
struct Said {
    message: String,
    cause: Option<Box<Self>>,
}

impl Said {
    fn of(error: &dyn Error) -> Self {
        Self {
            message: shown_lines(&error.to_string()).into_owned(),
            cause: error.source().map(|cause| Box::new(Self::of(cause))),
        }
    }
}

impl From<CommandError> for ShownError {
    fn from(error: CommandError) -> Self {
        let said = Said::of(&error);
        Self { error, said }
    }
}

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl fmt::Display for ShownError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.said.fmt(f)
    }
}

impl Error for Said {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &dyn Error)
    }
}

impl Error for ShownError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.said.source()
    }
}

impl Diagnostic for ShownError {
    fn code(&self) -> Option<Box<dyn fmt::Display + '_>> {
        self.error.code()
    }

    fn severity(&self) -> Option<Severity> {
        self.error.severity()
    }

    fn help(&self) -> Option<Box<dyn fmt::Display + '_>> {
        let help = self.error.help()?.to_string();
        Some(Box::new(shown_lines(&help).into_owned()))
    }

    fn url(&self) -> Option<Box<dyn fmt::Display + '_>> {
        self.error.url()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.error.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.error.labels()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn escapes_in_names_are_shown_in_messages_and_their_causes() {
        let error = CommandError::Io {
            action: "read",
            path: "lid\x1b[2J.obj".into(),
            source: std::io::Error::other("no\u{9b}31m"),
        };
        let shown = ShownError::from(error);
        assert_eq!(shown.to_string(), "cannot read lid\\u{1b}[2J.obj");
        let cause = shown.source().map(ToString::to_string);
        assert_eq!(cause.as_deref(), Some("no\\u{9b}31m"));
    }
}
