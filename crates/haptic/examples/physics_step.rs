//! The force path inside a simulation's own step, without the loop's thread or clock:
//! `cargo run -p haptic --example physics_step`.

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{DeviceState, ForcePath, HapticConfig, OperatorConfig, Workspace};

/// A slot along x whose walls push with 4 N.
struct Slot;

impl EnergySource for Slot {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let y = pose.translation.y;
        Response {
            energy: 4.0 * y.abs(),
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::new(0.0, -4.0 * y.signum(), 0.0),
            },
            coverage: 1.0,
        }
    }
}

fn main() -> Result<(), haptic::ConfigError> {
    let workspace = Workspace::new(1.0, Pose::IDENTITY, DVec3::ZERO);
    let spec = OperatorConfig::default().spec();
    let mut path = ForcePath::new(&spec, &HapticConfig::default(), workspace, Slot.scratch())?;
    // A body of 0.2 kg thrown across the slot, held by nothing but the slot.
    let (mut position, mut velocity) = (DVec3::new(0.0, 0.003, 0.0), DVec3::new(0.1, 0.0, 0.0));
    let dt = 1e-3;
    for step in 0..2000 {
        let now = f64::from(step) * dt;
        let state = DeviceState::at_rest(Pose::from_translation(position), now);
        let sample = path.step(&Slot, Some(&state), now, dt);
        velocity += (sample.wrench.force / 0.2 - velocity * 10.0) * dt;
        position += velocity * dt;
        if step % 200 == 0 {
            println!("{now:.1} s  {:7.3} mm off the slot", position.y * 1e3);
        }
    }
    Ok(())
}
