//! The running session, as pages see and control it.

use std::sync::Arc;

use fft_correlate::{Pose, Wrench};
use haptic::{Geometry, RemoteCommand, RemoteControl, Script, TimedPath, View, Viewer, Workspace};
use serde_json::{Value, json};
use web_time::{Instant, SystemTime, UNIX_EPOCH};

use crate::protocol::frame::Frame;
use crate::protocol::request::Request;
use crate::session::content::{Content, PlaySession};
use crate::session::rate_meter::RateMeter;
use crate::session::recorder::Recorder;

/// The running session, as pages see and control it.
pub(crate) struct LiveSession {
    pub(crate) number: u32,
    pub(crate) content: Arc<dyn Content>,
    pub(crate) recorder: Recorder,
    pub(crate) remote: RemoteControl,
    pub(crate) viewer: Viewer,
    pub(crate) workspace: Workspace,
    pub(crate) geometry: Geometry,
    pub(crate) path: Option<TimedPath>,
    pub(crate) meter: RateMeter,
    /// As [`Frame::doing`].
    pub(crate) doing: u8,
}

impl LiveSession {
    /// The session of this number, whose loop is about to begin.
    pub(crate) fn new(
        session: &PlaySession<'_>,
        number: u32,
        recorder: Recorder,
        remote: RemoteControl,
        viewer: Viewer,
    ) -> Self {
        Self {
            number,
            content: Arc::clone(&session.content),
            recorder,
            remote,
            viewer,
            workspace: session.workspace,
            geometry: session.geometry,
            path: session.path.clone(),
            meter: RateMeter::default(),
            doing: 0,
        }
    }

    /// What a page needs to know of it, the number of its pair included.
    pub(crate) fn description(&self, pair: usize) -> Value {
        let mut said = self.content.description();
        if !said.is_object() {
            said = json!({});
        }
        said["stage"] = json!(self.number);
        said["pair"] = json!(pair);
        said["path"] = json!(self.path.is_some());
        said
    }

    /// Handles a request of the controlling page to the remote device or the recorder.
    pub(crate) fn handle(&mut self, request: &Request) {
        let (order, doing) = match request {
            Request::Heartbeat => return self.remote.heartbeat(),
            Request::Hold(pose) => (RemoteCommand::Hold(*pose), 1),
            Request::Place(pose) => (RemoteCommand::Place(*pose), 1),
            Request::LetGo => (RemoteCommand::LetGo, 0),
            Request::Script(script) => {
                let doing = match script {
                    Script::Collision => 2,
                    Script::Snap | Script::Free => 3,
                };
                (RemoteCommand::Script(*script), doing)
            }
            Request::Record(on) => return self.recorder.record(*on),
            Request::Replay => {
                self.recorder.record(false);
                (
                    RemoteCommand::Replay(self.recorder.poses(&self.workspace).into()),
                    4,
                )
            }
            Request::Follow => match &self.path {
                Some(path) => (RemoteCommand::Follow(path.clone()), 5),
                None => return,
            },
            Request::Take | Request::Choose(_) | Request::Dock => return,
        };
        if self.remote.command(order) {
            self.doing = doing;
        }
    }

    #[cfg(not(target_family = "wasm"))]
    /// A new page takes control: the handle stays where it is.
    pub(crate) fn take_control(&mut self) {
        let view = *self.viewer.view();
        let hand = self.hand(&view);
        self.handle(&Request::Hold(hand));
    }

    #[cfg(not(target_family = "wasm"))]
    /// No page has control any more. Without heartbeats the input becomes stale. Its recording ends:
    /// nobody else could.
    pub(crate) fn release_control(&mut self) {
        self.doing = 0;
        self.recorder.record(false);
    }

    /// The part's pose at the handle; its actual pose before the first input.
    fn hand(&self, view: &View) -> Pose {
        match &view.sample.input {
            Some(input) => {
                let grip = self.workspace.grip_pose(&input.pose);
                self.workspace.part_pose(&grip)
            }
            None => view.sample.object,
        }
    }

    /// The newest frame; `None` before the first tick.
    pub(crate) fn frame(&mut self) -> Option<Frame> {
        let view = *self.viewer.view();
        let at = view.at?;
        let means = self.meter.update(at, &view.timing);
        let (is_recording, recorded) = self.recorder.length();
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
            session: self.number,
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

/// A wrench on the handle, along the scene's axes.
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
