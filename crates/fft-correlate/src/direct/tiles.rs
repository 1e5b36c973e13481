//! Direct quadrature of a pair of which only what poses reach is computed, when they ask for it.
//!
//! The places of the smaller part's middle in the larger part's frame are divided into cubes, *tiles*.
//! The first pose in a tile loads the part of the pair that poses of the tile reach, however the part
//! is turned. Tiles are kept within the memory limit, the one that was used longest ago making room.
//! Answers are those of the whole pair to the last bit, because a part of a pair answers as the whole
//! one does where it reaches.
//!
//! A tile is loaded on threads of its own. A worker of a pool that loaded it on its pool's threads
//! would begin other poses of the pool while it waits, and might then wait for itself.

use std::collections::HashMap;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::{Duration, Instant};

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use sdf_grid::{Aabb, Monitor};

use crate::direct::evaluator::{DirectError, DirectEvaluator, DirectOptions};
use crate::energy::{EnergySource, Response, Scratch};
use crate::geometry::se3::{Pose, Wrench};
use crate::pair::builder::{PairBuildError, PairPlan};
use crate::pair::fields::{Pair, PairError};
use crate::pair::reach::PairPieces;
use crate::pair::setup::{EnergyScaleError, PairSetup, PairSetupError};

/// Edge of a tile, in units of how far the smaller part reaches from its middle: a tile takes little
/// more than a single pose, and poses about a fit, which is in the middle of one, take few.
const EDGE: f64 = 0.5;

/// From this share of the whole pair on that a tile needs, the whole one is loaded.
const FAR_LESS: f64 = 0.35;

/// Longest between two looks whether a wait was cancelled.
const SLICE: Duration = Duration::from_millis(20);

/// Why a pose has no energy.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TileError {
    /// The pair, or a part of it, cannot be had; or the monitor asked to stop.
    #[error(transparent)]
    Setup(#[from] PairSetupError),
    /// It has no direct evaluator.
    #[error(transparent)]
    Direct(#[from] DirectError),
    /// The system starts no threads to load it.
    #[error("threads that load densities cannot be started: {reason}")]
    Threads {
        /// What the system says.
        reason: String,
    },
}

impl From<PairBuildError> for TileError {
    fn from(error: PairBuildError) -> Self {
        Self::Setup(error.into())
    }
}

impl From<PairError> for TileError {
    fn from(error: PairError) -> Self {
        PairBuildError::from(error).into()
    }
}

impl From<EnergyScaleError> for TileError {
    fn from(error: EnergyScaleError) -> Self {
        Self::Setup(error.into())
    }
}

/// Energy and wrench of two parts at any pose by direct quadrature. If one part is small beside the
/// other, only the surroundings of the poses are computed, when these are asked for.
///
/// Threads may share it. No tile is loaded twice at once: a thread that needs a tile which another
/// thread is loading waits for it.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::*;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = PairSetup {
///     builder: PairBuilder { spacing: Some(0.004), ..PairBuilder::default() },
///     ..PairSetup::new(Arc::new(hole), Arc::new(peg))
/// };
/// let tiles = TiledEvaluator::new(&setup, &DirectOptions::FULL, &Silent)?;
/// let response = tiles.response(&Pose::IDENTITY, &mut tiles.scratch(), &Silent)?;
/// assert!(response.energy < 0.0 && tiles.is_loaded(&Pose::IDENTITY));
/// // As an energy source, it keeps the error if loading fails.
/// let source = tiles.watched(&Silent);
/// assert_eq!(source.evaluate(&Pose::IDENTITY, &mut source.scratch()), response);
/// assert!(source.failure().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TiledEvaluator {
    content: Content,
    /// Spent on what it has from the start.
    seconds: f64,
}

enum Content {
    Whole(Arc<DirectEvaluator>),
    Tiles(Box<Tiles>),
}

/// Working memory: the tile of the last pose, as long as it is kept.
#[derive(Debug, Default)]
struct LastTile {
    key: Option<Key>,
    tile: Weak<Tile>,
}

/// Which tile, counted from the one with the fit in its middle.
type Key = [i64; 3];

