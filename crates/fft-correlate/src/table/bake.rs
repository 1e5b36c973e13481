//! Filling a table on disk, by any number of processes, interrupted any number of times.
//!
//! Nodes that differ by half turns make a group, of which one transform of the moving part serves
//! all; groups are dealt to processes by their number. Each node is compressed and renamed into
//! place on its own, and does not depend on which others of its group were missing: stopping
//! between nodes loses nothing, and the finished files do not depend on how the work was split. The
//! one number that all nodes share, the unit of energy, is found from nodes fixed by the grid and
//! stored before the first chunk.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::geometry::half_turn::{HalfTurn, HalfTurnGroup, half_turn_groups};
use crate::table::encode::{Encoded, Probe, encode, probe};
use crate::table::error::TableError;
use crate::table::producer::{NodeEnergies, nodes};
use crate::table::spec::TableSpec;
use crate::table::store::chunks::ChunkState;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::table_store::TableStore;

/// One process's part of a bake.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// This process, 0 .. size.
    pub rank: usize,
    /// Number of processes.
    pub size: usize,
    /// Continue a table that is already there. Several processes always share one table.
    pub resume: bool,
}

impl Share {
    /// All of a new table.
    pub const ALL: Self = Self {
        rank: 0,
        size: 1,
        resume: false,
    };
}

/// What a bake did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BakeReport {
    /// Rotation nodes of the whole table.
    pub rotations: usize,
    /// Nodes of this process computed now.
    pub computed: usize,
    /// Of these, nodes whose chunk was there but damaged.
    pub repaired: usize,
    /// Nodes of this process that were finished before.
    pub kept: usize,
    /// Bricks of the nodes computed now ([`crate::Storage::BRICK`]).
    pub bricks: usize,
    /// Of these, bricks that hold nothing but the far energy.
    pub bricks_left_out: usize,
}

/// Why a bake ended early. Finished nodes stay.
#[derive(Debug, thiserror::Error)]
pub enum BakeError {
    /// The table cannot be made, read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A table is already there and `resume` was not asked for.
    #[error("{}: there is already a table; resume it or choose another path", path.display())]
    Exists {
        /// Where.
        path: std::path::PathBuf,
    },
    /// The share is not one.
    #[error("rank must be below size, found rank {rank} of size {size}")]
    Share {
        /// The rank given.
        rank: usize,
        /// The size given.
        size: usize,
    },
    /// The monitor asked to stop.
    #[error("cancelled; resume to go on")]
    Cancelled,
}

impl From<TableError> for BakeError {
    fn from(e: TableError) -> Self {
        match e {
            TableError::Cancelled => Self::Cancelled,
            e => Self::Store(e.into()),
        }
    }
}

/// Computes this process's missing rotation nodes of the table at a path or URL
/// ([`TableFiles::at`]), making the table if there is none, on all threads of the current rayon
/// pool.
///
/// # Errors
/// If the specification or share is out of range, the table is of another specification or cannot
/// be written, an energy is not finite, or `monitor` cancels.
pub fn bake<P: NodeEnergies>(
    path: &Path,
    spec: &TableSpec,
    producer: &P,
    share: Share,
    monitor: &dyn Monitor,
) -> Result<BakeReport, BakeError> {
    bake_files(&TableFiles::at(path)?, spec, producer, share, monitor)
}

/// The same, wherever the table's files are.
///
/// # Errors
/// As [`bake`].
pub fn bake_files<P: NodeEnergies>(
    files: &TableFiles,
    spec: &TableSpec,
    producer: &P,
    share: Share,
    monitor: &dyn Monitor,
) -> Result<BakeReport, BakeError> {
    let Share { rank, size, .. } = share;
    if rank >= size {
        return Err(BakeError::Share { rank, size });
    }
    let store = begun(files, spec, producer, share)?;
    let all = store.grid().nodes();
    let groups = half_turn_groups(all);
    let groups: Vec<&HalfTurnGroup> = groups.iter().skip(rank).step_by(size).collect();
    let rows: usize = groups.iter().map(|g| g.members.len()).sum();
    let counts = Counts::default();
    monitor.begin("table", rows as u64);
    groups.par_iter().with_max_len(1).try_for_each_init(
        || (producer.scratch(), Vec::new(), Encoded::default()),
        |(scratch, joules, encoded), group| {
            if monitor.cancelled() {
                return Err(BakeError::Cancelled);
            }
            let missing = counts.missing(&store, group, monitor)?;
            if missing.is_empty() {
                return Ok(());
            }
            nodes(spec, producer, group.rotation, &missing, scratch, joules);
            for (joules, (_, row)) in joules.chunks_exact_mut(spec.window.len()).zip(missing) {
                encode(spec, &store.probe(), row, joules, encoded)?;
                store.chunks().write(row, encoded)?;
                tracing::debug!(row, "rotation finished");
                counts.add(encoded);
                monitor.advance(1);
            }
            Ok(())
        },
    )?;
    Ok(counts.report(all.len(), rows))
}

/// The table that is there, or a new one.
fn begun<P: NodeEnergies>(
    files: &TableFiles,
    spec: &TableSpec,
    producer: &P,
    share: Share,
) -> Result<TableStore, BakeError> {
    let probe = if files.exist()? {
        if !share.resume && share.size == 1 {
            return Err(BakeError::Exists {
                path: files.place().into(),
            });
        }
        // What was probed for a table that is there is its own.
        Probe {
            unit: 1.0,
            negligible: 0.0,
        }
    } else {
        spec.validate()?;
        let grid = spec.grid().map_err(TableError::from)?;
        probe(spec, &grid, producer)?
    };
    Ok(TableStore::create(files, spec, probe)?)
}

/// What the threads of a bake have done.
#[derive(Default)]
struct Counts {
    computed: AtomicUsize,
    repaired: AtomicUsize,
    bricks: AtomicUsize,
    left_out: AtomicUsize,
}

impl Counts {
    /// The members of a group that are not finished.
    fn missing(
        &self,
        store: &TableStore,
        group: &HalfTurnGroup,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(HalfTurn, usize)>, StoreError> {
        let mut missing = Vec::new();
        for &(turn, row) in &group.members {
            store.chunks().clean(row)?;
            match store.state(row)? {
                ChunkState::Finished => monitor.advance(1),
                state => {
                    missing.push((turn, row));
                    let damaged = state != ChunkState::Missing;
                    self.repaired.fetch_add(usize::from(damaged), Relaxed);
                }
            }
        }
        Ok(missing)
    }

    fn add(&self, written: &Encoded) {
        self.computed.fetch_add(1, Relaxed);
        self.left_out.fetch_add(written.bricks[0], Relaxed);
        self.bricks.fetch_add(written.bricks[1], Relaxed);
    }

    /// `rows` of `rotations` were this process's.
    fn report(self, rotations: usize, rows: usize) -> BakeReport {
        let computed = self.computed.into_inner();
        BakeReport {
            rotations,
            computed,
            repaired: self.repaired.into_inner(),
            kept: rows - computed,
            bricks: self.bricks.into_inner(),
            bricks_left_out: self.left_out.into_inner(),
        }
    }
}
