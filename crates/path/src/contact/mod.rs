//! How far two solids are apart, where, and the nearest pose at which they do not overlap.

pub(crate) mod body;
pub(crate) mod features;
pub(crate) mod gaps;
pub(crate) mod settle;
pub(crate) mod solid;
