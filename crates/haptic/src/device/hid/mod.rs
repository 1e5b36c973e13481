//! HID devices: those of this machine, and what their reports mean.

#[cfg(test)]
pub(crate) mod fake;
pub mod pid;
pub(crate) mod port;
#[cfg(test)]
mod replay_tests;
pub mod report;
pub mod spacemouse;
#[cfg(not(target_family = "wasm"))]
mod system;

pub use port::{Connector, Decoder, HidInput, HidPort};
#[cfg(not(target_family = "wasm"))]
pub use system::{connector, enumerate, open, open_with};
