//! Shared by all connections: the session, the controlling page, and the pair wanted next. The
//! loop's thread never takes its lock.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fft_correlate::Pose;
use serde_json::{Value, json};

use crate::protocol::frame::Frame;
use crate::protocol::request::Request;
use crate::server::access::Access;
use crate::session::content::{Content, docked};
use crate::session::live_session::LiveSession;

/// Shared by all connections.
pub(crate) struct Broadcaster {
    pub(crate) access: Access,
    /// The server ends.
    pub(crate) quit: AtomicBool,
    state: Mutex<State>,
}

/// A message for all pages, with its number: each page gets the newest once.
#[derive(Debug, Clone, Default)]
pub(crate) struct Announcement {
    pub(crate) number: u64,
    pub(crate) text: String,
}

impl Announcement {
    fn set(&mut self, what: &Value) {
        self.number += 1;
        self.text = what.to_string();
    }
}

#[derive(Default)]
struct State {
    live: Option<LiveSession>,
    sessions: u32,
    /// The page that holds the hand.
    holder: Option<u64>,
    /// Pages that are there, and numbers given so far.
    pages: usize,
    numbers: u64,
    pairs: Vec<String>,
    wanted: usize,
    changed: bool,
    docking: bool,
    scene: Announcement,
    docked: Announcement,
}

impl Broadcaster {
    pub(crate) fn new(access: Access, pairs: Vec<String>) -> Self {
        Self {
            access,
            quit: AtomicBool::new(false),
            state: Mutex::new(State {
                pairs,
                ..State::default()
            }),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn must_quit(&self) -> bool {
        self.quit.load(Ordering::Relaxed)
    }

    /// Adds a page and returns its number.
    pub(crate) fn add_page(&self) -> u64 {
        let mut state = self.state();
        state.pages += 1;
        state.numbers += 1;
        state.numbers
    }

    /// Removes a page and, if it was the controlling one, releases control.
    pub(crate) fn remove_page(&self, page: u64) {
        let mut state = self.state();
        state.pages -= 1;
        if state.holder == Some(page) {
            state.holder = None;
            if let Some(live) = &mut state.live {
                live.release_control();
            }
        }
    }

    /// A session begins, with its number; a page that holds the hand already holds it at `start`.
    pub(crate) fn begin_session(&self, start: Pose, make: impl FnOnce(u32) -> LiveSession) {
        let mut state = self.state();
        state.sessions += 1;
        let mut live = make(state.sessions);
        if state.holder.is_some() {
            live.handle(&Request::Hold(start));
        }
        let said = live.description(state.wanted);
        state.scene.set(&said);
        state.docked.set(&json!({ "docked": [] }));
        state.docking = false;
        state.live = Some(live);
    }

    /// The session ended.
    pub(crate) fn end_session(&self) {
        self.state().live = None;
    }

    /// Announces the pair that is being loaded.
    pub(crate) fn announce_loading(&self, pair: usize) {
        let mut state = self.state();
        let title = state.pairs.get(pair).cloned().unwrap_or_default();
        state.scene.set(&json!({ "loading": title, "pair": pair }));
    }

    /// The pair that is wanted, and whether that is news since the last call.
    pub(crate) fn take_wanted(&self) -> (usize, bool) {
        let mut state = self.state();
        (state.wanted, std::mem::take(&mut state.changed))
    }

    /// Whether another pair is wanted.
    pub(crate) fn is_other_wanted(&self) -> bool {
        self.state().changed
    }

    /// The first message to every page.
    pub(crate) fn greeting(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        json!({ "pairs": self.state().pairs, "version": version }).to_string()
    }

    /// The news of the scene and of docking.
    pub(crate) fn announcements(&self) -> [Announcement; 2] {
        let state = self.state();
        [state.scene.clone(), state.docked.clone()]
    }

    /// Numbers of the news, to see without copying whether there is any.
    pub(crate) fn announcement_numbers(&self) -> [u64; 2] {
        let state = self.state();
        [state.scene.number, state.docked.number]
    }

    /// The newest frame for `page`, if there is a session and its loop has begun.
    pub(crate) fn frame(&self, page: u64) -> Option<Frame> {
        let mut state = self.state();
        let (holder, pages) = (state.holder, state.pages);
        let frame = state.live.as_mut()?.frame()?;
        Some(Frame {
            is_hand: holder == Some(page),
            is_held: holder.is_some(),
            pages: u8::try_from(pages).unwrap_or(u8::MAX),
            ..frame
        })
    }

    pub(crate) fn content(&self) -> Option<Arc<dyn Content>> {
        let state = self.state();
        state.live.as_ref().map(|live| Arc::clone(&live.content))
    }

    /// The recording as a CSV log.
    pub(crate) fn log(&self) -> Option<Vec<u8>> {
        let recorder = self.state().live.as_ref().map(|live| live.recorder.clone());
        // Writing to memory does not fail.
        recorder.and_then(|recorder| recorder.csv().ok())
    }

    /// Handles a request of `page`; only the controlling page is obeyed.
    pub(crate) fn handle(self: &Arc<Self>, page: u64, request: &Request) {
        let mut state = self.state();
        if *request == Request::Take && state.holder.is_none() {
            state.holder = Some(page);
            if let Some(live) = &mut state.live {
                live.take_control();
            }
        }
        if state.holder != Some(page) {
            return;
        }
        match request {
            Request::Choose(pair) => {
                let pair = usize::from(*pair);
                if pair < state.pairs.len() && pair != state.wanted {
                    (state.wanted, state.changed) = (pair, true);
                }
            }
            Request::Dock => self.dock(&mut state),
            _ => {
                if let Some(live) = &mut state.live {
                    live.handle(request);
                }
            }
        }
    }

    /// Searches for fits on a thread of its own, one search at a time.
    fn dock(self: &Arc<Self>, state: &mut State) {
        let Some(live) = state.live.as_ref().filter(|_| !state.docking) else {
            return;
        };
        let (number, content) = (live.number, Arc::clone(&live.content));
        let broadcaster = Arc::clone(self);
        let search = move || {
            let said = docked(&*content);
            let mut state = broadcaster.state();
            if state
                .live
                .as_ref()
                .is_some_and(|live| live.number == number)
            {
                state.docking = false;
                state.docked.set(&said);
            }
        };
        let thread = std::thread::Builder::new().name("play-dock".into());
        match thread.spawn(search) {
            Ok(_) => {
                state.docking = true;
                state.docked.set(&json!({ "docking": true }));
            }
            Err(e) => tracing::warn!("no thread to look for fits: {e}"),
        }
    }
}
