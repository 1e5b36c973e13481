//! Force Dimension devices (omega, delta, sigma, lambda) and the Novint Falcon, by the Force
//! Dimension SDK's DHD library.
//!
//! libdhd is loaded when a device is asked for; a servo thread reads the pose and hands over the
//! newest wrench some two thousand times a second. Its frame is x towards the user, y right, z up,
//! in metres, newtons and newton metres.

mod api;
mod device;

pub use device::{DhdOptions, find, open};
