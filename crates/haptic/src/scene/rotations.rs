//! Which rotation nodes of a scene's tables are in memory: those nearest to where the part may
//! turn.

use std::sync::Arc;

use fft_correlate::{PartialTable, Placement, Pose, StoreError};

use crate::scene::shared::SharedSource;

/// Nodes read or dropped at a time: a few milliseconds' worth.
const BATCH: usize = 32;

/// Added to the urgency of nodes of a pair that is out of reach, for being so and per metre.
const AWAY: f32 = 1e3;

/// A table of which a part is in memory, and how urgently each node is needed: the angle, radians,
/// by which the part would have to turn before it is; negative for nodes that are needed now.
pub(crate) struct Rotations {
    pub(crate) table: PartialTable,
    /// What is in memory of it, for the readers.
    source: SharedSource,
    urgency: Vec<f32>,
    distances: Vec<f32>,
    /// What the urgencies are for.
    views: Vec<Viewpoint>,
    /// Could not be read.
    bad: Vec<bool>,
    /// It was said that what is needed does not fit.
    pub(crate) cramped: bool,
}

/// A place from which a table is asked.
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
    pub(crate) node: usize,
}

impl Viewpoint {
    pub(crate) fn new(placement: &Placement, pose: &Pose, away: f64) -> Self {
        Self {
            rotation: placement.to_shapes(pose).rotation,
            away,
        }
    }

    /// As good as the same for what to load next.
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
            cramped: false,
        }
    }

    /// What was last shown of it.
    pub(crate) fn source(&self) -> &SharedSource {
        &self.source
    }

    /// What is in memory of it now.
    pub(crate) fn show(&mut self) -> &SharedSource {
        self.source = self.source.with_part(Arc::new(self.table.table()));
        &self.source
    }

    /// Half a step: a node that is less urgent by this much makes room for another.
    fn patience(&self) -> f32 {
        0.5 * self.table.step() as f32
    }

    /// Brings the urgencies up to date; true if they changed. Without a view nothing is wanted.
    pub(crate) fn look(&mut self, views: &[Viewpoint]) -> bool {
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

    /// Nodes that are wanted within `limit` and could be read, whether they are in memory or not.
    pub(crate) fn count(&self, limit: f32) -> usize {
        let urgent = self.urgency.iter().zip(&self.bad);
        urgent.filter(|(u, bad)| **u < limit && !**bad).count()
    }

    /// Nodes in memory that are wanted only beyond `least`.
    pub(crate) fn spare_count(&self, least: f32) -> usize {
        let urgent = self.urgency.iter().enumerate();
        urgent
            .filter(|(node, u)| **u > least && self.table.has(*node))
            .count()
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
    pub(crate) fn load(&mut self, nodes: &[usize]) -> Result<(), StoreError> {
        let result = self.table.load(nodes);
        for &node in nodes {
            self.bad[node] |= !self.table.has(node);
        }
        result
    }

    /// Drops everything that is in memory; the table, to see when readers have let go of it.
    pub(crate) fn retire(mut self) -> PartialTable {
        for node in 0..self.table.nodes() {
            self.table.unload(node);
        }
        self.table
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.table.resident() as u64 * self.table.node_bytes()
    }
}

/// The most urgent nodes of all tables that are not in memory, most urgent first.
pub(crate) fn wanted<'a>(
    tables: impl Iterator<Item = (&'a usize, &'a Rotations)>,
    limit: f32,
) -> Vec<RotationNode> {
    let absent = tables.flat_map(|(&group, table)| table.nodes(group, false));
    let wanted = absent.filter(|n| n.urgency < limit && n.urgency.is_finite());
    first(wanted.collect(), |a, b| a.urgency.total_cmp(&b.urgency))
}

/// The least urgent nodes of all tables that are in memory, least urgent first.
pub(crate) fn spare<'a>(
    tables: impl Iterator<Item = (&'a usize, &'a Rotations)>,
) -> Vec<RotationNode> {
    let there = tables.flat_map(|(&group, table)| table.nodes(group, true));
    first(there.collect(), |a, b| b.urgency.total_cmp(&a.urgency))
}

/// The first of a batch, in order.
fn first(
    mut nodes: Vec<RotationNode>,
    order: impl Fn(&RotationNode, &RotationNode) -> std::cmp::Ordering,
) -> Vec<RotationNode> {
    if nodes.len() > BATCH {
        nodes.select_nth_unstable_by(BATCH, &order);
        nodes.truncate(BATCH);
    }
    nodes.sort_unstable_by(order);
    nodes
}

/// Whether `spare` is to make room for `wanted`, of `table`.
pub(crate) fn gives_way(spare: &RotationNode, wanted: &RotationNode, table: &Rotations) -> bool {
    spare.urgency > wanted.urgency + table.patience()
}
