//! Decides which pairs of a scene, and which rotations of their tables, are in memory: one decision
//! and at most one load per step.

mod tables;
#[cfg(test)]
mod tables_tests;

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use fft_correlate::{EnergySource, PartialTable, Pose};
use glam::DVec3;
use sdf_grid::Aabb;

use crate::rotations::Rotations;
use crate::scene::{
    Content, LoadFailure, Loaded, PairSpec, PairState, SceneChange, SceneError, SceneEvent,
    SceneOptions,
};
use crate::servo::panic_message;
use crate::{LiveSource, Placed, SumSource};

/// Time and length of each file; `None` for one that is not there.
type Stamps = Vec<Option<(SystemTime, u64)>>;

/// A source in memory; several pairs may hold the same.
#[derive(Clone)]
struct Held {
    source: Arc<dyn EnergySource>,
    reach: Aabb,
    /// 0 for a table that is kept in part: its rotations count.
    bytes: u64,
}

struct Slot {
    spec: PairSpec,
    /// The first pair with the same source.
    group: usize,
    loaded: Option<Held>,
    state: PairState,
    /// The files as they were when last loaded.
    stamps: Stamps,
    /// The files as they were at the last look.
    seen: Stamps,
    reload: bool,
}

/// The pairs of a scene and what is loaded of them.
pub(crate) struct Keeper {
    slots: Vec<Slot>,
    /// The tables that are kept in part, by group.
    tables: BTreeMap<usize, Rotations>,
    /// Tables that were replaced or unloaded but that readers may still hold.
    retired: Vec<PartialTable>,
    options: SceneOptions,
    source: Arc<LiveSource>,
    watched: Instant,
    /// Where the pivot was at the last look at the tables.
    last: DVec3,
    /// Nothing is left to do for the tables until something changes.
    settled: bool,
    /// Threads that read tables while the loop runs.
    pool: Option<rayon::ThreadPool>,
    /// Not yet posted.
    pub(crate) events: Vec<SceneEvent>,
}

impl Keeper {
    /// Nothing loaded; `start` is where the moving part is.
    pub(crate) fn new(
        pairs: Vec<PairSpec>,
        options: SceneOptions,
        start: &Pose,
    ) -> (Self, Arc<LiveSource>) {
        let mut slots: Vec<Slot> = Vec::with_capacity(pairs.len());
        for spec in pairs {
            let first = spec.same_as.and_then(|same| slots.get(same));
            let group = first.map_or(slots.len(), |same| same.group);
            slots.push(Slot::new(spec, group));
        }
        let sum = sum(&slots, options.pivot);
        let source = Arc::new(LiveSource::new(sum, start));
        let keeper = Self {
            slots,
            tables: BTreeMap::new(),
            retired: Vec::new(),
            last: DVec3::ZERO,
            options,
            source: Arc::clone(&source),
            watched: Instant::now(),
            settled: false,
            pool: None,
            events: Vec::new(),
        };
        (keeper, source)
    }

