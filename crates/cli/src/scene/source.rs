//! Errors that show the line of a scene file.

use std::ops::Range;
use std::path::Path;

use miette::{NamedSource, SourceSpan};

use crate::error::{CommandError, SceneFileError};

/// The text of a scene file, for errors that show the line.
pub(crate) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

impl Source<'_> {
    /// An error at a byte range of the text.
    pub(crate) fn error(&self, span: Range<usize>, message: impl Into<String>) -> CommandError {
        let start = span.start.min(self.text.len());
        let line = self.text.as_bytes()[..start]
            .iter()
            .filter(|&&b| b == b'\n')
            .count()
            + 1;
        CommandError::Scene(Box::new(SceneFileError {
            file: self.path.display().to_string(),
            line,
            message: message.into(),
            text: NamedSource::new(self.path.display().to_string(), self.text.to_owned()),
            span: SourceSpan::from(start..span.end.min(self.text.len())),
        }))
    }
}
