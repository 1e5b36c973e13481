//! Decides which pairs of a scene, and which rotations of their tables, are in memory: one decision
//! and at most one load per step.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use fft_correlate::Pose;
use glam::DVec3;

use crate::scene::error::LiveSceneError;
use crate::scene::event::{PairState, SceneChange, SceneEvent};
use crate::scene::live_source::LiveSource;
use crate::scene::options::SceneOptions;
use crate::scene::pair::{LoadFailure, PairSpec};
use crate::scene::rotations::{RotationNode, Viewpoint};
use crate::scene::slot::{Held, Slot, Stamps, hold, stamps};
use crate::scene::sum::{Placed, SumSource};
use crate::scene::tables::{Step, TableRead, Tables};

/// The pairs of a scene and what is loaded of them.
pub(crate) struct Keeper {
    slots: Vec<Slot>,
    tables: Tables,
    options: SceneOptions,
    source: Arc<LiveSource>,
    watched: Instant,
    /// Where the pivot was at the last look at the tables.
    last: DVec3,
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
            tables: Tables::default(),
            last: DVec3::ZERO,
            options,
            source: Arc::clone(&source),
            watched: Instant::now(),
            events: Vec::new(),
        };
        (keeper, source)
    }

    /// Loads every pair in reach at `start`, and of tables the rotations near it, or says why not.
    pub(crate) fn load_in_reach(&mut self, start: &Pose) -> Result<(), LiveSceneError> {
        let point = self.point(start);
        let near: Vec<usize> = (0..self.slots.len())
            .filter(|&i| self.slots[i].distance(point) <= 0.0)
            .collect();
        for &index in &near {
            self.load(index).map_err(|source| LiveSceneError::Load {
                pair: self.slots[index].spec.name.clone(),
                source,
            })?;
        }
        self.look(start);
        let (needed, budget) = (
            self.bytes(|_, _| true) + self.tables.needed_bytes(),
            self.options.memory,
        );
        if needed > budget {
            let names = near.iter().map(|&i| self.slots[i].spec.name.as_str());
            return Err(LiveSceneError::Memory {
                pairs: names.collect::<Vec<_>>().join(", "),
                needed,
                budget,
            });
        }
        while self.load_rotations(self.options.turn_ahead as f32)? {}
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
        states.extend(self.slots.iter().map(|s| match self.tables.table(s.group) {
            Some(table) if s.state == PairState::Loaded => {
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
        let near = |s: &Slot| s.distance(point) <= self.options.ahead;
        let stale = slots().find(|(_, s)| s.reload && (s.loaded.is_some() || near(s)));
        stale.map(|(i, _)| i).or_else(|| {
            slots()
                .filter(|(_, s)| s.loaded.is_none() && s.state != PairState::Failed)
                .filter(|(_, s)| near(s))
                .min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)))
                .map(|(i, _)| i)
        })
    }

    /// Bytes of the sources of the loaded pairs that count; a shared one once.
    fn bytes(&self, counts: impl Fn(usize, &Slot) -> bool) -> u64 {
        let counted = self.slots.iter().enumerate().filter(|(i, s)| counts(*i, s));
        let held = counted.filter_map(|(_, s)| s.loaded.as_ref());
        let sources: BTreeMap<_, _> = held.map(|h| (h.source.id(), h.bytes)).collect();
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
            let others = whole + self.tables.bytes();
            if others.saturating_add(needed) <= self.options.memory {
                return true;
            }
            let own = self.slots[index].distance(point);
            let excess = others.saturating_add(needed) - self.options.memory;
            let least = match own <= 0.0 {
                true => 0.0,
                false => self.options.turn_ahead as f32,
            };
            if self.tables.shed(excess, least) {
                self.show_tables();
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
            self.tables.change(group, None);
        }
        self.tables.unsettle();
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
                match (self.tables.table(self.slots[index].group), again) {
                    (Some(table), _) => SceneChange::Opened {
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
        let all = self.bytes(|i, _| !self.outdated(index, i)) + self.tables.bytes();
        if all > self.options.memory && self.slots[index].spec.bytes > 0 {
            let needed = self.slots[index].spec.bytes;
            self.slots[index].loaded = None;
            let whole = self.bytes(|i, _| !self.outdated(index, i));
            let others = whole + self.tables.bytes();
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
                    self.tables.change(group, table);
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

    /// Brings the urgencies of all rotations up to date for a moving part at `pose`.
    fn look(&mut self, pose: &Pose) {
        let point = self.point(pose);
        self.last = point;
        let (slots, ahead) = (&self.slots, self.options.ahead);
        self.tables.look(|group| {
            let slots = slots.iter().filter(|s| s.group == group);
            let views = slots.map(|s| Viewpoint::new(&s.spec.placement, pose, s.distance(point)));
            views.filter(|view| view.away <= ahead).collect()
        });
    }

    /// One step of loading rotations for a moving part at `pose`. True if there is more to do.
    fn turn(&mut self, pose: &Pose) -> bool {
        self.look(pose);
        if self.tables.settled() {
            return false;
        }
        // What could not be read is said already; the others are tried next.
        let more = self.load_rotations(f32::INFINITY).unwrap_or(true);
        if !more {
            self.tables.settle();
        }
        more
    }

    /// Reads the most urgent rotations below `limit`, as many as have room, or makes room for them.
    /// True if there may be more to do.
    ///
    /// # Errors
    /// If some could not be read; they are not tried again.
    fn load_rotations(&mut self, limit: f32) -> Result<bool, LiveSceneError> {
        let allowed = self.options.memory.saturating_sub(self.bytes(|_, _| true));
        match self.tables.step(limit, allowed) {
            Step::Done => return Ok(false),
            Step::Full(most) => return Ok(self.make_room_for(&most, allowed)),
            Step::Waiting => {}
            Step::Dropped => self.show_tables(),
            Step::Read(readings) => {
                let told = self.tell_read(readings);
                self.show_tables();
                told?;
            }
        }
        Ok(true)
    }

    /// Tells what became of the tables read; the last failure.
    fn tell_read(&mut self, readings: Vec<TableRead>) -> Result<(), LiveSceneError> {
        let mut result = Ok(());
        for TableRead { group, read } in readings {
            let Some(first) = self.slots.iter().position(|s| s.group == group) else {
                continue;
            };
            match read {
                Err(why) => {
                    self.tell(first, SceneChange::Failed(why.to_string()));
                    result = Err(LiveSceneError::Load {
                        pair: self.slots[first].spec.name.clone(),
                        source: why.into(),
                    });
                }
                Ok(Some(bytes)) => self.tell(first, SceneChange::Complete { bytes }),
                Ok(None) => {}
            }
        }
        result
    }

    /// Unloads the farthest pair out of reach if a rotation is needed soon, or says that there is
    /// no room. True if a pair was unloaded.
    fn make_room_for(&mut self, node: &RotationNode, allowed: u64) -> bool {
        if node.urgency >= self.options.turn_ahead as f32 {
            return false;
        }
        let point = self.last;
        let whole = self.slots.iter().enumerate().filter(|(_, slot)| {
            let bytes = slot.loaded.as_ref().map_or(0, |held| held.bytes);
            bytes > 0 && slot.distance(point) > 0.0
        });
        let farthest = whole.max_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)));
        if let Some((victim, _)) = farthest {
            self.unload(victim);
            return true;
        }
        let slot = self.slots.iter().position(|s| s.group == node.group);
        if let Some(index) = slot
            && node.urgency < 0.0
            && self.tables.is_newly_cramped(node.group)
        {
            let needed = self.tables.needed_bytes();
            let what = SceneChange::NoRoom {
                needed,
                free: allowed,
            };
            self.tell(index, what);
        }
        false
    }

    /// Shows the readers what is in memory of every table.
    fn show_tables(&mut self) {
        for (group, source) in self.tables.show() {
            let slots = self.slots.iter_mut();
            for slot in slots.filter(|s| s.group == group && !s.reload) {
                if let Some(held) = &mut slot.loaded {
                    held.source = source.clone();
                }
            }
        }
        self.publish();
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

fn sum(slots: &[Slot], pivot: DVec3) -> SumSource {
    let placed = |slot: &Slot| Placed {
        source: slot.loaded.as_ref().map(|l| l.source.clone()),
        placement: slot.spec.placement,
        reach: Some(slot.spec.reach),
    };
    SumSource::new(pivot, slots.iter().map(placed).collect())
}

#[cfg(test)]
#[path = "keeper_tests.rs"]
mod tests;

#[cfg(test)]
#[path = "tables_tests.rs"]
mod tables_tests;