    /// Loads every pair in reach at `start`, and of tables the rotations near it, or says why not.
    pub(crate) fn load_in_reach(&mut self, start: &Pose) -> Result<(), SceneError> {
        let point = self.point(start);
        let near: Vec<usize> = (0..self.slots.len())
            .filter(|&i| self.slots[i].distance(point) <= 0.0)
            .collect();
        for &index in &near {
            self.load(index).map_err(|source| SceneError::Load {
                pair: self.slots[index].spec.name.clone(),
                source,
            })?;
        }
        self.look(start);
        let (needed, budget) = (
            self.bytes(|_, _| true) + self.needed_bytes(),
            self.options.memory,
        );
        if needed > budget {
            let names = near.iter().map(|&i| self.slots[i].spec.name.as_str());
            return Err(SceneError::Memory {
                pairs: names.collect::<Vec<_>>().join(", "),
                needed,
                budget,
            });
        }
        while self.load_rotations(self.options.turn_ahead as f32)? {}
        self.publish();
        // The loop's core is left alone from now on.
        let threads = rayon::current_num_threads().saturating_sub(1).max(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        self.pool = pool.ok();
        Ok(())
    }

    /// Where the moving part's pivot is, scene frame.
    fn point(&self, pose: &Pose) -> DVec3 {
        pose.apply(self.options.pivot)
    }

    /// Marks a pair, and those that share its source, to be loaded again.
    pub(crate) fn reload(&mut self, index: usize) {
        let Some(group) = self.slots.get(index).map(|s| s.group) else {
            return;
        };
        for slot in self.slots.iter_mut().filter(|s| s.group == group) {
            slot.reload = true;
        }
    }

    /// The states of all pairs, into `states`.
    pub(crate) fn states(&self, states: &mut Vec<PairState>) {
        states.clear();
        states.extend(self.slots.iter().map(|s| match self.tables.get(&s.group) {
            Some(Rotations { table, .. }) if s.state == PairState::Loaded => {
                match (table.resident(), table.nodes()) {
                    (rotations, of) if rotations < of => PairState::Partly { rotations, of },
                    _ => PairState::Loaded,
                }
            }
            _ => s.state,
        }));
    }

    /// Looks at the files if it is time, and loads the most urgent pair, or else the most urgent
    /// rotations, for a moving part at `pose`. True if there is more to do.
    pub(crate) fn step(&mut self, pose: &Pose, now: Instant) -> bool {
        if now.saturating_duration_since(self.watched) >= self.options.watch {
            self.watched = now;
            for slot in &mut self.slots {
                slot.look();
            }
        }
        self.source.tend();
        let point = self.point(pose);
        match self.next(point) {
            Some(index) if self.make_room(index, point) => {
                self.bring(index);
                true
            }
            _ => self.turn(pose),
        }
    }

    /// The pair to load next: one that changed, else the nearest that is not loaded.
    fn next(&self, point: DVec3) -> Option<usize> {
        let slots = || self.slots.iter().enumerate();
        let stale = slots().find(|(_, s)| s.reload && (s.loaded.is_some() || s.near(self, point)));
        stale.map(|(i, _)| i).or_else(|| {
            slots()
                .filter(|(_, s)| s.loaded.is_none() && s.state != PairState::Failed)
                .filter(|(_, s)| s.near(self, point))
                .min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)))
                .map(|(i, _)| i)
        })
    }

    /// Bytes of the sources of the loaded pairs that count; a shared one once.
    fn bytes(&self, counts: impl Fn(usize, &Slot) -> bool) -> u64 {
        let counted = self.slots.iter().enumerate().filter(|(i, s)| counts(*i, s));
        let mut sources = std::collections::BTreeMap::new();
        for loaded in counted.filter_map(|(_, s)| s.loaded.as_ref()) {
            sources.insert(Arc::as_ptr(&loaded.source).cast::<()>(), loaded.bytes);
        }
        sources.values().sum()
    }

    /// Whether pair `other` holds what loading `index` is about to replace.
    fn outdated(&self, index: usize, other: usize) -> bool {
        let slot = &self.slots[other];
        other != index && slot.reload && slot.group == self.slots[index].group
    }

    /// What another pair has loaded that is this one's too, from the files as they are.
    fn shared(&self, index: usize, files: &Stamps) -> Option<Held> {
        let group = self.slots[index].group;
        let mut others = self.slots.iter().enumerate();
        let twin = others.find(|(i, s)| {
            let same = *i != index && s.group == group;
            same && s.loaded.is_some() && !s.reload && s.stamps == *files
        });
        twin.and_then(|(_, s)| s.loaded.clone())
    }

    /// Drops rotations that are far and unloads the farthest pairs out of reach until `index` fits.
    /// Pairs in reach stay.
    fn make_room(&mut self, index: usize, point: DVec3) -> bool {
        let files = stamps(&self.slots[index].spec.files);
        loop {
            let needed = match self.shared(index, &files) {
                Some(_) => 0,
                None => self.slots[index].spec.bytes,
            };
            let whole = self.bytes(|i, _| i != index && !self.outdated(index, i));
            let others = whole + self.rotation_bytes();
            if others.saturating_add(needed) <= self.options.memory {
                return true;
            }
            let own = self.slots[index].distance(point);
            let excess = others.saturating_add(needed) - self.options.memory;
            if self.shed(excess, own <= 0.0) {
                continue;
            }
            let farthest = (0..self.slots.len())
                .filter(|&i| i != index && self.slots[i].loaded.is_some())
                .map(|i| (self.slots[i].distance(point), i))
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
        let slot = &mut self.slots[index];
        slot.reload = false;
        if slot.state != PairState::NoRoom {
            slot.state = PairState::NoRoom;
            self.tell(index, SceneChange::NoRoom { needed, free });
        }
    }

    fn unload(&mut self, index: usize) {
        let slot = &mut self.slots[index];
        slot.loaded = None;
        slot.state = PairState::Waiting;
        let group = slot.group;
        if self
            .slots
            .iter()
            .all(|s| s.group != group || s.loaded.is_none())
        {
            self.change_table(group, None);
        }
        self.settled = false;
        self.publish();
        self.tell(index, SceneChange::Unloaded);
    }

    /// Loads a pair for which there is room, tells about it and shows it to the readers.
    fn bring(&mut self, index: usize) {
        let again = self.slots[index].loaded.is_some();
        let began = Instant::now();
        let what = match self.load(index) {
            Err(why) => SceneChange::Failed(why.to_string()),
            Ok(bytes) => {
                let seconds = began.elapsed().as_secs_f64();
                match (self.tables.get(&self.slots[index].group), again) {
                    (Some(Rotations { table, .. }), _) => SceneChange::Opened {
                        rotations: table.nodes(),
                        each: table.node_bytes(),
                    },
                    (None, true) => SceneChange::Reloaded { seconds, bytes },
                    (None, false) => SceneChange::Loaded { seconds, bytes },
                }
            }
        };
        self.tell(index, what);
        // It may have turned out larger than expected.
        let all = self.bytes(|i, _| !self.outdated(index, i)) + self.rotation_bytes();
        if all > self.options.memory && self.slots[index].spec.bytes > 0 {
            let needed = self.slots[index].spec.bytes;
            self.slots[index].loaded = None;
            let whole = self.bytes(|i, _| !self.outdated(index, i));
            let others = whole + self.rotation_bytes();
            let free = self.options.memory.saturating_sub(others);
            self.no_room(index, needed, free);
        }
        self.publish();
    }

    /// Loads a pair, or shares what was loaded for another, and gives the bytes that this takes;
    /// what was loaded before stays if it fails.
    fn load(&mut self, index: usize) -> Result<u64, LoadFailure> {
        let files = stamps(&self.slots[index].spec.files);
        let shared = self.shared(index, &files);
        let more = u64::from(shared.is_none());
        let slot = &mut self.slots[index];
        slot.reload = false;
        slot.seen.clone_from(&files);
        slot.stamps = files;
        let result = match shared {
            Some(held) => Ok((held, None)),
            None => slot.load().map(hold),
        };
        match result {
            Ok((loaded, table)) => {
                let (group, bytes) = (slot.group, loaded.bytes);
                slot.spec.reach = loaded.reach;
                slot.spec.bytes = bytes;
                slot.loaded = Some(loaded);
                slot.state = PairState::Loaded;
                if more == 1 {
                    self.change_table(group, table);
                }
                Ok(bytes * more)
            }
            Err(why) => {
                if slot.loaded.is_none() {
                    slot.state = PairState::Failed;
                }
                Err(why)
            }
        }
    }

    fn tell(&mut self, index: usize, what: SceneChange) {
        self.events.push(SceneEvent {
            at: Instant::now(),
            pair: self.slots[index].spec.name.clone(),
            what,
        });
    }

    fn publish(&self) {
        self.source.publish(sum(&self.slots, self.options.pivot));
    }
}

