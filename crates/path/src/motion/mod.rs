//! Screw motions of a part: their size, and their description in words.

pub(crate) mod describe;
pub(crate) mod frame;
pub(crate) mod vec6;
