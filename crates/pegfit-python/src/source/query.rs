//! Many poses at once, into arrays of the caller's.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use fft_correlate::{Pose, Response};
use rayon::prelude::*;
use sdf_grid::Monitor;

use super::any::{AnySource, Batch};
use crate::failure::raised::Failure;
use crate::poses;

/// Rows of the caller's arrays, or pieces of them, of one length.
pub(crate) struct Rows<'a> {
    pub(crate) poses: &'a [[f64; 7]],
    pub(crate) energy: &'a mut [f64],
    pub(crate) force: &'a mut [[f64; 3]],
    pub(crate) torque: &'a mut [[f64; 3]],
    pub(crate) coverage: &'a mut [f64],
}

impl Rows<'_> {
    fn write(&mut self, n: usize, response: &Response) {
        self.energy[n] = response.energy;
        self.force[n] = response.wrench.force.to_array();
        self.torque[n] = response.wrench.torque.to_array();
        self.coverage[n] = response.coverage;
    }
}

/// Answers one row after the other on this thread, up to the first that is no pose; `first` is the
/// place of the first row.
pub(crate) fn answer(
    source: &AnySource,
    mut rows: Rows<'_>,
    first: usize,
    batch: &mut Batch,
    read: &mut Vec<Pose>,
) -> Result<(), Failure> {
    read.clear();
    let mut refused = None;
    for (n, row) in rows.poses.iter().enumerate() {
        match poses::pose(row, first + n) {
            Ok(pose) => read.push(pose),
            Err(failure) => {
                refused = Some(failure);
                break;
            }
        }
    }
    for (n, response) in source.respond(read, batch).iter().enumerate() {
        rows.write(n, response);
    }
    refused.map_or(Ok(()), Err)
}

/// Answers all rows on the threads of the current pool. Of rows that are no pose, the first one is
/// told.
pub(crate) fn answer_all(
    source: &AnySource,
    rows: Rows<'_>,
    monitor: &dyn Monitor,
) -> Result<(), Failure> {
    let piece = source.piece();
    // Pieces behind a refused one need not be begun.
    let refused = AtomicUsize::new(usize::MAX);
    let outputs = (rows
        .force
        .par_chunks_mut(piece)
        .zip(rows.torque.par_chunks_mut(piece)))
    .zip(
        rows.energy
            .par_chunks_mut(piece)
            .zip(rows.coverage.par_chunks_mut(piece)),
    );
    let failures = rows
        .poses
        .par_chunks(piece)
        .zip(outputs)
        .enumerate()
        .map_init(
            || (source.batch(), Vec::with_capacity(piece)),
            |(batch, read), (n, (poses, ((force, torque), (energy, coverage))))| {
                if monitor.cancelled() || n > refused.load(Relaxed) {
                    return None;
                }
                let rows = Rows {
                    poses,
                    energy,
                    force,
                    torque,
                    coverage,
                };
                let failure = answer(source, rows, n * piece, batch, read).err()?;
                refused.fetch_min(n, Relaxed);
                Some((n, failure))
            },
        );
    let first = failures.flatten().min_by_key(|(n, _)| *n);
    first.map_or(Ok(()), |(_, failure)| Err(failure))
}
