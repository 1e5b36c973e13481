//! Filling a table on disk, by any number of processes, interrupted any number of times.
//!
//! Nodes that differ by half turns make a group, of which one transform of the moving part serves
//! all; groups are dealt to processes by their number. Each node is compressed and renamed into place
//! on its own, and does not depend on which others of its group were missing: stopping between nodes
//! loses nothing, and the finished files do not depend on how the work was split. The one number that all nodes share, the unit of energy, is found from nodes
//! fixed by the grid and stored before the first chunk.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use glam::DQuat;
use ndarray::ArrayViewMut3;
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::encode::{Encoded, Probe, Storage, encode, probe};
use crate::rotation_domain::RotationDomain;
use crate::store::{ChunkState, StoreError, TableFiles, TableStore};
use crate::table::{NodeEnergies, TableError, TableSpec, nodes};
use crate::{
    CorrelateError, Correlator, CorrelatorScratch, HalfTurn, HalfTurnGroup, Pair,
    TranslationWindow, half_turn_groups,
};

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
    /// Bricks of the nodes computed now ([`Storage::BRICK`]).
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
/// ([`TableFiles::at`]), making the table if there is none, on all threads of the current rayon pool.
///
/// # Errors
/// If the specification or share is out of range, the table is of another specification or cannot be
/// written, an energy is not finite, or `monitor` cancels.
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
    let Share { rank, size, resume } = share;
    if rank >= size {
        return Err(BakeError::Share { rank, size });
    }
    let store = if files.exist()? {
        if !resume && size == 1 {
            return Err(BakeError::Exists {
                path: files.place().into(),
            });
        }
        // What was probed for a table that is there is its own.
        let none = Probe {
            unit: 1.0,
            negligible: 0.0,
        };
        TableStore::create(files, spec, none)?
    } else {
        spec.validate()?;
        let grid = spec.grid().map_err(TableError::from)?;
        TableStore::create(files, spec, probe(spec, &grid, producer)?)?
    };
    let all = store.grid().nodes();
    let groups = half_turn_groups(all);
    let groups: Vec<&HalfTurnGroup> = groups.iter().skip(rank).step_by(size).collect();
    let rows: usize = groups.iter().map(|g| g.members.len()).sum();
    let [computed, repaired, bricks, left_out] = std::array::from_fn(|_| AtomicUsize::new(0));
    monitor.begin("table", rows as u64);
    groups.par_iter().with_max_len(1).try_for_each_init(
        || (producer.scratch(), Vec::new(), Encoded::default()),
        |(scratch, joules, encoded), group| {
            if monitor.cancelled() {
                return Err(BakeError::Cancelled);
            }
            let mut missing = Vec::new();
            for &(turn, row) in &group.members {
                store.clean(row)?;
                match store.state(row)? {
                    ChunkState::Finished => monitor.advance(1),
                    state => {
                        missing.push((turn, row));
                        repaired.fetch_add(usize::from(state != ChunkState::Missing), Relaxed);
                    }
                }
            }
            if missing.is_empty() {
                return Ok(());
            }
            nodes(spec, producer, group.rotation, &missing, scratch, joules);
            for (joules, (_, row)) in joules.chunks_exact_mut(spec.window.len()).zip(missing) {
                encode(spec, &store.probe(), row, joules, encoded)?;
                store.write(row, encoded)?;
                tracing::debug!(row, "rotation finished");
                computed.fetch_add(1, Relaxed);
                left_out.fetch_add(encoded.bricks[0], Relaxed);
                bricks.fetch_add(encoded.bricks[1], Relaxed);
                monitor.advance(1);
            }
            Ok(())
        },
    )?;
    let computed = computed.into_inner();
    Ok(BakeReport {
        rotations: all.len(),
        computed,
        repaired: repaired.into_inner(),
        kept: rows - computed,
        bricks: bricks.into_inner(),
        bricks_left_out: left_out.into_inner(),
    })
}

/// A pair's energies by FFT correlation.
pub struct PairEnergies {
    correlator: Correlator,
    gamma: f64,
}

impl PairEnergies {
    /// Plans the correlation of a pair over a window for single rotations.
    ///
    /// # Errors
    /// As [`Correlator::new`].
    pub fn plan(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        Ok(Self {
            correlator: Correlator::new(pair, window)?,
            gamma: pair.model().gamma,
        })
    }

    /// The same for `rotations`: half turns share their work if there are enough among them.
    ///
    /// # Errors
    /// As [`Correlator::new`].
    pub fn plan_for(
        pair: &Pair,
        window: &TranslationWindow,
        rotations: &[DQuat],
    ) -> Result<Self, CorrelateError> {
        Ok(Self {
            correlator: Correlator::for_groups(pair, window, &half_turn_groups(rotations))?,
            gamma: pair.model().gamma,
        })
    }

    /// The correlator.
    pub fn correlator(&self) -> &Correlator {
        &self.correlator
    }
}

impl NodeEnergies for PairEnergies {
    type Scratch = CorrelatorScratch;

    fn scratch(&self) -> CorrelatorScratch {
        self.correlator.scratch()
    }

    fn energies(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch,
        mut out: ArrayViewMut3<'_, f32>,
    ) {
        self.correlator.score(rotation, scratch, out.view_mut());
        self.weigh(out);
    }

    fn energies_of_half_turns(
        &self,
        rotation: DQuat,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        self.correlator
            .score_half_turns(rotation, turns, scratch, outs);
        outs.iter_mut().for_each(|out| self.weigh(out.view_mut()));
    }
}

impl PairEnergies {
    /// Scores to energies.
    fn weigh(&self, mut scores: ArrayViewMut3<'_, f32>) {
        let gamma = self.gamma as f32;
        scores.mapv_inplace(|score| -gamma * score);
    }
}

impl TableSpec {
    /// The table of a pair; mesh hashes and symmetry are left to fill in.
    pub fn for_pair(pair: &Pair, window: &TranslationWindow, rotations: RotationDomain) -> Self {
        Self {
            model: *pair.model(),
            pivot: pair.pivot().to_array(),
            window: *window.lattice(),
            rotations,
            symmetry: None,
            far_energy: 0.0,
            storage: Storage::default(),
            fields: None,
            fixed_mesh: String::new(),
            moving_mesh: String::new(),
        }
    }
}
