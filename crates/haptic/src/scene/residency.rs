//! Decides which pairs of a scene, and which rotations of their tables, are in memory: one decision
//! and at most one load per step.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::SystemTime;
use web_time::{Duration, Instant};

use fft_correlate::Pose;
use glam::DVec3;
use sdf_grid::Aabb;

use crate::panics::panic_message;
use crate::scene::event::{PairState, SceneChange, SceneEvent};
use crate::scene::live_source::LiveSource;
use crate::scene::pair::{Content, LoadFailure, LoadedPair, PairSpec};
use crate::scene::rotations::{RotationNode, Rotations, Step, TableRead, Tables, Viewpoint};
use crate::scene::sum::{PlacedSource, SharedSource, SumSource};

/// How far from the middle of where it is right a source is loaded again, shares of that box's sides: a
/// quarter of them before its edge.
const NEAR_EDGE: f64 = 0.25;

/// How much of a scene is kept in memory, and how far ahead it is loaded.
///
/// See the example of [`LiveScene`](crate::LiveScene).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneOptions {
    /// Point of the moving part as placed (metres, what poses move) that reaches speak of.
    pub pivot: DVec3,
    /// Most bytes that loaded pairs may take together.
    pub memory: u64,
    /// Pairs whose reach is nearer than this to the pivot are loaded ahead, metres.
    pub ahead: f64,
    /// Rotations of a table that the part can reach by turning no farther than this, radians, are
    /// loaded before the loop starts, and make no room for a pair that is not yet in reach.
    pub turn_ahead: f64,
    /// Time between two checks of the files.
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
pub enum LiveSceneError {
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

/// The pairs of a scene and what is loaded of them.
pub(crate) struct ResidencyManager {
    entries: Vec<Entry>,
    tables: Tables,
    options: SceneOptions,
    source: Arc<LiveSource>,
    watched: Instant,
    /// Where the pivot was when the priorities were last updated, scene frame.
    last_pivot: DVec3,
    /// Not yet posted.
    pub(crate) events: Vec<SceneEvent>,
}

impl ResidencyManager {
    /// Nothing loaded; `start` is where the moving part is.
    pub(crate) fn new(
        pairs: Vec<PairSpec>,
        options: SceneOptions,
        start: &Pose,
    ) -> (Self, Arc<LiveSource>) {
        let mut entries: Vec<Entry> = Vec::with_capacity(pairs.len());
        for spec in pairs {
            let first = spec.same_as.and_then(|same| entries.get(same));
            let group = first.map_or(entries.len(), |same| same.group);
            entries.push(Entry::new(spec, group));
        }
        let sum = sum(&entries, options.pivot);
        let source = Arc::new(LiveSource::new(sum, start));
        let manager = Self {
            entries,
            tables: Tables::default(),
            last_pivot: DVec3::ZERO,
            options,
            source: Arc::clone(&source),
            watched: Instant::now(),
            events: Vec::new(),
        };
        (manager, source)
    }

    /// Loads every pair in reach at `start`, and the rotations near it of their tables.
    ///
    /// # Errors
    /// If a pair cannot be loaded, or all together exceed the memory budget.
    pub(crate) fn load_in_reach(&mut self, start: &Pose) -> Result<(), LiveSceneError> {
        let point = self.point(start);
        let near: Vec<usize> = (0..self.entries.len())
            .filter(|&i| self.entries[i].distance(point) <= 0.0)
            .collect();
        for &index in &near {
            self.acquire(index, point)
                .map_err(|source| LiveSceneError::Load {
                    pair: self.entries[index].spec.name.clone(),
                    source,
                })?;
        }
        self.update_priorities(start);
        let (needed, budget) = (
            self.bytes(|_, _| true) + self.tables.needed_bytes(),
            self.options.memory,
        );
        if needed > budget {
            let names = near.iter().map(|&i| self.entries[i].spec.name.as_str());
            return Err(LiveSceneError::Memory {
                pairs: names.collect::<Vec<_>>().join(", "),
                needed,
                budget,
            });
        }
        while self.load_rotation_batch(self.options.turn_ahead as f32)? {}
        self.publish();
        self.tables.leave_a_core();
        Ok(())
    }

