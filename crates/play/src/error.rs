//! Why a page could not be served, or the loop not run on it.

use std::net::SocketAddr;

use haptic::{ConfigError, HapticError};
use pegfit_scene::SceneError;

/// Why a page could not be served, or the loop not run on it.
#[derive(Debug, thiserror::Error)]
pub enum PlayError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The system gave no random numbers for a token.
    #[error("no random numbers for the page's token: {0}")]
    Token(String),
    /// The system gave no thread.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
    /// The loop could not run, or not end well.
    #[error(transparent)]
    Loop(#[from] HapticError),
    /// A setting of the loop is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The scene cannot be shown.
    #[error(transparent)]
    Scene(Box<SceneError>),
}

impl From<SceneError> for PlayError {
    fn from(error: SceneError) -> Self {
        Self::Scene(Box::new(error))
    }
}
