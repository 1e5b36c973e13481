//! A hand without hardware that is told from another thread where to go: by a page, a program, a
//! recording. Whoever steers it has to be heard again and again, or it lets go.

use std::sync::Arc;

use fft_correlate::{Pose, Wrench};
use glam::DVec3;
use triple_buffer::{Input, Output};

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::device::hand_body::{HandBody, HandConfig, Pull};
use crate::device::script::{Geometry, Script};
use crate::device::way::Way;
use crate::device::workspace::Workspace;

/// Strength of a hand that has let go.
const LOOSE: f64 = 0.02;

/// What a steered hand is to do. Poses are those of the moving part in the scene, held as the
/// workspace says.
#[derive(Debug, Clone, Default)]
pub enum Order {
    /// Stay where it is, holding nothing.
    #[default]
    LetGo,
    /// Go to a pose, as a spring pulls, and hold it.
    Hold(Pose),
    /// Be at a pose at once. The loop takes that for a jump: the force is let go and rises again.
    Place(Pose),
    /// Do what a script says, from its beginning.
    Script(Script),
    /// Be where another hand was, a pose per tick of the loop, then stay at the last one.
    Replay(Arc<[Pose]>),
    /// Be where a way begins, as [`Order::Place`], then go along it as a spring pulls, and hold
    /// its end.
    Follow(Way),
}

/// What goes from [`Steering`] to [`SteeredHand`].
#[derive(Debug, Clone, Default)]
struct Message {
    order: Order,
    /// Counts orders.
    number: u64,
    /// Counts signs of life.
    beat: u64,
}

/// The end that steers; belongs to one thread at a time.
#[derive(Debug)]
pub struct Steering {
    input: Input<Message>,
    message: Message,
}

impl Steering {
    /// Gives an order, which is a sign of life too. A pose that is not finite, or whose quaternion
    /// is none of a rotation, is ignored; false then.
    pub fn order(&mut self, order: Order) -> bool {
        let valid = match &order {
            Order::Hold(pose) | Order::Place(pose) => pose.is_valid(),
            Order::Replay(poses) => !poses.is_empty() && poses.iter().all(Pose::is_valid),
            Order::LetGo | Order::Script(_) | Order::Follow(_) => true,
        };
        if valid {
            self.message.order = order;
            self.message.number += 1;
            self.beat();
        }
        valid
    }

    /// A sign of life: without any for `stale_s` the hand lets go.
    pub fn beat(&mut self) {
        self.message.beat += 1;
        self.input.write(self.message.clone());
    }
}

/// A mass-spring hand that follows orders.
///
/// It stamps its input with the time of the last sign of life, so that a silent steerer is what a
/// silent device is to the loop: stale. It also lets go itself, after the same time.
#[derive(Debug)]
pub struct SteeredHand {
    config: HandConfig,
    spec: DeviceSpec,
    workspace: Workspace,
    geometry: Geometry,
    stale: f64,
    orders: Output<Message>,
    body: HandBody,
    number: u64,
    beat: u64,
    /// When the last sign of life was heard, and when the order at hand began.
    heard: Option<f64>,
    began: f64,
    polls: usize,
}

impl SteeredHand {
    /// A hand at rest at `start`, a pose of the part, and what steers it. It lets go after `stale`
    /// seconds without a sign of life.
    pub fn new(
        config: HandConfig,
        geometry: Geometry,
        workspace: Workspace,
        start: &Pose,
        stale: f64,
    ) -> (Self, Steering) {
        let (input, orders) = triple_buffer::triple_buffer(&Message::default());
        let hand = Self {
            spec: DeviceSpec {
                name: "steered hand".into(),
                ..config.spec()
            },
            config,
            workspace,
            geometry,
            stale,
            orders,
            body: HandBody::at(workspace.device_pose(start)),
            number: 0,
            beat: 0,
            heard: None,
            began: 0.0,
            polls: 0,
        };
        let message = Message::default();
        (hand, Steering { input, message })
    }

    /// Takes in what was said since the last poll.
    fn listen(&mut self, now: f64) {
        let message = self.orders.read();
        if message.beat != self.beat {
            self.beat = message.beat;
            self.heard = Some(now);
        }
        self.polls += 1;
        if message.number != self.number {
            self.number = message.number;
            self.began = now;
            self.polls = 0;
        }
    }