    /// Where the moving part's pivot is, scene frame.
    fn point(&self, pose: &Pose) -> DVec3 {
        pose.apply(self.options.pivot)
    }

    /// Marks a pair, and those that share its source, to be loaded again.
    pub(crate) fn reload(&mut self, index: usize) {
        let Some(group) = self.entries.get(index).map(|s| s.group) else {
            return;
        };
        for entry in self.entries.iter_mut().filter(|s| s.group == group) {
            entry.reload = true;
        }
    }

    /// The states of all pairs, into `states`.
    pub(crate) fn states(&self, states: &mut Vec<PairState>) {
        states.clear();
        states.extend(
            self.entries
                .iter()
                .map(|s| match self.tables.table(s.group) {
                    Some(table) if s.state == PairState::Loaded => {
                        match (table.resident(), table.nodes()) {
                            (rotations, of) if rotations < of => {
                                PairState::Partly { rotations, of }
                            }
                            _ => PairState::Loaded,
                        }
                    }
                    _ => s.state,
                }),
        );
    }

    /// Checks the files if it is time, and loads the most urgent pair, or else the most urgent
    /// rotations, for a moving part at `pose`. True if there is more to do.
    pub(crate) fn step(&mut self, pose: &Pose, now: Instant) -> bool {
        if now.saturating_duration_since(self.watched) >= self.options.watch {
            self.watched = now;
            for entry in &mut self.entries {
                entry.check_files();
            }
        }
        self.source.reclaim();
        let point = self.point(pose);
        for entry in &mut self.entries {
            entry.follow(point);
        }
        match self.next(point) {
            Some(index) if self.make_room(index, point) => {
                self.load(index, point);
                true
            }
            _ => self.load_rotations(pose),
        }
    }

