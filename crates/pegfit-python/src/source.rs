//! Sources of energy, force and torque at poses.

use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Arc, PoisonError, RwLock};

use fft_correlate::{
    DirectEvaluator, EnergySource, EnergyTable, InScene, Placement, Pose, Response, Scratch,
    TiledEvaluator,
};
use numpy::{BorrowError, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use sdf_grid::{Monitor, Silent};

use crate::failure::{Failure, Kind};
use crate::poses;
use crate::work::{check, guarded, run_scoped};

/// A table or a direct evaluator, until it is closed.
#[pyclass(frozen, module = "pegfit._core")]
pub(crate) struct Source {
    source: RwLock<Option<AnySource>>,
}

impl Source {
    pub(crate) fn new(source: AnySource) -> Self {
        Self {
            source: RwLock::new(Some(source)),
        }
    }

    /// What answers, kept alive while it does.
    pub(crate) fn get(&self) -> Result<AnySource, Failure> {
        let source = self.source.read().unwrap_or_else(PoisonError::into_inner);
        let closed = || Failure::found(Kind::Table, "table", "one that is open", "a closed one");
        source.clone().ok_or_else(closed)
    }
}

/// The memory of an array whose rows are written as fixed numbers of columns.
fn rows_of<const N: usize>(flat: &[f64]) -> Result<&[[f64; N]], Failure> {
    let (rows, rest) = flat.as_chunks();
    match rest.is_empty() {
        true => Ok(rows),
        false => Err(columns(N)),
    }
}

fn rows_of_mut<const N: usize>(flat: &mut [f64]) -> Result<&mut [[f64; N]], Failure> {
    let (rows, rest) = flat.as_chunks_mut();
    match rest.is_empty() {
        true => Ok(rows),
        false => Err(columns(N)),
    }
}

fn in_use(error: BorrowError) -> Failure {
    Failure::found(
        Kind::Pose,
        "out",
        "arrays apart that nobody else uses",
        error,
    )
}

fn columns(count: usize) -> Failure {
    Failure::found(Kind::Pose, "array", format!("{count} columns"), "others")
}

#[pymethods]
impl Source {
    /// Writes energy, force, torque and coverage at every row of `poses` to arrays of as many
    /// rows, all contiguous.
    #[pyo3(signature = (poses, energy, force, torque, coverage, threads))]
    fn query(
        &self,
        py: Python<'_>,
        poses: PyReadonlyArray2<'_, f64>,
        energy: &Bound<'_, PyArray1<f64>>,
        force: &Bound<'_, PyArray2<f64>>,
        torque: &Bound<'_, PyArray2<f64>>,
        coverage: &Bound<'_, PyArray1<f64>>,
        threads: Option<usize>,
    ) -> PyResult<()> {
        check(threads)?;
        let source = self.get()?;
        let mut energy = energy.try_readwrite().map_err(in_use)?;
        let mut force = force.try_readwrite().map_err(in_use)?;
        let mut torque = torque.try_readwrite().map_err(in_use)?;
        let mut coverage = coverage.try_readwrite().map_err(in_use)?;
        let rows = Rows {
            poses: rows_of(poses.as_slice()?)?,
            energy: energy.as_slice_mut()?,
            force: rows_of_mut(force.as_slice_mut()?)?,
            torque: rows_of_mut(torque.as_slice_mut()?)?,
            coverage: coverage.as_slice_mut()?,
        };
        let count = rows.poses.len();
        let lengths = [rows.energy.len(), rows.force.len(), rows.torque.len()];
        if lengths != [count; 3] || rows.coverage.len() != count {
            return Err(
                Failure::found(Kind::Pose, "out", format!("{count} rows"), "others").into(),
            );
        }
        if count <= source.piece() && source.is_ready(rows.poses) {
            let alone = || {
                answer(
                    &source,
                    rows,
                    0,
                    (&mut source.batch(), &mut Vec::new()),
                    &Silent,
                )
            };
            return Ok(py.detach(|| guarded(alone))?);
        }
        run_scoped(py, threads, |watch| answer_all(&source, rows, watch))
    }

    /// Gives it up; queries in the middle end well.
    fn close(&self) {
        let mut source = self.source.write().unwrap_or_else(PoisonError::into_inner);
        *source = None;
    }

    fn is_closed(&self) -> bool {
        self.get().is_err()
    }
}

/// A table or direct quadrature, asked in the scene.
#[derive(Clone)]
pub(crate) enum AnySource {
    Direct(Arc<TiledEvaluator>, Placement),
    Table(Arc<InScene<EnergyTable>>),
}

/// The same for loops, which wait for nothing: all of it is there.
pub(crate) enum LoopSource {
    Direct(InScene<Arc<DirectEvaluator>>),
    Table(Arc<InScene<EnergyTable>>),
}

impl LoopSource {
    pub(crate) fn as_source(&self) -> &dyn EnergySource {
        match self {
            Self::Direct(source) => source,
            Self::Table(source) => source.as_ref(),
        }
    }
}

/// Working memory for many poses.
pub(crate) struct Batch {
    scratch: Scratch,
    shapes: Vec<Pose>,
    responses: Vec<Response>,
}

impl AnySource {
    /// As a loop asks it; loads what is not there.
    pub(crate) fn for_loop(&self, monitor: &dyn Monitor) -> Result<LoopSource, Failure> {
        Ok(match self {
            Self::Direct(tiles, placement) => {
                LoopSource::Direct(InScene::new(tiles.whole(monitor)?, *placement))
            }
            Self::Table(table) => LoopSource::Table(Arc::clone(table)),
        })
    }

    /// Whether all that the first of these poses needs is there.
    fn is_ready(&self, rows: &[[f64; 7]]) -> bool {
        let first = rows.first().and_then(|row| poses::pose(row, 0).ok());
        match (self, first) {
            (Self::Direct(tiles, placement), Some(pose)) => {
                tiles.is_loaded(&placement.to_shapes(&pose))
            }
            _ => true,
        }
    }

    /// Rows in an order in which those that need the same come together; none if any order will do.
    fn order(&self, rows: &[[f64; 7]]) -> Option<Vec<usize>> {
        let Self::Direct(tiles, placement) = self else {
            return None;
        };
        // Rows that are no poses are refused in their place.
        let shapes = rows.iter().map(|row| {
            let pose = poses::pose(row, 0).unwrap_or(Pose::IDENTITY);
            placement.to_shapes(&pose)
        });
        let order = tiles.order(&shapes.collect::<Vec<_>>());
        (!order.is_sorted()).then_some(order)
    }

    /// Poses that one thread answers at a time.
    pub(crate) fn piece(&self) -> usize {
        match self {
            Self::Direct(..) => 1,
            Self::Table(_) => 512,
        }
    }

    pub(crate) fn batch(&self) -> Batch {
        Batch {
            scratch: match self {
                Self::Direct(tiles, _) => tiles.scratch(),
                Self::Table(table) => table.scratch(),
            },
            shapes: Vec::new(),
            responses: Vec::new(),
        }
    }

    /// Answers at poses in the scene, one after the other.
    pub(crate) fn respond<'b>(
        &self,
        poses: &[Pose],
        batch: &'b mut Batch,
        monitor: &dyn Monitor,
    ) -> Result<&'b [Response], Failure> {
        batch.responses.clear();
        match self {
            Self::Direct(tiles, placement) => {
                for pose in poses {
                    let shapes = placement.to_shapes(pose);
                    let response = tiles.response(&shapes, &mut batch.scratch, monitor)?;
                    batch.responses.push(Response {
                        wrench: placement.wrench_to_scene(pose, &response.wrench),
                        ..response
                    });
                }
            }
            Self::Table(table) => {
                // Random poses of a large table take less time together: the next one's energies
                // are fetched meanwhile.
                let placement = table.placement();
                batch.shapes.clear();
                batch
                    .shapes
                    .extend(poses.iter().map(|p| placement.to_shapes(p)));
                batch.responses.resize(poses.len(), Response::default());
                table
                    .source()
                    .respond_each(&batch.shapes, &mut batch.responses);
                for (response, pose) in batch.responses.iter_mut().zip(poses) {
                    response.wrench = placement.wrench_to_scene(pose, &response.wrench);
                }
            }
        }
        Ok(&batch.responses)
    }
}

