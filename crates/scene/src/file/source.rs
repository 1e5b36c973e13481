//! Errors that show the line of a scene file.

use std::ops::Range;
use std::path::Path;

use crate::error::{LineError, SceneError};

/// The text of a scene file, for errors that show the line.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

impl Source<'_> {
    /// An error at a byte range of the text.
    pub(super) fn error(&self, span: Range<usize>, message: impl Into<String>) -> SceneError {
        let start = span.start.min(self.text.len());
        let before = &self.text.as_bytes()[..start];
        SceneError::Line(Box::new(LineError {
            path: self.path.to_owned(),
            line: before.iter().filter(|&&b| b == b'\n').count() + 1,
            message: message.into(),
            text: self.text.to_owned(),
            span: start..span.end.clamp(start, self.text.len()),
        }))
    }
}