impl Slot {
    fn new(spec: PairSpec, group: usize) -> Self {
        let stamps = stamps(&spec.files);
        Self {
            seen: stamps.clone(),
            stamps,
            spec,
            group,
            loaded: None,
            state: PairState::Waiting,
            reload: false,
        }
    }

    /// A loader that panics has failed; the pairs that are loaded go on.
    fn load(&mut self) -> Result<Loaded, LoadFailure> {
        let load = AssertUnwindSafe(|| (self.spec.load)());
        catch_unwind(load).unwrap_or_else(|panic| Err(panic_message(panic.as_ref()).into()))
    }

    /// Metres from the reach to a point of the scene; 0 inside.
    fn distance(&self, point: DVec3) -> f64 {
        let at = self.spec.placement.inverse().apply(point);
        let Aabb { min, max } = self.spec.reach;
        (min - at).max(at - max).max(DVec3::ZERO).length()
    }

    fn near(&self, keeper: &Keeper, point: DVec3) -> bool {
        self.distance(point) <= keeper.options.ahead
    }

    /// Asks for a reload if the files differ from those loaded and have stood still since the last
    /// look: a file that is being written is left alone.
    fn look(&mut self) {
        let now = stamps(&self.spec.files);
        let settled = now == self.seen;
        if settled && now != self.stamps {
            self.stamps.clone_from(&now);
            self.reload = true;
            if self.state == PairState::Failed {
                self.state = PairState::Waiting;
            }
        }
        self.seen = now;
    }
}

/// What the pairs of a group share, and the table if it is kept in part.
fn hold(loaded: Loaded) -> (Held, Option<PartialTable>) {
    let Loaded { content, reach } = loaded;
    let (source, bytes, table): (Arc<dyn EnergySource>, _, _) = match content {
        Content::Whole { source, bytes } => (source, bytes, None),
        Content::Table(table) => (Arc::new(table.table()), 0, Some(*table)),
    };
    let held = Held {
        source,
        reach,
        bytes,
    };
    (held, table)
}

fn stamps(files: &[PathBuf]) -> Stamps {
    let stamp = |path: &PathBuf| {
        let meta = std::fs::metadata(path).ok()?;
        Some((meta.modified().ok()?, meta.len()))
    };
    files.iter().map(stamp).collect()
}

fn sum(slots: &[Slot], pivot: DVec3) -> SumSource {
    let placed = |slot: &Slot| Placed {
        source: slot.loaded.as_ref().map(|l| Arc::clone(&l.source)),
        placement: slot.spec.placement,
        reach: Some(slot.spec.reach),
    };
    SumSource::new(pivot, slots.iter().map(placed).collect())
}

#[cfg(test)]
#[path = "keeper_tests.rs"]
mod tests;
