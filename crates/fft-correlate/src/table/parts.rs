//! Tables of which only the rotation nodes near a rotation are in memory.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::DQuat;
use rayon::prelude::*;

use crate::table::energy_table::{EnergyTable, Plan};
use crate::table::layout::{Layout, Row, zeroed_pages};
use crate::table::spec::TableSpec;
use crate::table::store::error::StoreError;
use crate::table::store::table_store::TableStore;

/// A table on disk and the rotation nodes of it that are in memory. Its [`PartialTable::table`]
/// answers wherever all nodes that it reads are there, with the same energy and wrench, bit by bit,
/// as the whole table; elsewhere as far away.
///
/// Nothing is left out of a node that is in memory, so [`PartialTable::node_bytes`] may be more
/// than its share of [`TableStore::load`]'s table.
///
/// See the example of [`TableStore`].
#[derive(Debug)]
pub struct PartialTable {
    store: TableStore,
    plan: Arc<Plan>,
    rows: Vec<Option<Arc<Row>>>,
    held: Arc<AtomicU64>,
}

impl PartialTable {
    /// The distance, in nodes, within which [`EnergyTable`] needs every node in memory to answer
    /// and to be [`crate::EnergySource::is_loaded`]: 2 that are read, and one around them.
    pub const NEEDED: f32 = 3.0;

    /// Nothing of a table in memory yet.
    ///
    /// # Errors
    /// If the table is not finished, or its files cannot be listed.
    pub fn new(store: TableStore) -> Result<Self, StoreError> {
        store.expect_all_there()?;
        let rotations = store.grid().nodes().len();
        let plan = Plan::new(
            store.whole_spec()?,
            store.grid().clone(),
            store.probe(),
            Layout::dense(store.spec().window.shape()),
            (0..rotations as u32).collect(),
        );
        Ok(Self {
            store,
            plan: Arc::new(plan),
            rows: vec![None; rotations],
            held: Arc::default(),
        })
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.plan.spec
    }

    /// Angle between neighbouring rotation nodes, radians ([`crate::RotationGrid::step`]).
    pub fn step(&self) -> f64 {
        self.plan.grid.step()
    }

    /// Rotation nodes of the whole table.
    pub fn nodes(&self) -> usize {
        self.rows.len()
    }

    /// Rotation nodes in memory.
    pub fn resident(&self) -> usize {
        self.rows.iter().flatten().count()
    }

    /// Whether a rotation node is in memory.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn has(&self, node: usize) -> bool {
        self.rows[node].is_some()
    }

    /// Bytes that each rotation node takes in memory.
    pub fn node_bytes(&self) -> u64 {
        2 * self.plan.layout.length() as u64
    }

    /// Bytes of the nodes that are in memory, and of those that were dropped here but are still
    /// held by a table that [`PartialTable::table`] gave.
    pub fn held_bytes(&self) -> u64 {
        self.held.load(Ordering::Relaxed)
    }

    /// Writes to `distances` how far each rotation node lies from `rotation`, in nodes. All nodes
    /// nearer than [`PartialTable::NEEDED`] are needed there.
    ///
    /// # Panics
    /// If there are not as many distances as nodes.
    pub fn distances(&self, rotation: DQuat, distances: &mut [f32]) {
        assert_eq!(distances.len(), self.nodes(), "one distance per node");
        self.plan.grid.distances(rotation, distances);
    }

    /// Reads rotation nodes into memory, on all threads of the current rayon pool, checking every
    /// checksum. Nodes that are there already are left as they are.
    ///
    /// # Errors
    /// If one is not on disk or damaged. The others are in memory all the same.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn load(&mut self, nodes: &[usize]) -> Result<(), StoreError> {
        let read = |&node: &usize| {
            let mut codes = zeroed_pages(self.plan.layout.length());
            self.store.read_row(node, &self.plan.layout, &mut codes)?;
            Ok((node, Arc::new(Row::new(codes, &self.held))))
        };
        let absent = nodes.par_iter().filter(|&&node| self.rows[node].is_none());
        let read: Vec<Result<_, StoreError>> = absent.map(read).collect();
        let mut failed = None;
        for row in read {
            match row {
                Ok((node, row)) => self.rows[node] = Some(row),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        failed.map_or(Ok(()), Err)
    }

    /// Drops a rotation node; its memory is free once no table that [`PartialTable::table`] gave
    /// holds it.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn unload(&mut self, node: usize) {
        self.rows[node] = None;
    }

    /// The table as it is in memory now; later changes are not seen by it.
    pub fn table(&self) -> EnergyTable {
        EnergyTable::of_parts(Arc::clone(&self.plan), self.rows.clone())
    }
}