    /// The pair to load next: one that changed, else the nearest that is not loaded.
    fn next(&self, point: DVec3) -> Option<usize> {
        let entries = || self.entries.iter().enumerate();
        let near = |s: &Entry| s.distance(point) <= self.options.ahead;
        let stale = entries().find(|(_, s)| s.reload && (s.loaded.is_some() || near(s)));
        stale.map(|(i, _)| i).or_else(|| {
            entries()
                .filter(|(_, s)| s.loaded.is_none() && s.state != PairState::Failed)
                .filter(|(_, s)| near(s))
                .min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)))
                .map(|(i, _)| i)
        })
    }

    /// Bytes of the sources of the loaded pairs that count; a shared one once.
    fn bytes(&self, counts: impl Fn(usize, &Entry) -> bool) -> u64 {
        let counted = self
            .entries
            .iter()
            .enumerate()
            .filter(|(i, s)| counts(*i, s));
        let resident = counted.filter_map(|(_, s)| s.loaded.as_ref());
        let sources: BTreeMap<_, _> = resident.map(|h| (h.source.id(), h.bytes)).collect();
        sources.values().sum()
    }

    /// Whether pair `other` holds what loading `index` is about to replace.
    fn outdated(&self, index: usize, other: usize) -> bool {
        let entry = &self.entries[other];
        other != index && entry.reload && entry.group == self.entries[index].group
    }

    /// The source of another pair of the group, if it was loaded from the files as they are.
    fn shared(&self, index: usize, files: &FileStats) -> Option<Resident> {
        let group = self.entries[index].group;
        let mut others = self.entries.iter().enumerate();
        let twin = others.find(|(i, s)| {
            let same = *i != index && s.group == group;
            same && s.loaded.is_some() && !s.reload && s.loaded_stats == *files
        });
        twin.and_then(|(_, s)| s.loaded.clone())
    }

    /// Evicts distant rotations and unloads the farthest pairs out of reach until `index` fits.
    /// Pairs in reach stay.
    fn make_room(&mut self, index: usize, point: DVec3) -> bool {
        let files = file_stats(&self.entries[index].spec.files);
        loop {
            let needed = match self.shared(index, &files) {
                Some(_) => 0,
                None => self.entries[index].spec.bytes,
            };
            let whole = self.bytes(|i, _| i != index && !self.outdated(index, i));
            let others = whole + self.tables.bytes();
            if others.saturating_add(needed) <= self.options.memory {
                return true;
            }
            let own = self.entries[index].distance(point);
            let excess = others.saturating_add(needed) - self.options.memory;
            let least = match own <= 0.0 {
                true => 0.0,
                false => self.options.turn_ahead as f32,
            };
            if self.tables.evict(excess, least) {
                self.share_tables();
                continue;
            }
            let farthest = (0..self.entries.len())
                .filter(|&i| i != index && self.entries[i].loaded.is_some())
                .map(|i| (self.entries[i].distance(point), i))
                .filter(|(distance, _)| *distance > own.max(0.0))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, victim)) = farthest else {
                self.no_room(index, needed, self.options.memory.saturating_sub(others));
                return false;
            };
            self.unload(victim);
        }
    }

    fn no_room(&mut self, index: usize, needed: u64, free: u64) {
        let entry = &mut self.entries[index];
        entry.reload = false;
        if entry.state != PairState::NoRoom {
            entry.state = PairState::NoRoom;
            self.emit(index, SceneChange::NoRoom { needed, free });
        }
    }

    fn unload(&mut self, index: usize) {
        let entry = &mut self.entries[index];
        entry.loaded = None;
        entry.state = PairState::Waiting;
        let group = entry.group;
        if self
            .entries
            .iter()
            .all(|s| s.group != group || s.loaded.is_none())
        {
            self.tables.change(group, None);
        }
        self.tables.idle = false;
        self.publish();
        self.emit(index, SceneChange::Unloaded);
    }

    /// Loads a pair for which there is room, emits the event and publishes the new sum.
    fn load(&mut self, index: usize, point: DVec3) {
        let again = self.entries[index].loaded.is_some();
        let began = Instant::now();
        let what = match self.acquire(index, point) {
            Err(why) => SceneChange::Failed(why.to_string()),
            Ok(bytes) => {
                let seconds = began.elapsed().as_secs_f64();
                match (self.tables.table(self.entries[index].group), again) {
                    (Some(table), _) => SceneChange::Opened {
                        rotations: table.nodes(),
                        each: table.node_bytes(),
                    },
                    (None, true) => SceneChange::Reloaded { seconds, bytes },
                    (None, false) => SceneChange::Loaded { seconds, bytes },
                }
            }
        };
        self.emit(index, what);
        // It may have turned out larger than expected.
        let all = self.bytes(|i, _| !self.outdated(index, i)) + self.tables.bytes();
        if all > self.options.memory && self.entries[index].spec.bytes > 0 {
            let needed = self.entries[index].spec.bytes;
            self.entries[index].loaded = None;
            let whole = self.bytes(|i, _| !self.outdated(index, i));
            let others = whole + self.tables.bytes();
            let free = self.options.memory.saturating_sub(others);
            self.no_room(index, needed, free);
        }
        self.publish();
    }

    /// Loads a pair, or shares what was loaded for another. Returns the bytes that this takes. If
    /// it fails, what was loaded before stays.
    fn acquire(&mut self, index: usize, point: DVec3) -> Result<u64, LoadFailure> {
        let files = file_stats(&self.entries[index].spec.files);
        let shared = self.shared(index, &files);
        let more = u64::from(shared.is_none());
        let entry = &mut self.entries[index];
        entry.reload = false;
        entry.last_stats.clone_from(&files);
        entry.loaded_stats = files;
        let result = match shared {
            Some(resident) => Ok((resident, None)),
            None => entry.run_loader(point).map(into_resident),
        };
        match result {
            Ok((loaded, table)) => {
                let (group, bytes) = (entry.group, loaded.bytes);
                entry.spec.reach = loaded.reach;
                entry.spec.bytes = bytes;
                entry.loaded = Some(loaded);
                entry.state = PairState::Loaded;
                if more == 1 {
                    self.tables.change(group, table);
                }
                Ok(bytes * more)
            }
            Err(why) => {
                if entry.loaded.is_none() {
                    entry.state = PairState::Failed;
                }
                Err(why)
            }
        }
    }

    /// Updates the urgencies of all rotations for a moving part at `pose`.
    fn update_priorities(&mut self, pose: &Pose) {
        let point = self.point(pose);
        self.last_pivot = point;
        let (entries, ahead) = (&self.entries, self.options.ahead);
        self.tables.update_priorities(|group| {
            let entries = entries.iter().filter(|s| s.group == group);
            let views = entries.map(|s| Viewpoint::new(&s.spec.placement, pose, s.distance(point)));
            views.filter(|view| view.away <= ahead).collect()
        });
    }

    /// One step of loading rotations for a moving part at `pose`. True if there is more to do.
    fn load_rotations(&mut self, pose: &Pose) -> bool {
        self.update_priorities(pose);
        if self.tables.idle {
            return false;
        }
        // A failed read was already emitted; the other rotations are tried next.
        let more = self.load_rotation_batch(f32::INFINITY).unwrap_or(true);
        if !more {
            self.tables.idle = true;
        }
        more
    }

    /// Reads the most urgent rotations below `limit`, as many as have room, or makes room for them.
    /// True if there may be more to do.
    ///
    /// # Errors
    /// If some could not be read; they are not tried again.
    fn load_rotation_batch(&mut self, limit: f32) -> Result<bool, LiveSceneError> {
        let allowed = self.options.memory.saturating_sub(self.bytes(|_, _| true));
        match self.tables.step(limit, allowed) {
            Step::Done => return Ok(false),
            Step::Full(most) => return Ok(self.make_room_for_rotation(&most, allowed)),
            Step::Waiting => {}
            Step::Evicted => self.share_tables(),
            Step::Read(readings) => {
                let result = self.emit_reads(readings);
                self.share_tables();
                result?;
            }
        }
        Ok(true)
    }

    /// Emits the results of reading rotations; returns the last failure.
    fn emit_reads(&mut self, readings: Vec<TableRead>) -> Result<(), LiveSceneError> {
        let mut result = Ok(());
        for TableRead { group, read } in readings {
            let Some(first) = self.entries.iter().position(|s| s.group == group) else {
                continue;
            };
            match read {
                Err(why) => {
                    self.emit(first, SceneChange::Failed(why.to_string()));
                    result = Err(LiveSceneError::Load {
                        pair: self.entries[first].spec.name.clone(),
                        source: why.into(),
                    });
                }
                Ok(Some(bytes)) => self.emit(first, SceneChange::Complete { bytes }),
                Ok(None) => {}
            }
        }
        result
    }

    /// Unloads the farthest pair out of reach if a rotation is needed soon, or emits that there is
    /// no room. True if a pair was unloaded.
    fn make_room_for_rotation(&mut self, node: &RotationNode, allowed: u64) -> bool {
        if node.urgency >= self.options.turn_ahead as f32 {
            return false;
        }
        let point = self.last_pivot;
        let whole = self.entries.iter().enumerate().filter(|(_, entry)| {
            let bytes = entry.loaded.as_ref().map_or(0, |resident| resident.bytes);
            bytes > 0 && entry.distance(point) > 0.0
        });
        let farthest = whole.max_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)));
        if let Some((victim, _)) = farthest {
            self.unload(victim);
            return true;
        }
        let entry = self.entries.iter().position(|s| s.group == node.group);
        if let Some(index) = entry
            && node.urgency < 0.0
            && self.tables.note_no_room(node.group)
        {
            let needed = self.tables.needed_bytes();
            let what = SceneChange::NoRoom {
                needed,
                free: allowed,
            };
            self.emit(index, what);
        }
        false
    }

    /// Publishes the resident part of every table.
    fn share_tables(&mut self) {
        for (group, source) in self.tables.share() {
            let entries = self.entries.iter_mut();
            for entry in entries.filter(|s| s.group == group && !s.reload) {
                if let Some(resident) = &mut entry.loaded {
                    resident.source = source.clone();
                }
            }
        }
        self.publish();
    }

    fn emit(&mut self, index: usize, what: SceneChange) {
        self.events.push(SceneEvent {
            at: Instant::now(),
            pair: self.entries[index].spec.name.clone(),
            what,
        });
    }

    fn publish(&self) {
        self.source.publish(sum(&self.entries, self.options.pivot));
    }
}

