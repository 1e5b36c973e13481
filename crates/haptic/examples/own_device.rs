//! A table felt through a device of your own: `pegfit bake scene.toml -o peg.zarr`, then
//! `cargo run --release -p haptic --example own_device peg.zarr`. The device here is a finger that
//! goes up and down along z; replace its `poll` and `send` with those of your hardware.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use fft_correlate::{Pose, TableStore, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, OperatorConfig, Session,
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
        Ok(DeviceState::at_rest(pose, now))
    }

    fn send(&mut self, _wrench: &Wrench) -> Result<(), DeviceError> {
        Ok(()) // to your motors
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        Ok(()) // motors off
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1).ok_or("which table?")?;
    // At most a gibibyte of it.
    let table = TableStore::open(Path::new(&path))?.load(1 << 30)?;
    let spec = DeviceSpec {
        name: "finger".into(),
        ..OperatorConfig::default().spec()
    };
    // The device's origin is where the parts were placed: the fit, unless the scene says otherwise.
    let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
    let stop = AtomicBool::new(false); // set it from a signal handler
    let outcome = Session::new(HapticConfig::default(), workspace).run(
        &mut Finger { spec },
        &table,
        Clock::Real,
        2.0,
        &stop,
    )?;
    println!("{:#?}", outcome.report);
    Ok(())
}
