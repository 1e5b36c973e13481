//! A session whose page is in the same program: in a browser's worker.

use std::sync::Arc;

use fft_correlate::EnergySource;
use haptic::{RemoteDevice, SteppedLoop};
use serde_json::Value;

use crate::error::PlayError;
use crate::protocol::frame::{FRAME_BYTES, Frame};
use crate::protocol::request::Request;
use crate::session::content::{PlaySession, docked};
use crate::session::live_session::LiveSession;
use crate::session::recorder::Recorder;

/// A session without server and threads. Its owner steps the loop and hands messages on: those of
/// `docs/play.md`, as a server would exchange them with its only page, which always holds the hand.
pub struct LocalSession {
    source: Arc<dyn EnergySource>,
    hand: RemoteDevice,
    ticks: SteppedLoop,
    live: LiveSession,
    recorder: Recorder,
    pair: usize,
}

impl LocalSession {
    /// The session of this number, of the pair of that one; `source` is the session's. The hand
    /// holds the part where it begins.
    ///
    /// # Errors
    /// If a setting of the loop is out of range.
    pub fn new(
        session: &PlaySession<'_>,
        source: Arc<dyn EnergySource>,
        number: u32,
        pair: usize,
    ) -> Result<Self, PlayError> {
        let (hand, remote) = session.hand();
        let recorder = Recorder::default();
        let (ticks, viewer) = SteppedLoop::new(
            &session.config,
            session.workspace,
            &session.joints,
            &hand,
            &*source,
        )?;
        let mut live = LiveSession::new(session, number, recorder.clone(), remote, viewer);
        live.handle(&Request::Hold(session.start));
        Ok(Self {
            source,
            hand,
            ticks,
            live,
            recorder,
            pair,
        })
    }

    /// Does the tick that is due; false if none is.
    pub fn step(&mut self) -> bool {
        let Some(sample) = self.ticks.step(&mut self.hand, &*self.source) else {
            return false;
        };
        self.recorder.push(sample);
        true
    }

    /// What the page needs to know, as JSON.
    pub fn description(&self) -> Value {
        self.live.description(self.pair)
    }

    /// Does what a request asks of the loop and the recorder; false if it is none.
    pub fn handle(&mut self, request: &[u8]) -> bool {
        let request = Request::read(request);
        if let Some(request) = &request {
            self.live.handle(request);
        }
        request.is_some()
    }

    /// The newest frame; `None` before the first tick.
    pub fn frame(&mut self) -> Option<[u8; FRAME_BYTES]> {
        let frame = self.live.frame()?;
        let own = Frame {
            is_hand: true,
            is_held: true,
            pages: 1,
            ..frame
        };
        Some(own.bytes())
    }

    /// The bytes called `name`: `log.csv`, or what the content has.
    pub fn bytes(&self, name: &str) -> Option<Vec<u8>> {
        match name {
            // Writing to memory does not fail.
            "log.csv" => self.recorder.csv().ok(),
            name => self.live.content.bytes(name),
        }
    }

    /// Looks for poses in which the part fits, and gives what the page is told, as JSON.
    pub fn dock(&self) -> Value {
        docked(&*self.live.content)
    }
}
