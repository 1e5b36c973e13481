//! The remote device in a loop.

use fft_correlate::{EnergySource, Response, Scratch};

use super::*;
use crate::config::HapticConfig;
use crate::path::force_path::ForcePath;
use crate::path::sample::{Sample, flags};

/// A wall below z = 0 of 3000 N/m.
struct Wall;

impl EnergySource for Wall {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let deep = (-pose.translation.z).max(0.0);
        Response {
            energy: 1500.0 * deep * deep,
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::Z * (3000.0 * deep),
            },
            coverage: 1.0,
        }
    }
}

/// A wall of 6.4 N about z = 0, and nothing behind it.
struct Rim;

impl EnergySource for Rim {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
        let (height, width) = (0.015, 0.002);
        let z = pose.translation.z;
        let energy = height * (-(z / width).powi(2)).exp();
        Response {
            energy,
            wrench: Wrench {
                torque: DVec3::ZERO,
                force: DVec3::Z * (energy * 2.0 * z / (width * width)),
            },
            coverage: 1.0,
        }
    }
}

struct Bench {
    source: Box<dyn EnergySource>,
    hand: RemoteDevice,
    remote: RemoteControl,
    path: ForcePath,
    ticks: u32,
}

fn bench() -> Bench {
    let config = HapticConfig {
        ramp_s: 0.05,
        ..HapticConfig::default()
    };
    bench_of(Box::new(Wall), OperatorConfig::default(), &config, 0.5)
}

fn bench_of(
    source: Box<dyn EnergySource>,
    body: OperatorConfig,
    config: &HapticConfig,
    scale: f64,
) -> Bench {
    let geometry = Geometry {
        seated: Pose::IDENTITY,
        axis: DVec3::NEG_Z,
        depth: 0.03,
        radius: 0.01,
        tilt: 0.05,
    };
    let workspace = Workspace::new(scale, Pose::IDENTITY, DVec3::new(0.0, 0.01, 0.02));
    let start = Pose::from_translation(DVec3::new(0.01, 0.0, 0.02));
    let (hand, remote) = RemoteDevice::new(body, geometry, workspace, &start, config.times());
    let path = ForcePath::new(hand.spec(), config, workspace, source.scratch()).unwrap();
    Bench {
        source,
        hand,
        remote,
        path,
        ticks: 0,
    }
}

impl Bench {
    fn tick(&mut self) -> Sample {
        self.tick_after(1)
    }

    /// A tick, so many milliseconds after the last.
    fn tick_after(&mut self, milliseconds: u32) -> Sample {
        self.ticks += milliseconds;
        let (now, dt) = (f64::from(self.ticks) * 1e-3, f64::from(milliseconds) * 1e-3);
        let input = self.hand.poll(now).ok();
        let sample = self
            .path
            .step(self.source.as_ref(), input.as_ref(), now, dt);
        self.hand.send(&sample.wrench).unwrap();
        sample
    }

    fn run(&mut self, ticks: u32, beating: bool) -> Sample {
        let mut last = Sample::default();
        for _ in 0..ticks {
            if beating {
                self.remote.heartbeat();
            }
            last = self.tick();
        }
        last
    }
}

fn into_the_wall() -> RemoteCommand {
    RemoteCommand::Hold(Pose::from_translation(DVec3::new(0.0, 0.0, -0.004)))
}

#[test]
fn passes_the_conformance_suite() {
    let mut bench = bench();
    assert!(bench.remote.command(RemoteCommand::Script(Script::Free)));
    crate::device::conformance::check(&mut bench.hand).unwrap();
}

#[test]
fn it_goes_where_it_is_told_and_is_held_by_the_wall() {
    let mut bench = bench();
    let free = Pose::new(
        glam::DQuat::from_rotation_y(0.3),
        DVec3::new(0.0, 0.01, 0.02),
    );
    assert!(bench.remote.command(RemoteCommand::Hold(free)));
    let there = bench.run(1500, true).object;
    assert!((there.translation - free.translation).length() < 1e-4);
    assert!(there.angle_to(&free) < 1e-3);
    assert!(bench.remote.command(into_the_wall()));
    let pushed = bench.run(1500, true);
    // 4 mm into the wall is 8 mm at the device: a grip of 400 N/m and the coupling bend.
    assert!(pushed.wrench.force.z > 1.0, "{:?}", pushed.wrench);
    assert!(pushed.object.translation.z > -0.001);
}

