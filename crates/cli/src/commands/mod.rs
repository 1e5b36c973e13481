//! The commands: from parsed arguments through validation to library calls and printed results.

mod bake;
mod check;
mod demo;
mod devices;
mod disassemble;
mod dock;
mod examples;
mod feel;
mod field;
mod fits;
mod hand;
mod manual;
mod path;
mod play;
mod plot;
mod resume;
mod run;
mod scene;
mod scenes;
mod score;
mod stored;
mod table;
mod tolerance;
mod verify;

pub use run::run;