/// Rows that one thread answers in a row, at most, where their order matters.
const NEIGHBOURS: usize = 16;

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
    (batch, read): (&mut Batch, &mut Vec<Pose>),
    monitor: &dyn Monitor,
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
    for (n, response) in source.respond(read, batch, monitor)?.iter().enumerate() {
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
    match source.order(rows.poses) {
        Some(order) => answer_in_order(source, rows, &order, monitor),
        None => answer_in_pieces(source, rows, monitor),
    }
}

/// The same row by row in another order, so that as little as possible is loaded twice.
fn answer_in_order(
    source: &AnySource,
    mut rows: Rows<'_>,
    order: &[usize],
    monitor: &dyn Monitor,
) -> Result<(), Failure> {
    let refused = AtomicUsize::new(usize::MAX);
    let read = |row: usize| poses::pose(&rows.poses[row], row);
    let answers = order.par_iter().with_max_len(NEIGHBOURS).map_init(
        || source.batch(),
        |batch, row| {
            if monitor.cancelled() || *row > refused.load(Relaxed) {
                return None;
            }
            let pose = match read(*row) {
                Ok(pose) => pose,
                Err(failure) => {
                    refused.fetch_min(*row, Relaxed);
                    return Some(Err((*row, failure)));
                }
            };
            let answer = source.respond(&[pose], batch, monitor);
            Some(match answer {
                Ok(responses) => Ok((*row, responses[0])),
                Err(failure) => {
                    refused.fetch_min(*row, Relaxed);
                    Err((*row, failure))
                }
            })
        },
    );
    let answers: Vec<_> = answers.flatten().collect();
    let mut first: Option<(usize, Failure)> = None;
    for answer in answers {
        match answer {
            Ok((row, response)) => rows.write(row, &response),
            Err((row, failure)) => match &first {
                Some((before, _)) if *before < row => {}
                _ => first = Some((row, failure)),
            },
        }
    }
    first.map_or(Ok(()), |(_, failure)| Err(failure))
}

/// The same piece by piece.
fn answer_in_pieces(
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
                let failure = answer(source, rows, n * piece, (batch, read), monitor).err()?;
                refused.fetch_min(n, Relaxed);
                Some((n, failure))
            },
        );
    let first = failures.flatten().min_by_key(|(n, _)| *n);
    first.map_or(Ok(()), |(_, failure)| Err(failure))
}
