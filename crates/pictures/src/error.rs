//! Why there is no picture.

/// A picture that could not be drawn or encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw {what}: {reason}")]
pub struct PictureError {
    /// Which picture.
    pub what: String,
    /// The drawing library's reason.
    pub reason: String,
}