    /// What it wants: the part's pose and the grip; `None` for nothing at all.
    fn wanted(&self, now: f64) -> Option<(Pose, f64)> {
        if self.heard.is_none_or(|heard| now - heard > self.stale) {
            return None;
        }
        match &self.orders.output_buffer().order {
            Order::LetGo => None,
            Order::Hold(pose) | Order::Place(pose) => Some((*pose, 1.0)),
            Order::Script(script) => {
                let c = &self.config;
                let reach = c.push / c.stiffness * self.workspace.scale;
                let time = now - self.began;
                let intent = script.intent(&self.geometry, time, c.duration, reach, c.seed);
                Some((intent.pose, intent.grip))
            }
            Order::Replay(poses) => poses.last().map(|pose| (*pose, 1.0)),
            Order::Follow(way) => Some((way.at(now - self.began), 1.0)),
        }
    }

    /// Where the order wants it to be at once, whatever pulls.
    fn put(&self) -> Option<Pose> {
        let pose = match &self.orders.output_buffer().order {
            Order::Place(pose) if self.polls == 0 => Some(pose),
            Order::Replay(poses) => poses.get(self.polls),
            Order::Follow(way) if self.polls == 0 => Some(way.first()),
            _ => None,
        };
        pose.map(|pose| self.workspace.device_pose(pose))
    }

    /// Moves on to `now`.
    fn follow(&mut self, now: f64) {
        let Some((part, grip)) = self.wanted(now) else {
            let pull = Pull {
                pose: self.body.pose,
                grip: LOOSE,
            };
            return self.body.follow(now, &self.config, |_| pull);
        };
        match self.put() {
            Some(pose) => self.body.put(now, pose),
            None => {
                let pose = self.workspace.device_pose(&part);
                self.body.follow(now, &self.config, |_| Pull { pose, grip });
            }
        }
    }

    /// Nowhere it could not be: at an edge of the workspace it stops.
    fn confine(&mut self) {
        let edge = DVec3::splat(self.spec.workspace / 2.0);
        let free = self.body.pose.translation;
        let kept = free.clamp(-edge, edge);
        if kept != free {
            self.body.pose.translation = kept;
            let out = free.cmplt(-edge) | free.cmpgt(edge);
            self.body.twist.linear = DVec3::select(out, DVec3::ZERO, self.body.twist.linear);
        }
    }
}

impl Device for SteeredHand {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        self.listen(now);
        self.follow(now);
        self.confine();
        let Some(timestamp) = self.heard else {
            return Err(DeviceError::NoInput);
        };
        Ok(DeviceState {
            pose: self.body.pose,
            twist: self.body.twist,
            buttons: 0,
            timestamp,
        })
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.body.wrench = *wrench;
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.body.wrench = Wrench::ZERO;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
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

    struct Bench {
        hand: SteeredHand,
        steering: Steering,
        path: ForcePath,
        ticks: u32,
    }

    fn bench() -> Bench {
        let config = HapticConfig {
            ramp_s: 0.05,
            ..HapticConfig::default()
        };
        let geometry = Geometry {
            seated: Pose::IDENTITY,
            axis: DVec3::NEG_Z,
            depth: 0.03,
            radius: 0.01,
            tilt: 0.05,
        };
        let workspace = Workspace::new(0.5, Pose::IDENTITY, DVec3::new(0.0, 0.01, 0.02));
        let start = Pose::from_translation(DVec3::new(0.01, 0.0, 0.02));
        let (hand, steering) = SteeredHand::new(
            HandConfig::default(),
            geometry,
            workspace,
            &start,
            config.stale_s,
        );
        let path = ForcePath::new(hand.spec(), &config, workspace, Wall.scratch()).unwrap();
        Bench {
            hand,
            steering,
            path,
            ticks: 0,
        }
    }

    impl Bench {
        fn tick(&mut self) -> Sample {
            let now = f64::from(self.ticks) * 1e-3;
            self.ticks += 1;
            let input = self.hand.poll(now).ok();
            let sample = self.path.step(&Wall, input.as_ref(), now, 1e-3);
            self.hand.send(&sample.wrench).unwrap();
            sample
        }

        fn run(&mut self, ticks: u32, beating: bool) -> Sample {
            let mut last = Sample::default();
            for _ in 0..ticks {
                if beating {
                    self.steering.beat();
                }
                last = self.tick();
            }
            last
        }
    }

    fn into_the_wall() -> Order {
        Order::Hold(Pose::from_translation(DVec3::new(0.0, 0.0, -0.004)))
    }

    #[test]
    fn passes_the_conformance_suite() {
        let mut bench = bench();
        assert!(bench.steering.order(Order::Script(Script::Free)));
        crate::device::conformance::check(&mut bench.hand).unwrap();
    }

