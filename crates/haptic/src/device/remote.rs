//! A device without hardware that another thread controls: a page, a program, a recording. Without
//! heartbeats it lets go.

use std::sync::Arc;

use fft_correlate::{Pose, Wrench};
use glam::DVec3;
use triple_buffer::{Input, Output};

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::device::script::{Geometry, Script};
use crate::device::simulated::{OperatorBody, OperatorConfig, Target};
use crate::device::timed_path::TimedPath;
use crate::device::workspace::Workspace;

/// Grip of an operator that has let go.
const LOOSE: f64 = 0.02;

/// Ticks after which the loop believes a jump, and a few more.
const JUMP_TICKS: f64 = 52.0;

/// A command for a remote device. Poses are those of the moving part in the scene, held as the
/// workspace says.
///
/// See the example of [`RemoteDevice`].
#[derive(Debug, Clone, Default)]
pub enum RemoteCommand {
    /// Stay where it is, holding nothing.
    #[default]
    LetGo,
    /// Go to a pose, as a spring pulls, and hold it.
    Hold(Pose),
    /// Be at a pose at once. The loop takes that for a jump: the force is let go and rises again.
    Place(Pose),
    /// Do what a script says, from its beginning.
    Script(Script),
    /// Replay poses, one per tick of the loop, then stay at the last one.
    Replay(Arc<[Pose]>),
    /// Be at the beginning of a path, as [`RemoteCommand::Place`], then follow it as a spring
    /// pulls, and hold its end.
    Follow(TimedPath),
}

/// What goes from [`RemoteControl`] to [`RemoteDevice`].
#[derive(Debug, Clone, Default)]
struct Message {
    order: RemoteCommand,
    /// Counts commands.
    number: u64,
    /// Counts heartbeats.
    beat: u64,
}

/// The controlling end of a [`RemoteDevice`]; belongs to one thread at a time.
///
/// See the example of [`RemoteDevice`].
#[derive(Debug)]
pub struct RemoteControl {
    input: Input<Message>,
    message: Message,
}

impl RemoteControl {
    /// Sends a command, which is a heartbeat too. A pose that is not finite, or whose quaternion
    /// is none of a rotation, is ignored; false then.
    pub fn command(&mut self, order: RemoteCommand) -> bool {
        let valid = match &order {
            RemoteCommand::Hold(pose) | RemoteCommand::Place(pose) => pose.is_valid(),
            RemoteCommand::Replay(poses) => !poses.is_empty() && poses.iter().all(Pose::is_valid),
            RemoteCommand::LetGo | RemoteCommand::Script(_) | RemoteCommand::Follow(_) => true,
        };
        if valid {
            self.message.order = order;
            self.message.number += 1;
            self.heartbeat();
        }
        valid
    }

    /// A heartbeat: without one for `stale_s` the device lets go.
    pub fn heartbeat(&mut self) {
        self.message.beat += 1;
        self.input.write(self.message.clone());
    }
}

/// A simulated operator, a mass on a spring, that follows commands.
///
/// It stamps its input with the time of the last heartbeat: to the loop a silent controller is a
/// stale input. It also lets go by itself after the same time.
///
/// While the loop's force is reduced, the operator's strength is reduced by the same share: at full
/// strength it would go through every wall meanwhile.
///
/// ```
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::*;
///
/// let config = HapticConfig::default();
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let (seated, axis) = (Pose::IDENTITY, -DVec3::Z);
/// let geometry = Geometry { seated, axis, depth: 0.03, radius: 0.01, tilt: 0.08 };
/// let (mut device, mut control) =
///     RemoteDevice::new(OperatorConfig::default(), geometry, workspace, &seated, config.times());
/// // Another thread puts the part 1 cm above the fit.
/// let above = Pose::from_translation(DVec3::Z * 0.01);
/// assert!(control.command(RemoteCommand::Place(above)));
/// assert!((device.poll(0.001)?.pose.translation.z - 0.01).abs() < 1e-6);
/// let nowhere = Pose::from_translation(DVec3::NAN);
/// assert!(!control.command(RemoteCommand::Hold(nowhere)));
/// # Ok::<(), DeviceError>(())
/// ```
#[derive(Debug)]
pub struct RemoteDevice {
    config: OperatorConfig,
    spec: DeviceSpec,
    workspace: Workspace,
    geometry: Geometry,
    times: LoopTimes,
    orders: Output<Message>,
    body: OperatorBody,
    number: u64,
    beat: u64,
    /// When the last heartbeat came, and when the current command began.
    heard: Option<f64>,
    began: f64,
    polls: usize,
    /// When it was polled last, and when its strength begins to come back.
    polled: f64,
    firm_from: f64,
}

