//! Scenes: many fixed parts, of which those near the moving part are loaded, by a thread of its
//! own, within a memory budget, and loaded again when their files change.

use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::{EnergySource, PartialTable, Pose};
use glam::DVec3;
use sdf_grid::Aabb;

use crate::LiveSource;
use crate::keeper::Keeper;

/// Pause of the loading thread between two looks at where the part is.
const LOOK: Duration = Duration::from_millis(10);

/// The same while there is more to load: time for the loop to give back what it no longer needs.
const BUSY: Duration = Duration::from_millis(1);

/// What a loader may fail with.
pub type LoadFailure = Box<dyn std::error::Error + Send + Sync>;

/// Makes the energy source of a pair; called on the loading thread, as often as the pair is loaded.
pub type Loader = Box<dyn FnMut() -> Result<Loaded, LoadFailure> + Send>;

/// The energy of a pair.
pub enum Content {
    /// All in memory.
    Whole {
        /// Energy of the moving part in the fixed part's frame.
        source: Arc<dyn EnergySource>,
        /// Memory it takes, bytes.
        bytes: u64,
    },
    /// A table on disk, of which the rotations near the part's own are kept in memory.
    Table(Box<PartialTable>),
}

/// A pair ready to be asked.
pub struct Loaded {
    /// Its energy.
    pub content: Content,
    /// Where the moving part's pivot must be, in the fixed part's frame, for the energy to differ
    /// from zero, metres.
    pub reach: Aabb,
}

/// A fixed part and how to get the energy of the moving part against it.
pub struct PairSpec {
    /// For reports.
    pub name: String,
    /// Pose of the fixed part in the scene.
    pub placement: Pose,
    /// What [`Loaded::reach`] will be; known before anything is loaded.
    pub reach: Aabb,
    /// Memory that it will take if it is whole, as far as it is known; 0 for a table that is kept in
    /// part.
    pub bytes: u64,
    /// The pair is loaded again when one of these changes.
    pub files: Vec<PathBuf>,
    /// The pair before it in the list whose source is this one's too, if the parts are the same but
    /// for where they stand: they share memory, and what is loaded for one serves all. Their
    /// `files` are the same, their `load` gives the same.
    pub same_as: Option<usize>,
    /// Loads it.
    pub load: Loader,
}

/// How a scene is kept in memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// Point of the moving part (metres, its frame) that reaches speak of.
    pub pivot: DVec3,
    /// Most bytes that loaded pairs may take together.
    pub memory: u64,
    /// Pairs whose reach is nearer than this to the pivot are loaded ahead, metres.
    pub ahead: f64,
    /// Rotations of a table that the part can reach by turning no farther than this, radians, are
    /// loaded before the loop starts, and make no room for a pair that is not yet in reach.
    pub turn_ahead: f64,
    /// Time between two looks at the files.
    pub watch: Duration,
}

impl Default for SceneOptions {
    /// The part's origin, no limit, 20 mm and 10 degrees ahead, files twice a second.
    fn default() -> Self {
        Self {
            pivot: DVec3::ZERO,
            memory: u64::MAX,
            ahead: 0.02,
            turn_ahead: 10f64.to_radians(),
            watch: Duration::from_millis(500),
        }
    }
}

/// Why a scene could not be started.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The pairs in reach at the start need more than the budget.
    #[error(
        "the pairs in reach at the start ({pairs}) need {needed} bytes, the scene's memory budget is {budget}"
    )]
    Memory {
        /// Their names.
        pairs: String,
        /// What they need together, bytes.
        needed: u64,
        /// What they may take, bytes.
        budget: u64,
    },
    /// A pair in reach at the start could not be loaded.
    #[error("{pair}: {source}")]
    Load {
        /// Its name.
        pair: String,
        /// Why.
        source: LoadFailure,
    },
    /// The loading thread could not be started.
    #[error("the loading thread could not be started: {0}")]
    Thread(std::io::Error),
}

/// Something that happened to a pair while the loop ran.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneEvent {
    /// When.
    pub at: Instant,
    /// The pair's name.
    pub pair: String,
    /// What.
    pub what: SceneChange,
}

/// What can happen to a pair.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneChange {
    /// It came near and was loaded.
    Loaded {
        /// Time it took.
        seconds: f64,
        /// Memory it takes; nothing if it shares what another pair has loaded.
        bytes: u64,
    },
    /// It changed and was loaded again.
    Reloaded {
        /// Time it took.
        seconds: f64,
        /// Memory it takes; nothing if it shares what another pair has loaded.
        bytes: u64,
    },
    /// It made room for a nearer pair.
    Unloaded,
    /// The table of a pair that came near was opened, or opened again because it changed: its rotations
    /// are loaded as the part comes near them.
    Opened {
        /// Rotations of the whole table.
        rotations: usize,
        /// Memory that each takes, bytes.
        each: u64,
    },
    /// All rotations of its table are in memory.
    Complete {
        /// Memory that they take.
        bytes: u64,
    },
    /// It, or rotations of its table, could not be loaded; what was loaded before stays. It is tried
    /// again when its files change or a reload is asked for.
    Failed(String),
    /// It, or rotations of its table that are needed, are near but do not fit into the budget beside what
    /// is in reach.
    NoRoom {
        /// Bytes it needs.
        needed: u64,
        /// Bytes that could be made free.
        free: u64,
    },
}

/// What a pair is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairState {
    /// Far away, or not yet loaded.
    Waiting,
    /// Loaded and asked where it is in reach.
    Loaded,
    /// Asked where it is in reach and the rotations that matter are in memory.
    Partly {
        /// Rotations in memory.
        rotations: usize,
        /// Rotations of the whole table.
        of: usize,
    },
    /// Could not be loaded.
    Failed,
    /// Does not fit into the budget.
    NoRoom,
}

/// Shared with the loading thread.
#[derive(Debug, Default)]
struct Board {
    events: Vec<SceneEvent>,
    states: Vec<PairState>,
}

/// A scene whose near pairs are loaded while [`LiveScene::source`] is asked by a loop.
pub struct LiveScene {
    source: Arc<LiveSource>,
    board: Arc<Mutex<Board>>,
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
    ) -> Result<Self, SceneError> {
        let (mut keeper, source) = Keeper::new(pairs, options, start);
        keeper.load_in_reach(start)?;
        let board = Arc::new(Mutex::new(Board::default()));
        post(&board, &mut keeper);
        let (commands, orders) = mpsc::channel();
        let shared = (Arc::clone(&board), Arc::clone(&source));
        let thread = std::thread::Builder::new()
            .name("haptic-loader".into())
            .spawn(move || {
                let (board, source) = shared;
                let mut pause = LOOK;
                loop {
                    match orders.recv_timeout(pause) {
                        Ok(pair) => keeper.reload(pair),
                        Err(RecvTimeoutError::Timeout) => {}
                        Err(RecvTimeoutError::Disconnected) => return,
                    }
                    pause = match keeper.step(&source.asked(), Instant::now()) {
                        true => BUSY,
                        false => LOOK,
                    };
                    post(&board, &mut keeper);
                }
            })
            .map_err(SceneError::Thread)?;
        Ok(Self {
            source,
            board,
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
        self.board().events.clone()
    }

    /// What every pair is doing.
    pub fn states(&self) -> Vec<PairState> {
        self.board().states.clone()
    }

    fn board(&self) -> std::sync::MutexGuard<'_, Board> {
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn post(board: &Mutex<Board>, keeper: &mut Keeper) {
    let mut board = board.lock().unwrap_or_else(PoisonError::into_inner);
    board.events.append(&mut keeper.events);
    keeper.states(&mut board.states);
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
