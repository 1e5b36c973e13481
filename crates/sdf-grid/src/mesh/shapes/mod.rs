//! Shapes made from numbers: the analytic parts of tests, examples and the paper.
//!
//! All are closed, point outwards and share vertices along edges. Lengths are metres; a shape is
//! centred on the origin with its axis, if it has one, along z.

mod bayonet;
mod blocks;
mod guided;
mod peg_in_hole;
mod profiled;
mod random_fit;
mod random_solid;
mod solids;
mod thread;

pub use bayonet::bayonet;
pub use blocks::{blocks, burr};
pub use guided::{captive_ball, dovetail, spool_in_slot};
pub use peg_in_hole::PegInHole;
pub use profiled::{EdgeBreak, Profile, profiled};
pub use random_fit::{FIT_KINDS, RandomFit, random_fit};
pub use random_solid::{RANDOM_KINDS, random_solid};
pub use solids::{cuboid, cylinder, icosphere, plate, prism, torus};
pub use thread::Thread;