impl TiledEvaluator {
    /// Of a setup: loads what it always needs, and the whole pair if [`Self::is_worthwhile`] says no.
    /// Its memory limit is for all that is kept.
    ///
    /// # Errors
    /// If the pair cannot be had, a part has no interior on its lattice, or the monitor cancels.
    pub fn new(
        setup: &PairSetup,
        options: &DirectOptions,
        monitor: &dyn Monitor,
    ) -> Result<Self, TileError> {
        let began = Instant::now();
        let mut made = match Self::is_worthwhile(setup, options)? {
            true => Self {
                content: Content::Tiles(Box::new(Tiles::new(setup, options, monitor)?)),
                seconds: 0.0,
            },
            false => Self::of_whole(&setup.load(monitor)?, options)?,
        };
        made.seconds = began.elapsed().as_secs_f64();
        Ok(made)
    }

    /// Of a pair that is there.
    ///
    /// # Errors
    /// As [`DirectEvaluator::new`].
    pub fn of_whole(pair: &Pair, options: &DirectOptions) -> Result<Self, DirectError> {
        Ok(Self {
            content: Content::Whole(Arc::new(DirectEvaluator::new(pair, options)?)),
            seconds: 0.0,
        })
    }

    /// Whether a tile is far less than the whole pair, and its points are the whole pair's: not those
    /// of densities that are averaged over cells, nor of a larger part whose points are to be few.
    ///
    /// # Errors
    /// If the pair cannot be planned.
    pub fn is_worthwhile(setup: &PairSetup, options: &DirectOptions) -> Result<bool, TileError> {
        Ok(Self::tile_at_fit(setup, options)?.is_some())
    }

    /// Refuses a setup that cannot be evaluated at its fit within its memory limit; computes nothing.
    ///
    /// # Errors
    /// If the pair cannot be planned, or does not fit.
    pub fn require_memory(setup: &PairSetup, options: &DirectOptions) -> Result<(), TileError> {
        match Self::tile_at_fit(setup, options)? {
            Some(tile) => {
                let limit = setup.builder.memory_limit;
                let needed = tile.building_bytes() + tile.contact_bytes;
                tile.require_bytes(needed, limit)?;
            }
            None => {
                setup.plan().map_err(PairSetupError::from)?;
            }
        }
        Ok(())
    }

    /// The plan of the tile at the fit, if tiles are worthwhile.
    fn tile_at_fit(
        setup: &PairSetup,
        options: &DirectOptions,
    ) -> Result<Option<PairPlan>, TileError> {
        let plan = setup.plan_unlimited().map_err(PairSetupError::from)?;
        let parts = [&*setup.fixed, &*setup.moving];
        let few = options.max_points.is_some();
        if setup.builder.smoothing.is_none() || few && !plan.keeps_points(parts) {
            return Ok(None);
        }
        let fit = plan.place(parts, &setup.assembled);
        let places = Aabb::around([fit]).grown(0.5 * EDGE * plan.radius(parts));
        // Where nothing is in reach of the fit there is nothing to save.
        let tile = plan.in_box(parts, &places);
        Ok(tile.filter(|tile| (tile.bytes as f64) < FAR_LESS * plan.bytes as f64))
    }

    /// Energy and wrench at a pose of the shapes; loads what it needs. `scratch` is
    /// [`Self::scratch`]'s.
    ///
    /// # Errors
    /// If that cannot be had or does not fit in memory, or the monitor cancels. Who asks again tries
    /// again.
    pub fn response(
        &self,
        pose: &Pose,
        scratch: &mut Scratch,
        monitor: &dyn Monitor,
    ) -> Result<Response, TileError> {
        match &self.content {
            Content::Whole(whole) => Ok(whole.evaluate(pose, scratch)),
            Content::Tiles(tiles) => tiles.response(pose, scratch.get_mut(), monitor),
        }
    }

    /// Whether [`Self::response`] at a pose has nothing to load.
    pub fn is_loaded(&self, pose: &Pose) -> bool {
        let Content::Tiles(tiles) = &self.content else {
            return true;
        };
        let is_kept = |key| {
            let state = tiles
                .kept()
                .slots
                .get(&Slot::Tile(key))
                .is_some_and(State::is_ready);
            state || !tiles.is_reached(key)
        };
        tiles.whole.get().is_some() || tiles.key(pose).is_none_or(is_kept)
    }

