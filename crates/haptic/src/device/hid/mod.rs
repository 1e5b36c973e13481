//! HID devices: those of this machine, and what their reports mean.

#[cfg(test)]
pub(crate) mod fake;
pub mod pid;
pub(crate) mod port;
#[cfg(test)]
mod replay_tests;
pub mod report;
pub mod spacemouse;
mod system;

pub use port::{Connector, Decoder, HidInput, HidPort};
pub use system::{connector, enumerate, open, open_with};
