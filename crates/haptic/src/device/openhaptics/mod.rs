//! 3D Systems Touch and SensAble PHANTOM devices, by OpenHaptics' HD library.
//!
//! libHD is loaded when a device is asked for. Its scheduler calls the servo a thousand times a
//! second on a thread of its own; a frame there reads the pose and hands over the newest wrench.
//! Its frame is x right, y up, z towards the user, in millimetres, newtons and newton millimetres.

mod api;
mod device;

pub use device::{PhantomOptions, find, open};