#[test]
fn a_silent_steerer_lets_go_in_time() {
    let mut bench = bench();
    bench.remote.command(into_the_wall());
    assert!(bench.run(1500, true).wrench.force.z > 1.0);
    // Stale after 100 ms, then the decay time of 10 ms.
    let before = bench.run(99, false);
    assert_eq!(before.flags & flags::STALE, 0);
    assert!(before.wrench.force.z > 1.0);
    bench.run(30, false);
    let after = bench.tick();
    assert_ne!(after.flags & flags::STALE, 0);
    assert!(after.wrench.force.length() < 0.2, "{:?}", after.wrench);
    bench.run(300, false);
    assert_eq!(bench.tick().wrench, Wrench::ZERO);
    assert!(bench.hand.body.twist.linear.length() < 1e-3);
}

#[test]
fn a_hand_that_was_told_to_let_go_gives_way() {
    let mut bench = bench();
    bench.remote.command(into_the_wall());
    bench.run(1500, true);
    bench.remote.command(RemoteCommand::LetGo);
    let gone = bench.run(1500, true);
    assert_eq!(gone.flags & flags::STALE, 0);
    assert!(gone.wrench.force.length() < 1e-3, "{:?}", gone.wrench);
    assert!(gone.object.translation.z > -1e-6);
}

/// Pushed against a wall that the operator is too weak for, its force let go in every way there is.
#[test]
fn no_wall_is_crossed_while_forces_come_back() {
    let body = OperatorConfig {
        mass: 0.1,
        damping: 8.0,
        strength: 3.0,
        ..OperatorConfig::default()
    };
    let at = |z: f64| RemoteCommand::Hold(Pose::from_translation(DVec3::new(0.0, 0.0, z)));
    for ramp_s in [0.5, 0.05, 0.0] {
        let config = HapticConfig {
            ramp_s,
            ..HapticConfig::default()
        };
        let mut bench = bench_of(Box::new(Rim), body.clone(), &config, 1.0);
        bench.remote.command(at(-0.03));
        let pushed = bench.run(2000, true);
        assert!(pushed.wrench.force.z > 2.9, "{:?}", pushed.wrench);
        // Silent for longer than the loop waits, then heard again.
        bench.run(400, false);
        bench.remote.command(at(-0.03));
        let again = bench.run(2000, true);
        assert!(again.wrench.force.z > 2.9, "{ramp_s}: {:?}", again.object);
        // The loop is late.
        for _ in 0..5 {
            let late = bench.tick_after(40);
            assert_ne!(late.flags & flags::LATE, 0);
            let held = bench.run(300, true);
            assert!(
                held.object.translation.z > 0.0,
                "{ramp_s}: {:?}",
                held.object
            );
        }
        // Put elsewhere, and off again before the loop believes it.
        bench
            .remote
            .command(RemoteCommand::Place(Pose::from_translation(
                DVec3::Z * 0.06,
            )));
        bench.run(1, true);
        bench.remote.command(at(-0.03));
        let after = bench.run(3000, true);
        assert!(after.wrench.force.z > 2.9, "{ramp_s}: {:?}", after.object);
    }
}

