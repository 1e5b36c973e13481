//! 1 kHz haptic rendering of an assembly energy.
//!
//! ```text
//! device -> gate -> virtual coupling <-> energy source
//!                        |
//!              passivity controller -> limits -> device
//! ```
//!
//! [`Session`] runs that at a fixed rate on a thread of its own, or as fast as it can in simulated
//! time; [`ForcePath`] is one tick of it as a plain struct. Forces are newtons on the handle,
//! torques newton metres about it; poses are metres and unit quaternions.

mod box_tree;
mod bundle;
pub mod config;
pub mod conformance;
pub mod coupling;
mod csv_log;
pub mod device;
pub mod gate;
pub mod hid;
pub mod hid_report;
mod insertion;
pub mod io_thread;
mod keeper;
pub mod limiter;
pub mod live;
mod pace;
#[path = "scene/pair_loading.rs"]
pub mod pair_loading;
pub mod passivity;
pub mod path;
pub mod pid;
pub mod realtime;
pub mod record;
pub mod replay;
pub mod report;
mod rotations;
pub mod sample;
pub mod scene;
pub mod script;
pub mod servo;
pub mod simulated;
pub mod spacemouse;
pub mod sum;
pub mod workspace;

pub use config::{ConfigError, HapticConfig};
pub use device::{Device, DeviceError, DeviceSpec, DeviceState};
pub use limiter::Limiter;
pub use live::LiveSource;
pub use passivity::EnergyAccount;
pub use path::ForcePath;
pub use record::RecordError;
pub use replay::{Replay, read_log};
pub use report::{Clock, LoopReport, Outcome, Quantiles};
pub use sample::{Sample, flags};
pub use scene::{LiveScene, PairSpec, SceneOptions};
pub use script::{Geometry, Script};
pub use servo::{HapticError, Session, Viewer};
pub use simulated::{HandConfig, SimulatedHand};
pub use sum::{Placed, SumSource};
pub use workspace::Workspace;
