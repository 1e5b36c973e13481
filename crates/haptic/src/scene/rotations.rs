//! Which rotation nodes of a scene's tables are in memory: the nearest are read first, and the
//! farthest are evicted when the budget is used up.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::Arc;

use fft_correlate::{PartialTable, Placement, Pose, StoreError};

use crate::scene::sum::SharedSource;

/// Nodes read or dropped at a time: a few milliseconds' worth.
const BATCH: usize = 32;

/// Added to the urgency of nodes of a pair that is out of reach, for being so and per metre.
const AWAY: f32 = 1e3;

/// A table of which a part is in memory, and how urgently each node is needed: the angle, radians,
/// by which the part would have to turn before it is; negative for nodes that are needed now.
pub(crate) struct Rotations {
    table: PartialTable,
    /// What is in memory of it, for the readers.
    source: SharedSource,
    urgency: Vec<f32>,
    distances: Vec<f32>,
    /// What the urgencies are for.
    views: Vec<Viewpoint>,
    /// Nodes that could not be read.
    bad: Vec<bool>,
    /// Whether it was already reported that the needed nodes do not fit.
    no_room_noted: bool,
}

/// A rotation at which a table is evaluated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Viewpoint {
    /// The rotation of the shapes there.
    pub(crate) rotation: glam::DQuat,
    /// Metres out of reach.
    pub(crate) away: f64,
}

/// A node of one of the tables.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RotationNode {
    pub(crate) urgency: f32,
    pub(crate) group: usize,
    node: usize,
}

impl Viewpoint {
    pub(crate) fn new(placement: &Placement, pose: &Pose, away: f64) -> Self {
        Self {
            rotation: placement.to_shapes(pose).rotation,
            away,
        }
    }

    /// Whether both give practically the same priorities.
    fn is_near(&self, other: &Self, step: f64) -> bool {
        let same_side = (self.away > 0.0) == (other.away > 0.0);
        same_side && self.rotation.angle_between(other.rotation) < 0.1 * step
    }
}

impl Rotations {
    pub(crate) fn new(table: PartialTable) -> Self {
        let nodes = table.nodes();
        Self {
            source: SharedSource::new(Arc::new(table.table())),
            table,
            urgency: vec![f32::INFINITY; nodes],
            distances: vec![0.0; nodes],
            views: Vec::new(),
            bad: vec![false; nodes],
            no_room_noted: false,
        }
    }

    /// What readers were last given of it.
    pub(crate) fn source(&self) -> &SharedSource {
        &self.source
    }

    /// Renews the readers' source from what is in memory now.
    fn share(&mut self) -> &SharedSource {
        self.source = self.source.with_part(Arc::new(self.table.table()));
        &self.source
    }

    /// Updates the urgencies; true if they changed. Without a view nothing is wanted.
    fn update_priorities(&mut self, views: &[Viewpoint]) -> bool {
        let step = self.table.step();
        let old = self.views.iter().zip(views);
        if old.len() == self.views.len().max(views.len())
            && old.clone().all(|(a, b)| a.is_near(b, step))
        {
            return false;
        }
        self.views = views.to_vec();
        self.urgency.fill(f32::INFINITY);
        for view in views {
            self.table.distances(view.rotation, &mut self.distances);
            let far = match view.away > 0.0 {
                true => AWAY * (1.0 + view.away as f32),
                false => 0.0,
            };
            for (urgency, distance) in self.urgency.iter_mut().zip(&self.distances) {
                let turn = (distance - PartialTable::NEEDED) * step as f32;
                *urgency = urgency.min(turn + far);
            }
        }
        true
    }

    /// Bytes of the readable nodes that are needed now, whether they are in memory or not.
    fn needed_bytes(&self) -> u64 {
        let nodes = self.urgency.iter().zip(&self.bad);
        let needed = nodes.filter(|(urgency, bad)| **urgency < 0.0 && !**bad);
        needed.count() as u64 * self.table.node_bytes()
    }

