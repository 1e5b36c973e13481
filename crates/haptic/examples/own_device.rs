//! A loop with a device and an energy of your own: `cargo run -p haptic --example own_device`.
//!
//! The device here is a finger that presses a button along -z; replace its `poll` and `send` with
//! those of your hardware, and the energy with a table or a direct evaluator of `fft_correlate`.

use std::sync::atomic::AtomicBool;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HandConfig, HapticConfig, Session,
    Workspace,
};

struct Finger {
    spec: DeviceSpec,
}

impl Device for Finger {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let depth = 0.004 * (now * std::f64::consts::TAU).sin();
        let pose = Pose::from_translation(DVec3::new(0.0, 0.0, -depth));
        Ok(DeviceState::at(pose, now))
    }

    fn send(&mut self, _wrench: &Wrench) -> Result<(), DeviceError> {
        Ok(()) // to your motors
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        Ok(()) // motors off
    }
}

/// A floor that pushes back with 3 N.
struct Floor;

impl EnergySource for Floor {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let z = pose.translation.z;
        let push = if z < 0.0 { 3.0 } else { 0.0 };
        Response {
            energy: -z * push,
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::new(0.0, 0.0, push),
            },
            coverage: 1.0,
        }
    }
}

fn main() -> Result<(), haptic::HapticError> {
    let spec = DeviceSpec {
        name: "finger".into(),
        ..HandConfig::default().spec()
    };
    let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
    let stop = AtomicBool::new(false); // set it from a signal handler
    let outcome = Session::new(HapticConfig::default(), workspace).run(
        &mut Finger { spec },
        &Floor,
        Clock::Real,
        2.0,
        &stop,
    )?;
    println!("{:#?}", outcome.report);
    Ok(())
}
