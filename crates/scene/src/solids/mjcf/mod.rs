//! MJCF, the models of MuJoCo.
//!
//! Defaults, classes, fitted shapes and generated bodies make the format more than a reader of its own
//! can follow: MuJoCo compiles the model where it is installed. Without it a file is read only if
//! every word of it that could change a solid is known.

mod chosen;
mod compiled;
mod known;
pub(crate) mod options;
mod plain;
pub(crate) mod read;
