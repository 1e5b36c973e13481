//! From a way found step by step to one that is short, apart from the walls, and told.

pub(crate) mod climb;
pub(crate) mod connect;
pub(crate) mod fewer;
pub(crate) mod relax;
pub(crate) mod shorten;
pub(crate) mod steps;
