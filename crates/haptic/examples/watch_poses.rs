//! Poses of a running loop, seen from another thread: `cargo run -p haptic --example watch_poses`.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Geometry, HapticConfig, OperatorConfig, Script, Session, SimulatedOperator, Workspace,
};

/// A bowl whose middle attracts with 100 N/m.
struct Bowl;

impl EnergySource for Bowl {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let p = pose.translation;
        Response {
            energy: 50.0 * p.length_squared(),
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: p * -100.0,
            },
            coverage: 1.0,
        }
    }
}

fn main() -> Result<(), haptic::HapticError> {
    let geometry = Geometry {
        seated: Pose::IDENTITY,
        axis: DVec3::NEG_Z,
        depth: 0.03,
        radius: 0.01,
        tilt: 0.0,
    };
    let workspace = Workspace::new(1.0, geometry.seated, DVec3::ZERO);
    let mut hand =
        SimulatedOperator::new(OperatorConfig::default(), Script::Free, geometry, workspace);
    let mut session = Session::new(HapticConfig::default(), workspace);
    let mut viewer = session.viewer();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                let now = viewer.newest();
                let p = now.object.translation * 1e3;
                let force = now.wrench.force.length();
                println!("{:6.3} s  {p:7.2} mm  {force:5.2} N", now.time);
                std::thread::sleep(Duration::from_millis(100));
            }
        });
        let outcome = session.run(&mut hand, &Bowl, Clock::Real, 2.0, &done);
        done.store(true, Ordering::Relaxed);
        println!("{:.0} ticks per second", outcome?.report.rate_hz);
        Ok(())
    })
}