    /// The evaluator of the whole pair, a source for loops in real time; loads what is not there.
    ///
    /// # Errors
    /// As [`Self::response`].
    pub fn whole(&self, monitor: &dyn Monitor) -> Result<Arc<DirectEvaluator>, TileError> {
        match &self.content {
            Content::Whole(whole) => Ok(Arc::clone(whole)),
            Content::Tiles(tiles) => {
                let whole =
                    tiles.get(|_| tiles.load_of(Slot::Whole, Some(&tiles.plan)), monitor)?;
                Ok(Arc::clone(&whole.evaluator))
            }
        }
    }

    /// Seconds spent on loading, by all threads together.
    pub fn load_seconds(&self) -> f64 {
        match &self.content {
            Content::Whole(_) => self.seconds,
            Content::Tiles(tiles) => self.seconds + tiles.kept().seconds,
        }
    }

    /// Working memory of one thread.
    pub fn scratch(&self) -> Scratch {
        Scratch::new(LastTile::default())
    }

    /// Poses in an order in which those of one tile follow each other: their indices.
    pub fn order(&self, poses: &[Pose]) -> Vec<usize> {
        let mut order: Vec<usize> = (0..poses.len()).collect();
        if let Content::Tiles(tiles) = &self.content {
            let keys: Vec<_> = poses.iter().map(|pose| tiles.key(pose)).collect();
            order.sort_by_key(|i| keys[*i]);
        }
        order
    }

    /// Quadrature points of the pair near a pose: the most lookups that a pose there takes. Loads what
    /// poses there need.
    ///
    /// # Errors
    /// As [`Self::response`].
    pub fn points(&self, pose: &Pose, monitor: &dyn Monitor) -> Result<usize, TileError> {
        let tiles = match &self.content {
            Content::Whole(whole) => return Ok(whole.describe().points()),
            Content::Tiles(tiles) => tiles,
        };
        if let Some(key) = tiles.key(pose)
            && tiles.is_reached(key)
        {
            let tile = tiles.tile(key, monitor)?;
            return Ok(tile.evaluator.describe().points());
        }
        Ok(0)
    }

    /// The same, as a source that stops loading when the monitor cancels.
    pub fn watched<'a>(&'a self, monitor: &'a dyn Monitor) -> WatchedTiles<'a> {
        WatchedTiles {
            tiles: self,
            monitor: Quiet(monitor),
            failure: OnceLock::new(),
        }
    }
}

/// Asks whether to stop, and reports nothing: what is loaded is a part of other work.
struct Quiet<'a>(&'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// A [`TiledEvaluator`] as an energy source, which remembers why a pose could not be loaded.
///
/// See the example of [`TiledEvaluator`].
pub struct WatchedTiles<'a> {
    tiles: &'a TiledEvaluator,
    monitor: Quiet<'a>,
    failure: OnceLock<TileError>,
}

impl WatchedTiles<'_> {
    /// Why an answer could not be had; all later ones are not-a-number, too.
    pub fn failure(&self) -> Option<&TileError> {
        self.failure.get()
    }
}

/// The answer of a source that has failed.
const NO_ANSWER: Response = Response {
    energy: f64::NAN,
    wrench: Wrench {
        torque: DVec3::NAN,
        force: DVec3::NAN,
    },
    coverage: 0.0,
};

impl EnergySource for WatchedTiles<'_> {
    fn scratch(&self) -> Scratch {
        self.tiles.scratch()
    }

    /// Loads what the pose needs: it may take seconds.
    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        if self.has_failed() {
            return NO_ANSWER;
        }
        let response = self.tiles.response(pose, scratch, &self.monitor);
        response.unwrap_or_else(|error| {
            // The first failure is kept.
            let _ = self.failure.set(error);
            NO_ANSWER
        })
    }

    fn has_failed(&self) -> bool {
        self.failure.get().is_some()
    }
}

