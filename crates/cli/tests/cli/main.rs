//! The `pegfit` command from the outside: every command end to end on tiny parts, and every kind of
//! bad input with its exit code and words.

mod bake;
mod check;
#[cfg(feature = "cloud")]
mod cloud;
mod command_page;
mod common;
mod devices;
mod disassemble;
mod dock_and_feel;
mod extremes;
mod field;
mod interrupt;
mod kill;
mod launched;
mod path;
mod placed;
mod play;
mod plot;
mod scene;
mod scene_formats;
mod scenes;
mod score;
mod sealed;
mod terminal;
#[cfg(unix)]
mod written;