    fn nodes(&self, group: usize, resident: bool) -> impl Iterator<Item = RotationNode> + '_ {
        let urgent = self.urgency.iter().enumerate();
        urgent
            .filter(move |(node, _)| self.table.has(*node) == resident && !self.bad[*node])
            .map(move |(node, &urgency)| RotationNode {
                urgency,
                group,
                node,
            })
    }

    /// Reads nodes; those that cannot be are not tried again.
    fn load(&mut self, nodes: &[usize]) -> Result<(), StoreError> {
        let result = self.table.load(nodes);
        for &node in nodes {
            self.bad[node] |= !self.table.has(node);
        }
        result
    }

    /// Evicts everything. The table that is left shows when readers have let go of it.
    fn retire(mut self) -> PartialTable {
        for node in 0..self.table.nodes() {
            self.table.unload(node);
        }
        self.table
    }

    fn bytes(&self) -> u64 {
        self.table.resident() as u64 * self.table.node_bytes()
    }
}

/// The first [`BATCH`] nodes, in order.
fn first_batch(
    nodes: impl Iterator<Item = RotationNode>,
    order: impl Fn(&RotationNode, &RotationNode) -> Ordering,
) -> Vec<RotationNode> {
    let mut nodes: Vec<_> = nodes.collect();
    if nodes.len() > BATCH {
        nodes.select_nth_unstable_by(BATCH, &order);
        nodes.truncate(BATCH);
    }
    nodes.sort_unstable_by(order);
    nodes
}

/// The tables of a scene that are kept in part, by the group of pairs that shares each.
#[derive(Default)]
pub(crate) struct Tables {
    groups: BTreeMap<usize, Rotations>,
    /// Tables that were replaced or unloaded but that readers may still hold.
    retired: Vec<PartialTable>,
    /// Whether nothing is left to do until something changes.
    pub(crate) idle: bool,
    /// Threads that read tables while the loop runs.
    pool: Option<rayon::ThreadPool>,
}

/// What [`Tables::step`] did.
pub(crate) enum Step {
    /// Nothing: what is wanted is there.
    Done,
    /// It read rotations.
    Read(Vec<TableRead>),
    /// It evicted rotations for more urgent ones.
    Evicted,
    /// Nothing yet: what was evicted becomes free when the loop lets go of it.
    Waiting,
    /// Nothing: there is no room for this one, the most urgent.
    Full(RotationNode),
}

/// The result of reading rotations of one group.
pub(crate) struct TableRead {
    pub(crate) group: usize,
    /// The bytes of the whole table if all of it is in memory now.
    pub(crate) read: Result<Option<u64>, StoreError>,
}

impl Tables {
    /// From now on reading leaves a core to the loop.
    pub(crate) fn leave_a_core(&mut self) {
        let threads = rayon::current_num_threads().saturating_sub(1).max(1);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        self.pool = pool.ok();
    }

    /// The table of a group, if it has one.
    pub(crate) fn table(&self, group: usize) -> Option<&PartialTable> {
        self.groups.get(&group).map(|rotations| &rotations.table)
    }

    /// Renews every group's source from what is in memory now.
    pub(crate) fn share(&mut self) -> impl Iterator<Item = (usize, &SharedSource)> {
        let groups = self.groups.iter_mut();
        groups.map(|(&group, rotations)| (group, rotations.share()))
    }

    /// Bytes of the rotations that count as loaded.
    pub(crate) fn bytes(&self) -> u64 {
        self.groups.values().map(Rotations::bytes).sum()
    }

    /// Bytes of rotations that are in memory, held by readers that have not yet let go of them too.
    pub(crate) fn held_bytes(&self) -> u64 {
        let tables = self.groups.values().map(|rotations| &rotations.table);
        tables
            .chain(&self.retired)
            .map(PartialTable::held_bytes)
            .sum()
    }

    /// Bytes of the rotations that are needed where the part is.
    pub(crate) fn needed_bytes(&self) -> u64 {
        self.groups.values().map(Rotations::needed_bytes).sum()
    }

