//! Scores over displacements, where the part belongs, and how it gets there.

pub(crate) mod correlate;
pub(crate) mod dock;
pub(crate) mod path;
