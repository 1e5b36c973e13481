//! 1 kHz haptic rendering of an assembly energy.
//!
//! ```text
//! device -> gate -> virtual coupling <-> energy source
//!                        |
//!              passivity controller -> limits -> device
//! ```
//!
//! [`Session`] runs that at a fixed rate on a thread of its own, or as fast as it can in simulated
//! time; [`SteppedLoop`] where there are no threads; [`ForcePath`] is one tick of it as a plain
//! struct. Forces are newtons on the handle,
//! torques newton metres about it; poses are metres and unit quaternions.
//!
//! [`device`] is what the loop pushes, [`path`] the parts of one tick, [`log`] what every tick
//! leaves, and [`scene`] the energy of many fixed parts, loaded while the loop runs.

mod config;
pub mod device;
pub mod log;
mod panics;
pub mod path;
mod run;
pub mod scene;

pub use config::{ConfigError, CouplingConfig, HapticConfig, LimitConfig, PassivityConfig};
pub use device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
pub use device::remote::{LoopTimes, RemoteCommand, RemoteControl, RemoteDevice};
pub use device::script::{Geometry, Script};
pub use device::simulated::{OperatorConfig, SimulatedOperator};
pub use device::timed_path::TimedPath;
pub use device::workspace::Workspace;
pub use log::csv::read_log;
pub use log::error::RecordError;
pub use log::replay::Replay;
pub use path::body_force::{BodyForce, BodyState, BodyStep};
pub use path::force_path::ForcePath;
pub use path::joint_guide::GuidedJoint;
pub use path::limiter::Limiter;
pub use path::passivity::EnergyAccount;
pub use path::sample::{Sample, flags};
pub use run::pace::Clock;
pub use run::realtime::RealtimeGrant;
pub use run::report::{LoopReport, Outcome, Quantiles, Timing, View};
pub use run::session::{HapticError, Session, Viewer};
pub use run::stepped::SteppedLoop;
pub use scene::live_scene::LiveScene;
pub use scene::live_source::LiveSource;
pub use scene::pair::PairSpec;
pub use scene::residency::SceneOptions;
pub use scene::sum::{PlacedSource, SharedSource, SumSource};
