//! Tables: opened, and what they hold.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::{EnergyTable, TableStore};
use pyo3::prelude::*;
use serde_json::json;

use crate::failure::raised::Failure;
use crate::memory_budget;
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::run;

/// A table in memory and its description, JSON.
pub(super) fn told(store: &TableStore, table: EnergyTable) -> (AnySource, String) {
    let (spec, window) = (store.spec(), &store.spec().window);
    let bounds = window.node_bounds();
    let said = json!({
        "path": store.path(),
        "program": store.program(),
        "rotations": store.grid().nodes().len(),
        "displacements": window.shape(),
        "spacing": window.spacing(),
        "window_min": bounds.min,
        "window_max": bounds.max,
        "pivot": spec.recipe.pivot,
        "model": spec.model(),
        "placement": spec.placement,
        "memory": table.memory(),
        "error": store.error_report(),
    });
    (
        AnySource::Table(Arc::new(table.in_scene())),
        said.to_string(),
    )
}

fn load(path: &Path, memory: u64) -> Result<(AnySource, String), Failure> {
    let store = TableStore::open(path)?;
    let table = store.load(memory)?;
    Ok(told(&store, table))
}

/// Reads all of a table into memory, `memory` bytes at most.
#[pyfunction]
#[pyo3(signature = (path, memory))]
pub(crate) fn open_table(
    py: Python<'_>,
    path: PathBuf,
    memory: Option<u64>,
) -> PyResult<(Source, String)> {
    let (source, said) = run(py, None, move |_| load(&path, memory_budget(memory)))?;
    Ok((Source::new(source), said))
}
