//! The `pegfit` command from the outside: every command end to end on tiny parts, and every kind of
//! bad input with its exit code and words.

mod assemble;
mod bake;
mod check;
#[cfg(feature = "cloud")]
mod cloud;
mod command_line;
mod common;
mod damage;
mod devices;
mod dock_and_feel;
mod dock_export;
mod interrupt;
mod path;
mod play;
mod plot;
mod scene;
mod scenes;
mod score;
mod screen;
#[cfg(unix)]
mod written;