fn sum(entries: &[Entry], pivot: DVec3) -> SumSource {
    let placed = |entry: &Entry| PlacedSource {
        source: entry.loaded.as_ref().map(|l| l.source.clone()),
        placement: entry.spec.placement,
        reach: Some(entry.spec.reach),
    };
    SumSource::new(pivot, entries.iter().map(placed).collect())
}

/// Time and length of each file; `None` for one that is not there.
type FileStats = Vec<Option<(SystemTime, u64)>>;

/// A source in memory; several pairs may share it.
#[derive(Clone)]
struct Resident {
    source: SharedSource,
    reach: Aabb,
    /// Where it is right, if not everywhere.
    right: Option<Aabb>,
    /// 0 for a table that is kept in part: its rotations count.
    bytes: u64,
}

/// A pair and its state.
struct Entry {
    spec: PairSpec,
    /// The first pair with the same source.
    group: usize,
    loaded: Option<Resident>,
    state: PairState,
    /// The files as they were when last loaded.
    loaded_stats: FileStats,
    /// The files as they were at the last check.
    last_stats: FileStats,
    /// Where the pivot was when the pair was last loaded, fixed shape's frame.
    loaded_at: DVec3,
    reload: bool,
}

impl Entry {
    fn new(spec: PairSpec, group: usize) -> Self {
        let loaded_stats = file_stats(&spec.files);
        Self {
            last_stats: loaded_stats.clone(),
            loaded_stats,
            spec,
            group,
            loaded: None,
            state: PairState::Waiting,
            loaded_at: DVec3::ZERO,
            reload: false,
        }
    }

