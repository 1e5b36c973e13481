//! Devices that take a wrench and give an input in one go, on a thread of their own: that of a
//! maker's scheduler, or one that asks a driver or a service in turn.
//!
//! The loop leaves the newest wrench in a mailbox and finds the newest input in another; every
//! exchange with the device goes through [`link::Link::turn`], which is where forces end: when the
//! loop says stop, when it falls silent, and until a device that was away has had time to rise.

pub(crate) mod device;
pub(crate) mod link;
pub(crate) mod pull;
pub(crate) mod turn;

#[cfg(test)]
mod tests;
