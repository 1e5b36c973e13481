//! Tables that are kept in part: what is near is read, nearest first, and what is far makes room.

use std::sync::Arc;

use fft_correlate::{PartialTable, Pose};

use super::Keeper;
use crate::rotations::{Node, Rotations, View, gives_way, spare, wanted};
use crate::scene::{SceneChange, SceneError};

impl Keeper {
    /// Bytes of the rotations that count as loaded.
    pub(super) fn rotation_bytes(&self) -> u64 {
        self.tables.values().map(Rotations::bytes).sum()
    }

    /// Bytes of rotations that are in memory, held by readers that have not yet let go of them too.
    pub(super) fn held_bytes(&self) -> u64 {
        let tables = self.tables.values().map(|rotations| &rotations.table);
        tables
            .chain(&self.retired)
            .map(PartialTable::held_bytes)
            .sum()
    }

    /// Puts a group's table in the place of the one it had, or of none.
    pub(super) fn change_table(&mut self, group: usize, table: Option<PartialTable>) {
        let old = match table {
            Some(table) => self.tables.insert(group, Rotations::new(table)),
            None => self.tables.remove(&group),
        };
        self.retired.retain(|table| table.held_bytes() > 0);
        self.retired.extend(old.map(Rotations::retire));
        self.settled = false;
    }

    /// Bytes of the rotations that are needed where the part is.
    pub(super) fn needed_bytes(&self) -> u64 {
        let tables = self.tables.values();
        tables
            .map(|r| r.count(0.0) as u64 * r.table.node_bytes())
            .sum()
    }

    /// Brings the urgencies of all rotations up to date for a moving part at `pose`.
    pub(super) fn look(&mut self, pose: &Pose) {
        let point = self.point(pose);
        self.last = point;
        let ahead = self.options.ahead;
        for (group, rotations) in &mut self.tables {
            let slots = self.slots.iter().filter(|s| s.group == *group);
            let views = slots
                .map(|s| View::new(&s.spec.placement, pose, s.distance(point)))
                .filter(|view| view.away <= ahead);
            if rotations.look(&views.collect::<Vec<_>>()) {
                self.settled = false;
            }
        }
    }

    /// One step of loading rotations for a moving part at `pose`. True if there is more to do.
    pub(super) fn turn(&mut self, pose: &Pose) -> bool {
        self.look(pose);
        if self.settled {
            return false;
        }
        // What could not be read is said already; the others are tried next.
        let more = self.load_rotations(f32::INFINITY).unwrap_or(true);
        self.settled = !more;
        more
    }

    /// Reads the most urgent rotations below `limit`, as many as have room, or makes room for them.
    /// True if there may be more to do.
    ///
    /// # Errors
    /// If some could not be read; they are not tried again.
    pub(super) fn load_rotations(&mut self, limit: f32) -> Result<bool, SceneError> {
        let wanted = wanted(self.tables.iter(), limit);
        let Some(most) = wanted.first() else {
            return Ok(false);
        };
        if most.urgency >= 0.0 {
            self.tables.values_mut().for_each(|r| r.cramped = false);
        }
        let allowed = self.options.memory.saturating_sub(self.bytes(|_, _| true));
        let mut held = self.held_bytes();
        let mut batches: Vec<(usize, Vec<usize>)> = Vec::new();
        for node in &wanted {
            held = held.saturating_add(self.tables[&node.group].table.node_bytes());
            if held > allowed {
                break;
            }
            match batches.iter_mut().find(|(group, _)| *group == node.group) {
                Some((_, nodes)) => nodes.push(node.node),
                None => batches.push((node.group, vec![node.node])),
            }
        }
        if !batches.is_empty() {
            return self.read(batches).map(|()| true);
        }
        if self.held_bytes() > self.rotation_bytes() {
            // What was dropped comes free when the loop lets go of it.
            return Ok(true);
        }
        let spare = spare(self.tables.iter());
        let ways = spare.iter().zip(&wanted);
        let table = &self.tables[&most.group];
        let given: Vec<_> = ways
            .take_while(|(spare, wanted)| gives_way(spare, wanted, table))
            .map(|(spare, _)| *spare)
            .collect();
        if given.is_empty() {
            return Ok(self.make_room_for(most, allowed));
        }
        for node in given {
            if let Some(rotations) = self.tables.get_mut(&node.group) {
                rotations.table.unload(node.node);
            }
        }
        self.show_tables();
        Ok(true)
    }

    fn read(&mut self, batches: Vec<(usize, Vec<usize>)>) -> Result<(), SceneError> {
        let mut result = Ok(());
        for (group, nodes) in batches {
            let Some(rotations) = self.tables.get_mut(&group) else {
                continue;
            };
            let read = match &self.pool {
                Some(pool) => pool.install(|| rotations.load(&nodes)),
                None => rotations.load(&nodes),
            };
            let (all, bytes) = (
                rotations.table.resident() == rotations.table.nodes(),
                rotations.bytes(),
            );
            let first = self.slots.iter().position(|s| s.group == group);
            let Some(first) = first else { continue };
            if let Err(why) = read {
                self.tell(first, SceneChange::Failed(why.to_string()));
                result = Err(SceneError::Load {
                    pair: self.slots[first].spec.name.clone(),
                    source: why.into(),
                });
            } else if all {
                self.tell(first, SceneChange::Complete { bytes });
            }
        }
        self.show_tables();
        result
    }

    /// Drops the least urgent rotations until `excess` bytes are free: of those that are not needed
    /// now, or, unless it is `urgent`, not soon. False if they are too few.
    pub(super) fn shed(&mut self, excess: u64, urgent: bool) -> bool {
        let least = match urgent {
            true => 0.0,
            false => self.options.turn_ahead as f32,
        };
        let could: u64 = self
            .tables
            .values()
            .map(|r| r.spare_count(least) as u64 * r.table.node_bytes())
            .sum();
        if could < excess {
            return false;
        }
        let mut freed = 0;
        while freed < excess {
            for node in spare(self.tables.iter()) {
                if let Some(rotations) = self.tables.get_mut(&node.group)
                    && freed < excess
                {
                    rotations.table.unload(node.node);
                    freed += rotations.table.node_bytes();
                }
            }
        }
        self.settled = false;
        self.show_tables();
        true
    }

    /// Unloads the farthest pair out of reach if a rotation is needed soon, or says that there is no
    /// room. True if a pair was unloaded.
    fn make_room_for(&mut self, node: &Node, allowed: u64) -> bool {
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
        let needed = self.needed_bytes();
        let slot = self.slots.iter().position(|s| s.group == node.group);
        if let (Some(index), Some(rotations)) = (slot, self.tables.get_mut(&node.group))
            && node.urgency < 0.0
            && !std::mem::replace(&mut rotations.cramped, true)
        {
            self.tell(
                index,
                SceneChange::NoRoom {
                    needed,
                    free: allowed,
                },
            );
        }
        false
    }

    /// Shows the readers what is in memory of every table.
    fn show_tables(&mut self) {
        for (group, rotations) in &self.tables {
            let source = Arc::new(rotations.table.table());
            let slots = self.slots.iter_mut();
            for slot in slots.filter(|s| s.group == *group && !s.reload) {
                if let Some(held) = &mut slot.loaded {
                    held.source = source.clone();
                }
            }
        }
        self.publish();
    }
}