    #[test]
    fn it_goes_where_it_is_told_and_is_held_by_the_wall() {
        let mut bench = bench();
        let free = Pose::new(
            glam::DQuat::from_rotation_y(0.3),
            DVec3::new(0.0, 0.01, 0.02),
        );
        assert!(bench.steering.order(Order::Hold(free)));
        let there = bench.run(1500, true).object;
        assert!((there.translation - free.translation).length() < 1e-4);
        assert!(there.angle_to(&free) < 1e-3);
        assert!(bench.steering.order(into_the_wall()));
        let pushed = bench.run(1500, true);
        // 4 mm into the wall is 8 mm at the device: a grip of 400 N/m and the coupling bend.
        assert!(pushed.wrench.force.z > 1.0, "{:?}", pushed.wrench);
        assert!(pushed.object.translation.z > -0.001);
    }

    #[test]
    fn a_silent_steerer_lets_go_in_time() {
        let mut bench = bench();
        bench.steering.order(into_the_wall());
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
        bench.steering.order(into_the_wall());
        bench.run(1500, true);
        bench.steering.order(Order::LetGo);
        let gone = bench.run(1500, true);
        assert_eq!(gone.flags & flags::STALE, 0);
        assert!(gone.wrench.force.length() < 1e-3, "{:?}", gone.wrench);
        assert!(gone.object.translation.z > -1e-6);
    }

    #[test]
    fn a_replay_is_where_the_other_hand_was() {
        let mut bench = bench();
        let poses: Vec<Pose> = (0..200)
            .map(|k| Pose::from_translation(DVec3::new(0.01, 1e-5 * f64::from(k), 0.02)))
            .collect();
        bench.steering.order(Order::Hold(poses[0]));
        bench.run(1000, true);
        bench.steering.order(Order::Replay(poses.clone().into()));
        for pose in &poses {
            bench.steering.beat();
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
        bench.steering.order(into_the_wall());
        assert!(bench.run(1500, true).gain == 1.0);
        let far = Pose::from_translation(DVec3::new(0.0, 0.05, 0.05));
        bench.steering.order(Order::Place(far));
        let jumped = bench.run(20, true);
        assert_ne!(jumped.flags & flags::JUMP, 0);
        let there = bench.run(400, true);
        assert_eq!((there.flags & flags::JUMP, there.gain), (0, 1.0));
        assert!((there.object.translation - far.translation).length() < 1e-3);
    }

    #[test]
    fn a_way_is_followed_as_far_as_the_walls_allow_and_its_end_is_held() {
        let mut bench = bench();
        bench.steering.order(into_the_wall());
        bench.run(1500, true);
        let at = |y: f64, z: f64| Pose::from_translation(DVec3::new(0.0, y, z));
        let poses = [at(0.05, 0.02), at(0.05, 0.002), at(0.04, 0.002)];
        let way = Way::new(&poses, &bench.hand.workspace).unwrap();
        bench.steering.order(Order::Follow(way.clone()));
        // There at once, without a force, which is back before it moves.
        let jumped = bench.run(20, true);
        assert_ne!(jumped.flags & flags::JUMP, 0);
        let began = bench.run(800, true);
        assert_eq!(began.gain, 1.0);
        assert!((began.object.translation - poses[0].translation).length() < 1e-4);
        let mut turns = f64::INFINITY;
        for _ in 0..(way.seconds() * 1e3) as u32 {
            let part = bench.run(1, true).object.translation;
            turns = turns.min(part.distance(poses[1].translation));
        }
        // Round the corner, not across it.
        assert!(turns < 1e-3, "{turns}");
        let there = bench.run(1000, true);
        assert!((there.object.translation - poses[2].translation).length() < 1e-4);
        assert_eq!(there.flags, 0);
        // A way through the wall: the wall wins.
        let through = Way::new(&[at(0.0, 0.01), at(0.0, -0.004)], &bench.hand.workspace).unwrap();
        bench.steering.order(Order::Follow(through));
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
        bench.steering.order(Order::LetGo);
        for bad in [
            Pose::from_translation(DVec3::new(f64::NAN, 0.0, 0.0)),
            Pose {
                rotation: glam::DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
                ..Pose::IDENTITY
            },
        ] {
            assert!(!bench.steering.order(Order::Hold(bad)));
            assert!(!bench.steering.order(Order::Replay(Arc::new([bad]))));
        }
        assert!(!bench.steering.order(Order::Replay(Arc::new([]))));
        bench
            .steering
            .order(Order::Hold(Pose::from_translation(DVec3::splat(9.0))));
        let state = bench.run(2000, true).input.unwrap();
        assert_eq!(state.pose.translation, DVec3::splat(0.2));
    }
}
