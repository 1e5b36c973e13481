//! Why a session could not run or end well.

use crate::config::ConfigError;
use crate::device::contract::DeviceError;
use crate::log::error::RecordError;

/// Why a session could not run or end well.
#[derive(Debug, thiserror::Error)]
pub enum HapticError {
    /// A setting is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The log could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The loop thread could not be started.
    #[error("the loop thread could not be started: {0}")]
    Thread(std::io::Error),
    /// Something in a tick panicked; the device was stopped.
    #[error("the loop panicked and the device was stopped: {0}")]
    Panicked(String),
    /// The device could not be told to stop.
    #[error("the device may still push: {0}")]
    NotStopped(DeviceError),
}
