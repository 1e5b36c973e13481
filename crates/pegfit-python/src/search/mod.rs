//! Scores over displacements, and where the part belongs.

pub(crate) mod correlate;
pub(crate) mod dock;
