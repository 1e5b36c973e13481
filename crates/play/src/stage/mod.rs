//! What is played: a source of energy, what a page is shown of it, and the loop's tape.

pub(crate) mod exhibits;
pub(crate) mod live;
pub(crate) mod meter;
pub(crate) mod scenery;
pub(crate) mod tape;