/// Times of the loop that a remote device needs, seconds.
///
/// ```
/// use haptic::HapticConfig;
///
/// let times = HapticConfig::default().times();
/// assert_eq!((times.period, times.stale, times.ramp), (0.001, 0.1, 0.5));
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopTimes {
    /// From one tick to the next.
    pub period: f64,
    /// A longer gap between two ticks is a fault.
    pub late: f64,
    /// An older input is a fault.
    pub stale: f64,
    /// In which a force rises from nothing after a fault.
    pub ramp: f64,
}

impl RemoteDevice {
    /// A device at rest at `start`, a pose of the part, and its control. The loop's times say after
    /// which silence it lets go, and how soon it is as strong as before.
    pub fn new(
        config: OperatorConfig,
        geometry: Geometry,
        workspace: Workspace,
        start: &Pose,
        times: LoopTimes,
    ) -> (Self, RemoteControl) {
        let (input, orders) = triple_buffer::triple_buffer(&Message::default());
        let hand = Self {
            spec: DeviceSpec {
                name: "steered hand".into(),
                ..config.spec()
            },
            config,
            workspace,
            geometry,
            times,
            orders,
            body: OperatorBody::at_rest(workspace.device_pose(start)),
            number: 0,
            beat: 0,
            heard: None,
            began: 0.0,
            polls: 0,
            polled: f64::NEG_INFINITY,
            firm_from: 0.0,
        };
        let message = Message::default();
        (hand, RemoteControl { input, message })
    }

    /// Reads the messages since the last poll.
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

    fn is_silent(&self, now: f64) -> bool {
        self.heard
            .is_none_or(|heard| now - heard > self.times.stale)
    }

    /// Its share of its strength, 0 ..= 1: none where the loop shows no force, all where it does.
    fn share(&mut self, now: f64) -> f64 {
        if self.is_silent(now) || now - self.polled > self.times.late {
            self.firm_from = now;
        }
        self.polled = now;
        if now < self.firm_from {
            return 0.0;
        }
        // Without a ramp forces are back at once.
        ((now - self.firm_from) / self.times.ramp.max(1e-9)).min(1.0)
    }

    /// What it wants: the part's pose and the grip; `None` for nothing at all.
    fn target(&self, now: f64) -> Option<(Pose, f64)> {
        if self.is_silent(now) {
            return None;
        }
        match &self.orders.output_buffer().order {
            RemoteCommand::LetGo => None,
            RemoteCommand::Hold(pose) | RemoteCommand::Place(pose) => Some((*pose, 1.0)),
            RemoteCommand::Script(script) => {
                let c = &self.config;
                let reach = c.push / c.stiffness * self.workspace.scale;
                let time = now - self.began;
                let intent = script.intent(&self.geometry, time, c.duration, reach, c.seed);
                Some((intent.pose, intent.grip))
            }
            RemoteCommand::Replay(poses) => poses.last().map(|pose| (*pose, 1.0)),
            RemoteCommand::Follow(path) => Some((path.at(now - self.began), 1.0)),
        }
    }

    /// Where the order wants it to be at once, whatever pulls.
    fn immediate_pose(&self) -> Option<Pose> {
        let pose = match &self.orders.output_buffer().order {
            RemoteCommand::Place(pose) if self.polls == 0 => Some(pose),
            RemoteCommand::Replay(poses) => poses.get(self.polls),
            RemoteCommand::Follow(path) if self.polls == 0 => Some(path.first()),
            _ => None,
        };
        pose.map(|pose| self.workspace.device_pose(pose))
    }

    /// Moves on to `now`.
    fn follow(&mut self, now: f64) {
        let share = self.share(now);
        let Some((part, grip)) = self.target(now) else {
            let pull = Target {
                pose: self.body.pose,
                grip: LOOSE,
            };
            return self.body.follow(now, &self.config, |_| pull);
        };
        match self.immediate_pose() {
            Some(pose) => {
                self.firm_from = now + JUMP_TICKS * self.times.period;
                self.body.move_to(now, pose);
            }
            None => {
                let pose = self.workspace.device_pose(&part);
                let grip = share * grip;
                self.body
                    .follow(now, &self.config, |_| Target { pose, grip });
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

impl Device for RemoteDevice {
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
#[path = "remote_tests.rs"]
mod tests;
