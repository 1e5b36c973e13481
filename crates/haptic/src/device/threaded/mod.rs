//! Devices whose input and output block: each half on a thread of its own, the loop sees the
//! newest values only.
//!
//! A write to a HID device can take ten milliseconds; a loop that waited would miss as many ticks.
//! The loop leaves the newest wrench in a mailbox, and the output thread writes what it finds
//! there as fast as the device takes it. If the loop falls silent the output thread stops the
//! device by itself.

pub(crate) mod device;
pub(crate) mod halves;
mod threads;

pub use device::{Cursor, Threaded};
pub use halves::{InputHalf, Motion, OutputHalf, Reading};

#[cfg(test)]
mod tests;
