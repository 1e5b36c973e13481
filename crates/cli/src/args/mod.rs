//! The command line: what may be typed, and what it means.

mod command_line;
pub mod device_choice;
mod manual_args;
mod scene_args;
mod ways;

pub use command_line::*;
pub use manual_args::{CompletionsArgs, ManArgs};
pub use scene_args::SceneArgs;
pub use ways::*;