#[test]
fn a_replay_is_where_the_other_hand_was() {
    let mut bench = bench();
    let poses: Vec<Pose> = (0..200)
        .map(|k| Pose::from_translation(DVec3::new(0.01, 1e-5 * f64::from(k), 0.02)))
        .collect();
    bench.remote.command(RemoteCommand::Hold(poses[0]));
    bench.run(1000, true);
    bench
        .remote
        .command(RemoteCommand::Replay(poses.clone().into()));
    for pose in &poses {
        bench.remote.heartbeat();
        let input = bench.tick().input.unwrap();
        let grip = bench.hand.workspace.grip_pose(&input.pose);
        let part = bench.hand.workspace.part_pose(&grip);
        // Rounding.
        assert!((part.translation - pose.translation).length() < 1e-12);
    }
    let last = bench.run(200, true).input.unwrap().pose.translation;
    let wanted = bench.hand.workspace.device_pose(&poses[199]).translation;
    assert!((last - wanted).length() < 1e-6);
}

#[test]
fn a_placed_hand_jumps_and_the_force_comes_back_from_nothing() {
    let mut bench = bench();
    bench.remote.command(into_the_wall());
    assert!(bench.run(1500, true).gain == 1.0);
    let far = Pose::from_translation(DVec3::new(0.0, 0.05, 0.05));
    bench.remote.command(RemoteCommand::Place(far));
    let jumped = bench.run(20, true);
    assert_ne!(jumped.flags & flags::JUMP, 0);
    let there = bench.run(400, true);
    assert_eq!((there.flags & flags::JUMP, there.gain), (0, 1.0));
    assert!((there.object.translation - far.translation).length() < 1e-3);
}

#[test]
fn a_way_is_followed_as_far_as_the_walls_allow_and_its_end_is_held() {
    let mut bench = bench();
    bench.remote.command(into_the_wall());
    bench.run(1500, true);
    let at = |y: f64, z: f64| Pose::from_translation(DVec3::new(0.0, y, z));
    let poses = [at(0.05, 0.02), at(0.05, 0.002), at(0.04, 0.002)];
    let path = TimedPath::new(&poses, &bench.hand.workspace).unwrap();
    bench.remote.command(RemoteCommand::Follow(path.clone()));
    // There at once, without a force, which is back before it moves.
    let jumped = bench.run(20, true);
    assert_ne!(jumped.flags & flags::JUMP, 0);
    let began = bench.run(800, true);
    assert_eq!(began.gain, 1.0);
    assert!((began.object.translation - poses[0].translation).length() < 1e-4);
    let mut turns = f64::INFINITY;
    for _ in 0..(path.seconds() * 1e3) as u32 {
        let part = bench.run(1, true).object.translation;
        turns = turns.min(part.distance(poses[1].translation));
    }
    // Round the corner, not across it.
    assert!(turns < 1e-3, "{turns}");
    let there = bench.run(1000, true);
    assert!((there.object.translation - poses[2].translation).length() < 1e-4);
    assert_eq!(there.flags, 0);
    // A path through the wall: the wall wins.
    let through = TimedPath::new(&[at(0.0, 0.01), at(0.0, -0.004)], &bench.hand.workspace).unwrap();
    bench.remote.command(RemoteCommand::Follow(through));
    let stopped = bench.run(4000, true);
    assert!(stopped.wrench.force.z > 1.0, "{:?}", stopped.wrench);
    assert!(stopped.object.translation.z > -0.001);
    // And a page that falls silent lets go of it.
    bench.run(300, false);
    assert_eq!(bench.tick().wrench, Wrench::ZERO);
}

#[test]
fn nonsense_is_no_order_and_the_workspace_has_an_edge() {
    let mut bench = bench();
    bench.remote.command(RemoteCommand::LetGo);
    for bad in [
        Pose::from_translation(DVec3::new(f64::NAN, 0.0, 0.0)),
        Pose {
            rotation: glam::DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            ..Pose::IDENTITY
        },
    ] {
        assert!(!bench.remote.command(RemoteCommand::Hold(bad)));
        assert!(!bench.remote.command(RemoteCommand::Replay(Arc::new([bad]))));
    }
    assert!(!bench.remote.command(RemoteCommand::Replay(Arc::new([]))));
    bench
        .remote
        .command(RemoteCommand::Hold(Pose::from_translation(DVec3::splat(
            9.0,
        ))));
    let state = bench.run(2000, true).input.unwrap();
    assert_eq!(state.pose.translation, DVec3::splat(0.2));
}