    /// Replaces a group's table.
    pub(crate) fn change(&mut self, group: usize, rotations: Option<Rotations>) {
        let old = match rotations {
            Some(rotations) => self.groups.insert(group, rotations),
            None => self.groups.remove(&group),
        };
        self.retired.retain(|table| table.held_bytes() > 0);
        self.retired.extend(old.map(Rotations::retire));
        self.idle = false;
    }

    /// Updates the urgencies of all rotations; `views` gives the rotations at which a group is
    /// evaluated.
    pub(crate) fn update_priorities(&mut self, views: impl Fn(usize) -> Vec<Viewpoint>) {
        for (&group, rotations) in &mut self.groups {
            if rotations.update_priorities(&views(group)) {
                self.idle = false;
            }
        }
    }

    /// Reads the most urgent rotations below `limit` that fit into `allowed` bytes, or evicts
    /// others for them.
    pub(crate) fn step(&mut self, limit: f32, allowed: u64) -> Step {
        let absent = self.nodes(false);
        let wanted = absent.filter(|n| n.urgency < limit && n.urgency.is_finite());
        let wanted = first_batch(wanted, |a, b| a.urgency.total_cmp(&b.urgency));
        let Some(&most) = wanted.first() else {
            return Step::Done;
        };
        if most.urgency >= 0.0 {
            self.groups
                .values_mut()
                .for_each(|r| r.no_room_noted = false);
        }
        let batches = self.batches_that_fit(&wanted, allowed);
        if !batches.is_empty() {
            return Step::Read(self.read(batches));
        }
        if self.held_bytes() > self.bytes() {
            return Step::Waiting;
        }
        match self.evict_for(&wanted) {
            true => Step::Evicted,
            false => Step::Full(most),
        }
    }

    /// The first nodes of `wanted` that fit into `allowed` bytes beside what is held, by group.
    fn batches_that_fit(&self, wanted: &[RotationNode], allowed: u64) -> Vec<(usize, Vec<usize>)> {
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

    /// The nodes of all tables that are in memory, or that are not and can be read.
    fn nodes(&self, resident: bool) -> impl Iterator<Item = RotationNode> + '_ {
        let groups = self.groups.iter();
        groups.flat_map(move |(&group, table)| table.nodes(group, resident))
    }

    /// Nodes in memory, least urgent first.
    fn least_urgent(&self) -> Vec<RotationNode> {
        first_batch(self.nodes(true), |a, b| b.urgency.total_cmp(&a.urgency))
    }

    fn unload(&mut self, node: &RotationNode) {
        if let Some(rotations) = self.groups.get_mut(&node.group) {
            rotations.table.unload(node.node);
        }
    }

    /// Evicts rotations that are less urgent than those `wanted` by more than half a step; false if
    /// there are none.
    fn evict_for(&mut self, wanted: &[RotationNode]) -> bool {
        let patience = wanted.first().map_or(0.0, |most| {
            0.5 * self.groups[&most.group].table.step() as f32
        });
        let mut evicted = false;
        for (spare, wanted) in self.least_urgent().iter().zip(wanted) {
            if spare.urgency <= wanted.urgency + patience {
                break;
            }
            self.unload(spare);
            evicted = true;
        }
        evicted
    }

    /// Evicts the least urgent rotations beyond `least` until `excess` bytes are free. False, and
    /// nothing is evicted, if they are too few.
    pub(crate) fn evict(&mut self, excess: u64, least: f32) -> bool {
        let size = |group: &usize| self.groups[group].table.node_bytes();
        let spare = self.nodes(true).filter(|node| node.urgency > least);
        if spare.map(|node| size(&node.group)).sum::<u64>() < excess {
            return false;
        }
        let mut freed = 0;
        while freed < excess {
            for node in self.least_urgent() {
                if freed < excess {
                    self.unload(&node);
                    freed += self.groups[&node.group].table.node_bytes();
                }
            }
        }
        self.idle = false;
        true
    }

    /// Records that a group's needed rotations do not fit; true if that is new.
    pub(crate) fn note_no_room(&mut self, group: usize) -> bool {
        let rotations = self.groups.get_mut(&group);
        rotations.is_some_and(|r| !std::mem::replace(&mut r.no_room_noted, true))
    }
}
