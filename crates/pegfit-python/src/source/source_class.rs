//! Tables and evaluators as Python holds them.

use std::sync::{PoisonError, RwLock};

use numpy::{BorrowError, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use super::any::AnySource;
use super::query::{Rows, answer, answer_all};
use crate::failure::raised::{Failure, Kind};
use crate::work::pools::check;
use crate::work::run::{guarded, run_scoped};

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
        if count <= source.piece() {
            let alone = || answer(&source, rows, 0, &mut source.batch(), &mut Vec::new());
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
