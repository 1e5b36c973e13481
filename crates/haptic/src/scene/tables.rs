//! Tables that are kept in part: what is near is read, nearest first, and what is far makes room.

use std::collections::BTreeMap;

use fft_correlate::{PartialTable, StoreError};

use crate::scene::rotations::{RotationNode, Rotations, Viewpoint, gives_way, spare, wanted};
use crate::scene::shared::SharedSource;

/// The tables of a scene that are kept in part, by the group of pairs that shares each.
#[derive(Default)]
pub(super) struct Tables {
    groups: BTreeMap<usize, Rotations>,
    /// Tables that were replaced or unloaded but that readers may still hold.
    retired: Vec<PartialTable>,
    /// Nothing is left to do until something changes.
    settled: bool,
    /// Threads that read tables while the loop runs.
    pool: Option<rayon::ThreadPool>,
}

/// What [`Tables::step`] did.
pub(super) enum Step {
    /// Nothing: what is wanted is there.
    Done,
    /// It read rotations.
    Read(Vec<TableRead>),
    /// It dropped rotations that others need more.
    Dropped,
    /// Nothing yet: what was dropped comes free when the loop lets go of it.
    Waiting,
    /// Nothing: there is no room for this one, the most urgent.
    Full(RotationNode),
}

/// What became of rotations that were to be read.
pub(super) struct TableRead {
    pub(super) group: usize,
    /// The bytes of the whole table if all of it is in memory now.
    pub(super) read: Result<Option<u64>, StoreError>,
}

impl Tables {
    /// From now on reading leaves a core to the loop.
    pub(super) fn leave_a_core(&mut self) {
        let threads = rayon::current_num_threads().saturating_sub(1).max(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        self.pool = pool.ok();
    }

    /// The table of a group, if it has one.
    pub(super) fn table(&self, group: usize) -> Option<&PartialTable> {
        self.groups.get(&group).map(|rotations| &rotations.table)
    }

    /// What is in memory now of each group's table.
    pub(super) fn show(&mut self) -> impl Iterator<Item = (usize, &SharedSource)> {
        let groups = self.groups.iter_mut();
        groups.map(|(&group, rotations)| (group, rotations.show()))
    }

    /// Whether nothing is left to do.
    pub(super) fn settled(&self) -> bool {
        self.settled
    }

    pub(super) fn settle(&mut self) {
        self.settled = true;
    }

    pub(super) fn unsettle(&mut self) {
        self.settled = false;
    }

    /// Bytes of the rotations that count as loaded.
    pub(super) fn bytes(&self) -> u64 {
        self.groups.values().map(Rotations::bytes).sum()
    }

    /// Bytes of rotations that are in memory, held by readers that have not yet let go of them too.
    pub(super) fn held_bytes(&self) -> u64 {
        let tables = self.groups.values().map(|rotations| &rotations.table);
        tables
            .chain(&self.retired)
            .map(PartialTable::held_bytes)
            .sum()
    }

    /// Bytes of the rotations that are needed where the part is.
    pub(super) fn needed_bytes(&self) -> u64 {
        let tables = self.groups.values();
        tables
            .map(|r| r.count(0.0) as u64 * r.table.node_bytes())
            .sum()
    }

    /// Puts a group's table in the place of the one it had, or of none.
    pub(super) fn change(&mut self, group: usize, rotations: Option<Rotations>) {
        let old = match rotations {
            Some(rotations) => self.groups.insert(group, rotations),
            None => self.groups.remove(&group),
        };
        self.retired.retain(|table| table.held_bytes() > 0);
        self.retired.extend(old.map(Rotations::retire));
        self.settled = false;
    }

    /// Brings the urgencies of all rotations up to date; `views` says from where a group is asked.
    pub(super) fn look(&mut self, views: impl Fn(usize) -> Vec<Viewpoint>) {
        for (&group, rotations) in &mut self.groups {
            if rotations.look(&views(group)) {
                self.settled = false;
            }
        }
    }

    /// Reads the most urgent rotations below `limit` that fit into `allowed` bytes, or makes room
    /// among the tables for them.
    pub(super) fn step(&mut self, limit: f32, allowed: u64) -> Step {
        let wanted = wanted(self.groups.iter(), limit);
        let Some(&most) = wanted.first() else {
            return Step::Done;
        };
        if most.urgency >= 0.0 {
            self.groups.values_mut().for_each(|r| r.cramped = false);
        }
        let batches = self.fitting(&wanted, allowed);
        if !batches.is_empty() {
            return Step::Read(self.read(batches));
        }
        if self.held_bytes() > self.bytes() {
            return Step::Waiting;
        }
        match self.give_way(&wanted) {
            true => Step::Dropped,
            false => Step::Full(most),
        }
    }

    /// The first nodes of `wanted` that fit into `allowed` bytes beside what is held, by group.
    fn fitting(&self, wanted: &[RotationNode], allowed: u64) -> Vec<(usize, Vec<usize>)> {
        let mut held = self.held_bytes();
        let mut batches: Vec<(usize, Vec<usize>)> = Vec::new();
        for node in wanted {
            held = held.saturating_add(self.groups[&node.group].table.node_bytes());
            if held > allowed {
                break;
            }
            match batches.iter_mut().find(|(group, _)| *group == node.group) {
                Some((_, nodes)) => nodes.push(node.node),
                None => batches.push((node.group, vec![node.node])),
            }
        }
        batches
    }

    fn read(&mut self, batches: Vec<(usize, Vec<usize>)>) -> Vec<TableRead> {
        let mut readings = Vec::new();
        for (group, nodes) in batches {
            let Some(rotations) = self.groups.get_mut(&group) else {
                continue;
            };
            let read = match &self.pool {
                Some(pool) => pool.install(|| rotations.load(&nodes)),
                None => rotations.load(&nodes),
            };
            let all = rotations.table.resident() == rotations.table.nodes();
            let read = read.map(|()| all.then(|| rotations.bytes()));
            readings.push(TableRead { group, read });
        }
        readings
    }

    /// Drops rotations that are less urgent than those `wanted`; false if none are.
    fn give_way(&mut self, wanted: &[RotationNode]) -> bool {
        let (Some(most), spare) = (wanted.first(), spare(self.groups.iter())) else {
            return false;
        };
        let table = &self.groups[&most.group];
        let ways = spare.iter().zip(wanted);
        let given = ways
            .take_while(|(spare, wanted)| gives_way(spare, wanted, table))
            .count();
        for node in &spare[..given] {
            if let Some(rotations) = self.groups.get_mut(&node.group) {
                rotations.table.unload(node.node);
            }
        }
        given > 0
    }

    /// Drops the least urgent rotations beyond `least` until `excess` bytes are free. False, and
    /// nothing is dropped, if they are too few.
    pub(super) fn shed(&mut self, excess: u64, least: f32) -> bool {
        let could: u64 = self
            .groups
            .values()
            .map(|r| r.spare_count(least) as u64 * r.table.node_bytes())
            .sum();
        if could < excess {
            return false;
        }
        let mut freed = 0;
        while freed < excess {
            for node in spare(self.groups.iter()) {
                if let Some(rotations) = self.groups.get_mut(&node.group)
                    && freed < excess
                {
                    rotations.table.unload(node.node);
                    freed += rotations.table.node_bytes();
                }
            }
        }
        self.settled = false;
        true
    }

    /// Notes that a group has no room for what it needs; true if that was not yet known.
    pub(super) fn is_newly_cramped(&mut self, group: usize) -> bool {
        let rotations = self.groups.get_mut(&group);
        rotations.is_some_and(|r| !std::mem::replace(&mut r.cramped, true))
    }
}
