//! What all connections share: the stage, who holds the hand, what is wanted next. The loop's thread
//! never comes here.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fft_correlate::Pose;
use serde_json::{Value, json};

use crate::server::access::Access;
use crate::stage::exhibits::Exhibits;
use crate::stage::live::Live;
use crate::wire::frame::Frame;
use crate::wire::request::Request;

/// What all connections share.
pub(crate) struct Hub {
    pub(crate) access: Access,
    /// The server ends.
    pub(crate) quit: AtomicBool,
    state: Mutex<State>,
}

/// A message for all pages, with its number: each page gets the newest once.
#[derive(Debug, Clone, Default)]
pub(crate) struct News {
    pub(crate) number: u64,
    pub(crate) text: String,
}

impl News {
    fn tell(&mut self, what: &Value) {
        self.number += 1;
        self.text = what.to_string();
    }
}

#[derive(Default)]
struct State {
    live: Option<Live>,
    stages: u32,
    /// The page that holds the hand.
    holder: Option<u64>,
    /// Pages that are there, and numbers given so far.
    pages: usize,
    numbers: u64,
    pairs: Vec<String>,
    wanted: usize,
    changed: bool,
    docking: bool,
    scene: News,
    docked: News,
}

impl Hub {
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

    pub(crate) fn quits(&self) -> bool {
        self.quit.load(Ordering::Relaxed)
    }

    /// A page is there; its number.
    pub(crate) fn enter(&self) -> u64 {
        let mut state = self.state();
        state.pages += 1;
        state.numbers += 1;
        state.numbers
    }

    /// A page is gone; if it held the hand, nobody does.
    pub(crate) fn leave(&self, page: u64) {
        let mut state = self.state();
        state.pages -= 1;
        if state.holder == Some(page) {
            state.holder = None;
            if let Some(live) = &mut state.live {
                live.leave();
            }
        }
    }

    /// A stage begins, with its number; a page that holds the hand already holds it at `start`.
    pub(crate) fn begin(&self, start: Pose, make: impl FnOnce(u32) -> Live) {
        let mut state = self.state();
        state.stages += 1;
        let mut live = make(state.stages);
        if state.holder.is_some() {
            live.obey(&Request::Hold(start));
        }
        let mut said = live.exhibits.description();
        if !said.is_object() {
            said = json!({});
        }
        said["stage"] = json!(live.number);
        said["pair"] = json!(state.wanted);
        said["way"] = json!(live.way.is_some());
        state.scene.tell(&said);
        state.docked.tell(&json!({ "docked": [] }));
        state.docking = false;
        state.live = Some(live);
    }

    /// The stage ended.
    pub(crate) fn end(&self) {
        self.state().live = None;
    }

    /// Says what is being loaded.
    pub(crate) fn loading(&self, pair: usize) {
        let mut state = self.state();
        let title = state.pairs.get(pair).cloned().unwrap_or_default();
        state.scene.tell(&json!({ "loading": title, "pair": pair }));
    }

    /// The pair that is wanted, and whether that is news since the last call.
    pub(crate) fn wanted(&self) -> (usize, bool) {
        let mut state = self.state();
        (state.wanted, std::mem::take(&mut state.changed))
    }

    /// Whether another pair is wanted.
    pub(crate) fn is_other_wanted(&self) -> bool {
        self.state().changed
    }

    /// What every page is told first.
    pub(crate) fn hello(&self) -> String {
        let version = env!("CARGO_PKG_VERSION");
        json!({ "pairs": self.state().pairs, "version": version }).to_string()
    }

    /// The news of the scene and of docking.
    pub(crate) fn news(&self) -> [News; 2] {
        let state = self.state();
        [state.scene.clone(), state.docked.clone()]
    }

    /// Numbers of the news, to see without copying whether there is any.
    pub(crate) fn news_numbers(&self) -> [u64; 2] {
        let state = self.state();
        [state.scene.number, state.docked.number]
    }

    /// What `page` sees now, if there is a stage and its loop has begun.
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

    pub(crate) fn exhibits(&self) -> Option<Arc<dyn Exhibits>> {
        let state = self.state();
        state.live.as_ref().map(|live| Arc::clone(&live.exhibits))
    }

    /// The tape as a log.
    pub(crate) fn log(&self) -> Option<Vec<u8>> {
        let tape = self.state().live.as_ref().map(|live| live.tape.clone());
        // Writing to memory does not fail.
        tape.and_then(|tape| tape.csv().ok())
    }

    /// Does what `page` asks; only the one that holds the hand is listened to.
    pub(crate) fn ask(self: &Arc<Self>, page: u64, request: &Request) {
        let mut state = self.state();
        if *request == Request::Take && state.holder.is_none() {
            state.holder = Some(page);
            if let Some(live) = &mut state.live {
                live.take();
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
                    live.obey(request);
                }
            }
        }
    }

    /// Looks for fits on a thread of its own, one search at a time.
    fn dock(self: &Arc<Self>, state: &mut State) {
        let Some(live) = state.live.as_ref().filter(|_| !state.docking) else {
            return;
        };
        let (number, exhibits) = (live.number, Arc::clone(&live.exhibits));
        let hub = Arc::clone(self);
        let search = move || {
            let said = match exhibits.dock() {
                Ok(poses) => json!({ "docked": poses }),
                Err(why) => json!({ "docked": [], "failed": why }),
            };
            let mut state = hub.state();
            if state
                .live
                .as_ref()
                .is_some_and(|live| live.number == number)
            {
                state.docking = false;
                state.docked.tell(&said);
            }
        };
        let thread = std::thread::Builder::new().name("play-dock".into());
        match thread.spawn(search) {
            Ok(_) => {
                state.docking = true;
                state.docked.tell(&json!({ "docking": true }));
            }
            Err(e) => tracing::warn!("no thread to look for fits: {e}"),
        }
    }
}
