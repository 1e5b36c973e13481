//! What the log and the report say of a hand that leaves a table.

use crate::common::workspace;
use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{DeviceState, ForcePath, HapticConfig, OperatorConfig, flags};

/// A slope of 1 N that is known below 10 mm, fades up to 30 mm, and is gone from there.
struct Edge;

impl EnergySource for Edge {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let x = pose.translation.x;
        let left = ((0.03 - x) / 0.02).clamp(0.0, 1.0);
        Response {
            energy: if left == 1.0 {
                0.01 - (x - 0.01)
            } else {
                0.01 * left
            },
            wrench: Wrench {
                force: DVec3::X * if left == 1.0 { 1.0 } else { 0.5 * left.ceil() },
                ..Wrench::ZERO
            },
            coverage: if x <= 0.01 { 1.0 } else { 0.0 },
        }
    }
}

#[test]
fn ticks_outside_a_table_are_marked_while_something_is_felt() {
    let spec = OperatorConfig::default().spec();
    let config = HapticConfig {
        ramp_s: 0.01,
        ..HapticConfig::default()
    };
    let mut path = ForcePath::new(&spec, &config, workspace(), Edge.scratch()).unwrap();
    let (mut outside, mut elsewhere) = (0, 0);
    for tick in 0..500u32 {
        let time = f64::from(tick) * 1e-3;
        let at = Pose::from_translation(DVec3::X * (0.1 * time));
        let input = DeviceState::at_rest(at, time);
        let sample = path.step(&Edge, Some(&input), time, 1e-3);
        let x = sample.object.translation.x;
        let marked = sample.flags & flags::OUTSIDE != 0;
        if (0.0105..0.0295).contains(&x) {
            assert!(marked, "{x} m");
            outside += 1;
        } else if !(0.0095..0.0305).contains(&x) {
            assert!(!marked, "{x} m");
            elsewhere += 1;
        }
    }
    assert!(outside > 100 && elsewhere > 200, "{outside} {elsewhere}");
    assert_eq!(
        flags::NAMES[flags::OUTSIDE.trailing_zeros() as usize],
        "outside"
    );
}
