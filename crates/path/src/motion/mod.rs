//! Screw motions: how far they move a part, and what they are in words.

pub(crate) mod frame;
pub(crate) mod six;
pub(crate) mod words;
