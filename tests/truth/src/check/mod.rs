//! Other ways to the same numbers.

pub(crate) mod sampled;