/// A part of the pair, ready to be asked.
struct Tile {
    evaluator: Arc<DirectEvaluator>,
    /// Memory that it takes.
    bytes: u64,
    /// When it was last asked, by the count of all that was asked.
    used: AtomicU64,
}

impl std::fmt::Debug for Tile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tile").field("bytes", &self.bytes).finish()
    }
}

/// The tiles of a pair.
struct Tiles {
    setup: PairSetup,
    options: DirectOptions,
    /// Of the whole pair.
    plan: PairPlan,
    pieces: PairPieces,
    /// Bytes that tiles may take.
    limit: Option<u64>,
    gamma: f64,
    /// The first corner of the tile with the fit, metres, and the edge of all.
    origin: DVec3,
    edge: f64,
    /// The whole pair, once it is the cheaper way.
    whole: OnceLock<Arc<Tile>>,
    kept: Mutex<Kept>,
    changed: Condvar,
    asked: AtomicU64,
}

/// What is loaded.
#[derive(Default)]
struct Kept {
    slots: HashMap<Slot, State>,
    /// Bytes of all tiles that are kept or being loaded.
    bytes: u64,
    /// Bytes of the fields of all tiles that have ever been loaded.
    spent: u64,
    /// Spent on loading.
    seconds: f64,
}

impl Kept {
    /// Forgets what another process loads: of one that was forked meanwhile, nobody ends it here.
    fn forget_loads_of_others(&mut self) {
        let (own, bytes) = (std::process::id(), &mut self.bytes);
        self.slots.retain(|_, state| match state {
            State::Loading { process, needed } if *process != own => {
                *bytes -= *needed;
                false
            }
            _ => true,
        });
    }

