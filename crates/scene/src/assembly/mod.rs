//! A scene ready to be scored, and what is asked of it around its fit.

pub(crate) mod loaded;
pub(crate) mod profile;
