//! A scene whose near pairs are loaded while a loop asks it.

use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use web_time::{Duration, Instant};

use fft_correlate::Pose;

use crate::scene::event::{PairState, SceneEvent};
use crate::scene::live_source::LiveSource;
use crate::scene::pair::PairSpec;
use crate::scene::residency::LiveSceneError;
use crate::scene::residency::ResidencyManager;
use crate::scene::residency::SceneOptions;

/// Pause of the loading thread between two checks of the part's pose.
const POLL_PAUSE: Duration = Duration::from_millis(10);

/// The same while there is more to load: time for the loop to give back what it no longer needs.
const BUSY_PAUSE: Duration = Duration::from_millis(1);

/// Shared with the loading thread.
#[derive(Debug, Default)]
struct SharedState {
    events: Vec<SceneEvent>,
    states: Vec<PairState>,
}

/// A scene that loads near pairs in the background while a loop asks [`LiveScene::source`].
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::{EnergySource, Placement, Pose};
/// use glam::DVec3;
/// use haptic::scene::{Content, LoadedPair, PairState};
/// use haptic::*;
/// use sdf_grid::Aabb;
///
/// // A pair that matters within 1 cm of its fit; an empty sum stands for its energy.
/// let reach = Aabb::around([DVec3::ZERO]).grown(0.01);
/// let load = move |_place: DVec3| {
///     let source = Arc::new(SumSource::new(DVec3::ZERO, vec![]));
///     let content = Content::Whole { source, bytes: 1000 };
///     Ok(LoadedPair { content, reach, right: None })
/// };
/// let pair = PairSpec {
///     name: "plate".into(),
///     placement: Placement::IDENTITY,
///     reach,
///     bytes: 1000,
///     files: vec![],
///     same_as: None,
///     load: Box::new(load),
/// };
/// let live = LiveScene::start(vec![pair], SceneOptions::default(), &Pose::IDENTITY)?;
/// // What is in reach at the start is loaded already.
/// assert_eq!(live.states(), [PairState::Loaded]);
/// let mut scratch = live.source().scratch();
/// assert_eq!(live.source().evaluate(&Pose::IDENTITY, &mut scratch).energy, 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct LiveScene {
    source: Arc<LiveSource>,
    state: Arc<Mutex<SharedState>>,
    commands: Sender<usize>,
    thread: Option<JoinHandle<()>>,
}

impl LiveScene {
    /// Loads the pairs in reach of `start`, in order, then keeps loading in the background.
    ///
    /// # Errors
    /// If the pairs in reach of `start` cannot be loaded or are too large together.
    pub fn start(
        pairs: Vec<PairSpec>,
        options: SceneOptions,
        start: &Pose,
    ) -> Result<Self, LiveSceneError> {
        let (mut manager, source) = ResidencyManager::new(pairs, options, start);
        manager.load_in_reach(start)?;
        let state = Arc::new(Mutex::new(SharedState::default()));
        publish_state(&state, &mut manager);
        let (commands, orders) = mpsc::channel();
        let shared = (Arc::clone(&state), Arc::clone(&source));
        let thread = std::thread::Builder::new()
            .name("haptic-loader".into())
            .spawn(move || {
                let (state, source) = shared;
                let mut pause = POLL_PAUSE;
                loop {
                    match orders.recv_timeout(pause) {
                        Ok(pair) => manager.reload(pair),
                        Err(RecvTimeoutError::Timeout) => {}
                        Err(RecvTimeoutError::Disconnected) => return,
                    }
                    pause = match manager.step(&source.last_pose(), Instant::now()) {
                        true => BUSY_PAUSE,
                        false => POLL_PAUSE,
                    };
                    publish_state(&state, &mut manager);
                }
            })
            .map_err(LiveSceneError::Thread)?;
        Ok(Self {
            source,
            state,
            commands,
            thread: Some(thread),
        })
    }

    /// What a loop asks.
    pub fn source(&self) -> &LiveSource {
        &self.source
    }

    /// Loads pair `index` again, in the background; the loop goes on with what it has until then.
    /// A number that is no pair's is ignored.
    pub fn reload(&self, index: usize) {
        // The thread outlives every handle to it.
        let _ = self.commands.send(index);
    }

    /// Everything that happened so far, in order.
    pub fn events(&self) -> Vec<SceneEvent> {
        self.state().events.clone()
    }

    /// What every pair is doing.
    pub fn states(&self) -> Vec<PairState> {
        self.state().states.clone()
    }

    fn state(&self) -> std::sync::MutexGuard<'_, SharedState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn publish_state(state: &Mutex<SharedState>, manager: &mut ResidencyManager) {
    let mut state = state.lock().unwrap_or_else(PoisonError::into_inner);
    state.events.append(&mut manager.events);
    manager.states(&mut state.states);
}

impl Drop for LiveScene {
    /// Waits for a pair that is being loaded.
    fn drop(&mut self) {
        let (closed, _) = mpsc::channel();
        drop(std::mem::replace(&mut self.commands, closed));
        if let Some(thread) = self.thread.take() {
            // A panic of a loader was its own; the scene ends all the same.
            let _ = thread.join();
        }
    }
}