    /// Gives up some of the tiles that are ready.
    fn give_up(&mut self, which: impl Fn(&Slot) -> bool) {
        let bytes = &mut self.bytes;
        self.slots.retain(|slot, state| match state {
            State::Ready(tile) if which(slot) => {
                *bytes -= tile.bytes;
                false
            }
            _ => true,
        });
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Slot {
    Tile(Key),
    Whole,
}

enum State {
    Loading {
        /// By which process.
        process: u32,
        /// Bytes that are counted meanwhile.
        needed: u64,
    },
    Ready(Arc<Tile>),
}

impl State {
    fn is_ready(&self) -> bool {
        matches!(self, Self::Ready(_))
    }
}

/// What is to be loaded.
struct Load {
    slot: Slot,
    /// Bytes while it is loaded, and of its fields.
    needed: u64,
    fields: u64,
}

impl Tiles {
    fn new(
        setup: &PairSetup,
        options: &DirectOptions,
        monitor: &dyn Monitor,
    ) -> Result<Self, TileError> {
        let plan = setup.plan_unlimited().map_err(PairSetupError::from)?;
        let limit = setup.builder.memory_limit;
        let parts = [&*setup.fixed, &*setup.moving];
        let gamma = setup.gamma()?;
        plan.require_bytes(plan.smaller_bytes(parts), limit)?;
        let pieces = apart(|| plan.pieces(parts, setup.cache.as_ref(), monitor))??;
        let edge = EDGE * plan.radius(parts);
        let fit = plan.place(parts, &setup.assembled);
        // What contact may come to keep never makes room for a tile.
        let shared = pieces.bytes() + plan.contact_bytes;
        Ok(Self {
            limit: limit.map(|limit| limit.saturating_sub(shared)),
            origin: fit - 0.5 * edge,
            setup: setup.clone(),
            options: *options,
            plan,
            pieces,
            gamma,
            edge,
            whole: OnceLock::new(),
            kept: Mutex::default(),
            changed: Condvar::new(),
            asked: AtomicU64::new(0),
        })
    }

    fn parts(&self) -> [&sdf_grid::TriangleMesh; 2] {
        [&self.setup.fixed, &self.setup.moving]
    }

    /// The tile of a pose; none so far away that nothing is in reach.
    fn key(&self, pose: &Pose) -> Option<Key> {
        const FARTHEST: f64 = 1e9;
        let place = self.plan.place(self.parts(), pose);
        let at = ((place - self.origin) / self.edge).floor();
        // False for what is not a number.
        let near = at.abs().cmplt(DVec3::splat(FARTHEST)).all();
        near.then(|| at.to_array().map(|i| i as i64))
    }

    /// The places of a tile, metres.
    fn places(&self, key: Key) -> Aabb {
        let first = DVec3::from_array(key.map(|i| i as f64));
        let corners = [first, first + 1.0].map(|at| self.origin + self.edge * at);
        // Whatever rounding does.
        Aabb::around(corners).grown(1e-6 * self.edge)
    }

    fn is_reached(&self, key: Key) -> bool {
        self.plan.in_box(self.parts(), &self.places(key)).is_some()
    }

    fn response(
        &self,
        pose: &Pose,
        last: &mut LastTile,
        monitor: &dyn Monitor,
    ) -> Result<Response, TileError> {
        // Evaluators of pairs need none.
        let none = &mut Scratch::default();
        if let Some(whole) = self.whole.get() {
            return Ok(whole.evaluator.evaluate(pose, none));
        }
        let Some(key) = self.key(pose) else {
            return Ok(DirectEvaluator::far_response(self.gamma));
        };
        let kept = match last.key == Some(key) {
            true => last.tile.upgrade(),
            false => None,
        };
        let tile = match kept {
            Some(tile) => tile,
            None if !self.is_reached(key) => {
                return Ok(DirectEvaluator::far_response(self.gamma));
            }
            None => {
                let tile = self.tile(key, monitor)?;
                (last.key, last.tile) = (Some(key), Arc::downgrade(&tile));
                tile
            }
        };
        self.touch(&tile);
        Ok(tile.evaluator.evaluate(pose, none))
    }

    fn touch(&self, tile: &Tile) {
        let now = self.asked.fetch_add(1, Ordering::Relaxed);
        tile.used.store(now, Ordering::Relaxed);
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The tile, or the whole pair in its place.
    fn tile(&self, key: Key, monitor: &dyn Monitor) -> Result<Arc<Tile>, TileError> {
        self.get(|kept| self.next_load(kept, key), monitor)
    }

    /// What `next` names, loaded by this thread or another, or the whole pair if that is there.
    fn get(
        &self,
        next: impl Fn(&Kept) -> Load,
        monitor: &dyn Monitor,
    ) -> Result<Arc<Tile>, TileError> {
        loop {
            let mut kept = self.kept();
            if let Some(whole) = self.whole.get() {
                return Ok(Arc::clone(whole));
            }
            kept.forget_loads_of_others();
            let load = next(&kept);
            let room = match kept.slots.get(&load.slot) {
                Some(State::Ready(tile)) => return Ok(Arc::clone(tile)),
                Some(State::Loading { .. }) => false,
                None if monitor.cancelled() => return Err(PairSetupError::Cancelled.into()),
                None => self.make_room(&mut kept, &load)?,
            };
            if room {
                let loading = State::Loading {
                    process: std::process::id(),
                    needed: load.needed,
                };
                kept.slots.insert(load.slot, loading);
                kept.bytes += load.needed;
                drop(kept);
                return self.load(&load, monitor);
            }
            if monitor.cancelled() {
                return Err(PairSetupError::Cancelled.into());
            }
            let waited = self.changed.wait_timeout(kept, SLICE);
            drop(waited.unwrap_or_else(PoisonError::into_inner));
        }
    }

    /// What is to be loaded for a tile. The whole pair as soon as tiles have taken as much as it: all
    /// of them together then take at most twice as long as that.
    fn next_load(&self, kept: &Kept, key: Key) -> Load {
        let tile = self.plan.in_box(self.parts(), &self.places(key));
        let tile = self.load_of(Slot::Tile(key), tile.as_ref());
        let whole = self.load_of(Slot::Whole, Some(&self.plan));
        let is_kept = kept.slots.contains_key(&tile.slot);
        let fits = self.limit.is_none_or(|limit| whole.needed <= limit);
        let cheaper = kept.spent + tile.fields > whole.fields
            || tile.fields as f64 > FAR_LESS * whole.fields as f64;
        match fits && cheaper && !is_kept {
            true => whole,
            false => tile,
        }
    }

    /// Of a plan; of nothing that is reached, nothing.
    fn load_of(&self, slot: Slot, plan: Option<&PairPlan>) -> Load {
        Load {
            slot,
            needed: plan.map_or(0, PairPlan::building_bytes),
            fields: plan.map_or(0, |plan| plan.bytes),
        }
    }

    /// Gives up tiles until another one fits; false while what is being loaded stands in its way.
    fn make_room(&self, kept: &mut Kept, load: &Load) -> Result<bool, TileError> {
        let Some(limit) = self.limit else {
            return Ok(true);
        };
        self.plan
            .require_bytes(load.needed, Some(limit))
            .map_err(TileError::from)?;
        while kept.bytes + load.needed > limit {
            let ready = kept.slots.iter().filter_map(|(slot, state)| match state {
                State::Ready(tile) => Some((tile.used.load(Ordering::Relaxed), *slot)),
                State::Loading { .. } => None,
            });
            let Some((_, oldest)) = ready.min_by_key(|(used, _)| *used) else {
                return Ok(false);
            };
            kept.give_up(|slot| *slot == oldest);
        }
        Ok(true)
    }

    /// Loads what this thread has claimed.
    fn load(&self, load: &Load, monitor: &dyn Monitor) -> Result<Arc<Tile>, TileError> {
        let mut claim = Claim {
            tiles: self,
            load,
            is_held: true,
        };
        let began = Instant::now();
        let evaluator = apart(|| {
            let pair = match load.slot {
                Slot::Tile(key) => self.pieces.in_box(&self.places(key), monitor)?,
                Slot::Whole => self.pieces.whole(monitor)?,
            };
            let pair = pair.with_gamma(self.gamma)?;
            Ok::<_, TileError>(DirectEvaluator::new(&pair, &self.options)?)
        })??;
        let tile = Arc::new(Tile {
            bytes: evaluator.describe().bytes,
            evaluator: Arc::new(evaluator),
            used: AtomicU64::new(self.asked.fetch_add(1, Ordering::Relaxed)),
        });
        let mut kept = self.kept();
        claim.release(&mut kept);
        kept.spent += load.fields;
        kept.seconds += began.elapsed().as_secs_f64();
        match load.slot {
            // Who waits for it finds the whole pair.
            Slot::Tile(_) if self.whole.get().is_some() => {}
            Slot::Tile(_) => {
                kept.bytes += tile.bytes;
                let ready = State::Ready(Arc::clone(&tile));
                kept.slots.insert(load.slot, ready);
            }
            Slot::Whole => {
                // Only one thread loads it at a time, and none once it is there.
                let _ = self.whole.set(Arc::clone(&tile));
                kept.give_up(|slot| matches!(slot, Slot::Tile(_)));
                kept.bytes += tile.bytes;
            }
        }
        Ok(tile)
    }
}

/// What one thread loads. Whether it succeeds or not, those who wait are told when it ends.
struct Claim<'a> {
    tiles: &'a Tiles,
    load: &'a Load,
    is_held: bool,
}

impl Claim<'_> {
    fn release(&mut self, kept: &mut Kept) {
        self.is_held = false;
        kept.bytes -= self.load.needed;
        kept.slots.remove(&self.load.slot);
    }
}

impl Drop for Claim<'_> {
    fn drop(&mut self) {
        if self.is_held {
            let tiles = self.tiles;
            self.release(&mut tiles.kept());
        }
        self.tiles.changed.notify_all();
    }
}

/// Does work on as many threads as the current pool has, but on none of its own.
fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, TileError> {
    let threads = rayon::current_num_threads();
    let failed = |reason: String| TileError::Threads { reason };
    std::thread::scope(|scope| {
        let run = move || {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.map_err(|e| failed(e.to_string()))?;
            Ok(pool.install(work))
        };
        let thread = std::thread::Builder::new().spawn_scoped(scope, run);
        let thread = thread.map_err(|e| failed(e.to_string()))?;
        thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

#[cfg(test)]
#[path = "tiles_tests.rs"]
mod tests;
