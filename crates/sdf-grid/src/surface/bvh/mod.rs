//! One bounding volume hierarchy for nearest distance, winding number and density.
//!
//! Inside, coordinates are normalized in f64: `q = (p - centre) * scale` with `scale` a power of
//! two that brings the part's largest extent into `(1, 2]`. All public functions speak metres.

pub(crate) mod build;
pub(crate) mod tree;
