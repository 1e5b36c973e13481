//! Filling a table on disk, by any number of processes, interrupted any number of times.
//!
//! Nodes that differ by half turns make a group, of which one transform of the moving part serves
//! all; groups are dealt to processes by their number. Each node is compressed and renamed into
//! place on its own, and does not depend on which others of its group were missing: stopping
//! between nodes loses nothing, and the finished files do not depend on how the work was split. The
//! one number that all nodes share, the unit of energy, is found from nodes fixed by the grid and
//! stored before the first chunk.

use std::path::Path;

use sdf_grid::Monitor;

use crate::geometry::half_turn::HalfTurnGroup;
use crate::sweep::{Consumer, Group, Member, NodeEnergies, sweep};
use crate::table::encode::{EncodedNode, Probe, encode, probe};
use crate::table::spec::{TableError, TableSpec};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::table_store::{ChunkState, TableStore};

/// One process's part of a bake.
///
/// ```
/// use fft_correlate::*;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let window = TranslationWindow::cube(0.008, 0.004)?;
/// let rotations = vec![[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.6, 0.8]];
/// let rotations = RotationDomain::List { rotations, margin_deg: 5.0 };
/// let spec = TableSpec::for_pair(&pair, &window, rotations);
/// let energies = PairEnergies::plan(&pair, &window)?;
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("peg.zarr");
/// // Two processes, here one after the other.
/// for rank in 0..2 {
///     let share = Share { rank, size: 2, resume: true };
///     let result = bake(&path, &spec, &energies, share, &Silent)?;
///     assert_eq!((result.rotations, result.computed, result.kept), (2, 1, 0));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
///
/// See the example of [`Share`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BakeResult {
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
    /// A table is already there and `resume` is not set.
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
/// be written, another process is baking all of it, an energy is not finite, or `monitor` cancels.
pub fn bake<P: NodeEnergies>(
    path: &Path,
    spec: &TableSpec,
    producer: &P,
    share: Share,
    monitor: &dyn Monitor,
) -> Result<BakeResult, BakeError> {
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
) -> Result<BakeResult, BakeError> {
    let Share { rank, size, .. } = share;
    if rank >= size {
        return Err(BakeError::Share { rank, size });
    }
    let store = open_or_create(files, spec, producer, share)?;
    let _held = files.lock(size == 1)?;
    let grid = store.grid();
    let groups = grid.half_turn_groups();
    let groups = groups.iter().skip(rank).step_by(size);
    let sum = |g: &HalfTurnGroup| grid.node_sum(g.members[0].1);
    let groups: Vec<_> = groups
        .filter_map(|g| Group::of_sums(g, sum(g), |_| Some(())))
        .collect();
    let rows: usize = groups.iter().map(Group::len).sum();
    monitor.begin("table", rows as u64);
    let writer = || Writer {
        store: &store,
        unit: producer.unit(),
        encoded: EncodedNode::default(),
        done: BakeResult::default(),
    };
    let swept = sweep(producer, spec.window.shape(), groups, writer, monitor)?;
    if !swept.complete {
        return Err(BakeError::Cancelled);
    }
    let done = swept.consumers.into_iter().map(|w| w.done);
    let done = done.fold(BakeResult::default(), BakeResult::merge);
    Ok(BakeResult {
        rotations: grid.nodes().len(),
        kept: rows - done.computed,
        ..done
    })
}

/// The table that is there, or a new one.
fn open_or_create<P: NodeEnergies>(
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

/// Writes the nodes that are not finished.
struct Writer<'a> {
    store: &'a TableStore,
    /// The producer's, joules.
    unit: f32,
    encoded: EncodedNode,
    /// What this thread has done.
    done: BakeResult,
}

impl Consumer<()> for Writer<'_> {
    type Error = BakeError;

    fn is_wanted(&mut self, node: &Member) -> Result<bool, BakeError> {
        self.store.clean(node.row)?;
        let state = self.store.state(node.row)?;
        let damaged = !matches!(state, ChunkState::Finished | ChunkState::Missing);
        self.done.repaired += usize::from(damaged);
        Ok(state != ChunkState::Finished)
    }

    fn take(&mut self, node: Member, energies: &mut [f32]) -> Result<(), BakeError> {
        let (row, store, encoded) = (node.row, self.store, &mut self.encoded);
        let spec = store.spec();
        encode(spec, &store.probe(), row, self.unit, energies, encoded)?;
        store.write(row, encoded)?;
        tracing::debug!(row, "rotation finished");
        self.done.computed += 1;
        self.done.bricks_left_out += encoded.bricks[0];
        self.done.bricks += encoded.bricks[1];
        Ok(())
    }
}

impl BakeResult {
    fn merge(self, other: Self) -> Self {
        Self {
            rotations: self.rotations + other.rotations,
            computed: self.computed + other.computed,
            repaired: self.repaired + other.repaired,
            kept: self.kept + other.kept,
            bricks: self.bricks + other.bricks,
            bricks_left_out: self.bricks_left_out + other.bricks_left_out,
        }
    }
}