    /// A loader that panics has failed; the pairs that are loaded go on.
    fn run_loader(&mut self, point: DVec3) -> Result<LoadedPair, LoadFailure> {
        let Aabb { min, max } = self.spec.reach;
        // Where it first matters.
        self.loaded_at = self.place(point).clamp(min, max);
        let load = AssertUnwindSafe(|| (self.spec.load)(self.loaded_at));
        catch_unwind(load).unwrap_or_else(|panic| Err(panic_message(panic.as_ref()).into()))
    }

    /// A point of the scene in the fixed shape's frame.
    fn place(&self, point: DVec3) -> DVec3 {
        self.spec.placement.fixed.inverse().apply(point)
    }

    /// Metres from the reach to a point of the scene; 0 inside.
    fn distance(&self, point: DVec3) -> f64 {
        let at = self.place(point);
        let Aabb { min, max } = self.spec.reach;
        (min - at).max(at - max).max(DVec3::ZERO).length()
    }

    /// Requests a reload for a pivot that comes near the edge of where the source is right, unless it
    /// was loaded about there.
    fn follow(&mut self, point: DVec3) {
        let Some(right) = self.loaded.as_ref().and_then(|loaded| loaded.right) else {
            return;
        };
        let at = self.place(point);
        let away = |from: DVec3| ((at - from) / right.size()).abs().max_element();
        if self.distance(point) <= 0.0
            && away(right.center()) > NEAR_EDGE
            && away(self.loaded_at) > NEAR_EDGE
        {
            self.reload = true;
        }
    }

    /// Requests a reload if the files differ from those loaded and have not changed since the last
    /// check: a file that is being written is left alone.
    fn check_files(&mut self) {
        let now = file_stats(&self.spec.files);
        if now == self.last_stats && now != self.loaded_stats {
            self.loaded_stats.clone_from(&now);
            self.reload = true;
            if self.state == PairState::Failed {
                self.state = PairState::Waiting;
            }
        }
        self.last_stats = now;
    }
}

/// The source that the pairs of a group share, and its table if that is kept in part.
fn into_resident(loaded: LoadedPair) -> (Resident, Option<Rotations>) {
    let LoadedPair {
        content,
        reach,
        right,
    } = loaded;
    let (source, bytes, rotations) = match content {
        Content::Whole { source, bytes } => (SharedSource::new(source), bytes, None),
        Content::Table(table) => {
            let rotations = Rotations::new(*table);
            (rotations.source().clone(), 0, Some(rotations))
        }
    };
    let resident = Resident {
        source,
        reach,
        right,
        bytes,
    };
    (resident, rotations)
}

fn file_stats(files: &[PathBuf]) -> FileStats {
    let stat = |path: &PathBuf| {
        let meta = std::fs::metadata(path).ok()?;
        Some((meta.modified().ok()?, meta.len()))
    };
    files.iter().map(stat).collect()
}

#[cfg(test)]
#[path = "residency_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "rotations_tests.rs"]
mod rotations_tests;
