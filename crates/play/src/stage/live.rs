//! The stage that is being played, as pages see it and steer it.

use std::sync::Arc;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use fft_correlate::{Pose, Wrench};
use haptic::{Geometry, Order, Script, Steering, View, Viewer, Way, Workspace};

use crate::stage::exhibits::Exhibits;
use crate::stage::meter::Meter;
use crate::stage::tape::Tape;
use crate::wire::frame::Frame;
use crate::wire::request::Request;

/// The stage that is being played, as pages see it and steer it.
pub(crate) struct Live {
    pub(crate) number: u32,
    pub(crate) exhibits: Arc<dyn Exhibits>,
    pub(crate) tape: Tape,
    pub(crate) steering: Steering,
    pub(crate) viewer: Viewer,
    pub(crate) workspace: Workspace,
    pub(crate) geometry: Geometry,
    pub(crate) way: Option<Way>,
    pub(crate) meter: Meter,
    /// As [`Frame::doing`].
    pub(crate) doing: u8,
}

impl Live {
    /// Does what the page that holds the hand asks of the hand or the tape.
    pub(crate) fn obey(&mut self, request: &Request) {
        let (order, doing) = match request {
            Request::Beat => return self.steering.beat(),
            Request::Hold(pose) => (Order::Hold(*pose), 1),
            Request::Place(pose) => (Order::Place(*pose), 1),
            Request::LetGo => (Order::LetGo, 0),
            Request::Script(script) => {
                let doing = match script {
                    Script::Collision => 2,
                    Script::Snap | Script::Free => 3,
                };
                (Order::Script(*script), doing)
            }
            Request::Record(on) => return self.tape.record(*on),
            Request::Replay => {
                self.tape.record(false);
                (Order::Replay(self.tape.poses(&self.workspace).into()), 4)
            }
            Request::Follow => match &self.way {
                Some(way) => (Order::Follow(way.clone()), 5),
                None => return,
            },
            Request::Take | Request::Choose(_) | Request::Dock => return,
        };
        if self.steering.order(order) {
            self.doing = doing;
        }
    }

    /// A new page holds the hand: it stays where it is.
    pub(crate) fn take(&mut self) {
        let view = *self.viewer.view();
        let hand = self.hand(&view);
        self.obey(&Request::Hold(hand));
    }

    /// Nobody holds the hand any more. Without signs of life it is stale in a moment.
    pub(crate) fn leave(&mut self) {
        self.doing = 0;
    }

    /// Where the hand would have the part; where the part is if the hand has not been heard of.
    fn hand(&self, view: &View) -> Pose {
        match &view.sample.input {
            Some(input) => {
                let grip = self.workspace.grip_pose(&input.pose);
                self.workspace.part_pose(&grip)
            }
            None => view.sample.object,
        }
    }

    /// What is to be seen now; nothing before the first tick.
    pub(crate) fn frame(&mut self) -> Option<Frame> {
        let view = *self.viewer.view();
        let at = view.at?;
        let means = self.meter.look(at, &view.timing);
        let (is_recording, recorded) = self.tape.length();
        let (sample, timing) = (&view.sample, &view.timing);
        let Geometry {
            seated,
            axis,
            depth,
            ..
        } = self.geometry;
        let grip = self.workspace.grip;
        let from_seat = sample.object.apply(grip) - seated.apply(grip);
        let micros = |nanoseconds: u64| nanoseconds as f64 * 1e-3;
        Some(Frame {
            is_hand: false,
            flags: sample.flags,
            stage: self.number,
            time: sample.time,
            wall: milliseconds(at),
            hand: self.hand(&view),
            object: sample.object,
            wrench: in_scene(&self.workspace, &sample.wrench),
            energy: sample.energy,
            coverage: sample.coverage,
            gain: sample.gain,
            depth: from_seat.dot(axis) + depth,
            rate: means.rate,
            latency: [means.latency, micros(timing.worst_latency)],
            lateness: [means.lateness, micros(timing.worst_lateness)],
            recorded,
            ticks: timing.ticks,
            missed: timing.missed,
            doing: self.doing,
            pages: 0,
            is_held: false,
            is_recording,
            flagged: view.flagged,
        })
    }
}

/// What the hand feels, along the scene's axes.
fn in_scene(workspace: &Workspace, wrench: &Wrench) -> Wrench {
    Wrench {
        torque: workspace.axes * wrench.torque,
        force: workspace.axes * wrench.force,
    }
}

/// Milliseconds since 1970 of a moment that is past.
fn milliseconds(at: Instant) -> f64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let age = at.elapsed();
    now.map_or(0.0, |now| (now.as_secs_f64() - age.as_secs_f64()) * 1e3)
}
