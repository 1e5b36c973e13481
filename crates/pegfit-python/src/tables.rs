//! Tables: baked and opened.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyTable, Pair, PairSetup, RotationDomain, Share, Storage,
    TableFiles, TablePlan, TableSpec, TableStore, bake,
};
use pegfit_scene::{TableReference, held_out_poses};
use pyo3::prelude::*;
use serde_json::json;

use crate::failure::{Failure, Kind};
use crate::memory_budget;
use crate::pair_class::{DEFAULT_BALL, Parts, PyPair};
use crate::source::{AnySource, Source};
use crate::work::{Watch, run};

/// Of the held-out poses at which the error of a finished table is measured, as `pegfit bake` has it.
const SEED: u64 = 1;

/// Share of the largest energy below which energies are left out, as `pegfit bake` has it.
const LEAVE_OUT: f64 = 5e-4;

/// What is asked of a table.
struct TableRequest {
    path: PathBuf,
    half_extent: Option<glam::DVec3>,
    rotations: RotationDomain,
    tolerance: Option<f64>,
    resume: bool,
}

/// A table to be filled, and what its error is measured against if not against its own pair.
struct Design {
    setup: PairSetup,
    table: TablePlan,
    reference: Option<TableReference>,
}

fn reference(pair: &Pair, spacing: f64) -> Result<TableReference, Failure> {
    Ok(TableReference {
        truth: DirectEvaluator::new(pair, &DirectOptions::FULL)?,
        spacing,
    })
}

impl TableRequest {
    /// The table as it is to be baked. One that is already there has chosen for its tolerance.
    fn design(&self, parts: &Parts, watch: &Watch) -> Result<Design, Failure> {
        let mut setup = parts.setup.clone();
        setup.half_extent = self.half_extent.or(setup.half_extent);
        let mut rotations = self.rotations.clone();
        let (mut found, mut pair) = (None, None);
        match self.tolerance {
            None => pair = parts.computed().map(|pair| (*pair).clone()),
            Some(_) if TableFiles::at(&self.path)?.exist()? => {
                let store = TableStore::open(&self.path)?;
                store.expect_setup(&setup)?;
                setup = setup.as_baked(store.spec());
                rotations = store.spec().rotations.clone();
                let mut finer = setup.clone();
                finer.builder.spacing = Some(0.5 * store.spec().window.spacing());
                let fine = finer.load_in_window(watch)?;
                found = Some(reference(&fine, fine.spacing())?);
            }
            Some(tolerance) => {
                let (memory, mut tried) = (parts.memory, |_| ());
                let made = TablePlan::for_tolerance(
                    &setup, &rotations, tolerance, memory, watch, &mut tried,
                )?;
                let reference = TableReference {
                    truth: made.reference,
                    spacing: made.reference_spacing,
                };
                let (table, reference) = (made.plan, Some(reference));
                return Ok(Design {
                    setup,
                    table,
                    reference,
                });
            }
        }
        let pair = pair.map_or_else(|| setup.load_in_window(watch), Ok)?;
        let table = TablePlan::new(&setup, pair, rotations)?;
        Ok(Design {
            setup,
            table,
            reference: found,
        })
    }

    fn bake(&self, parts: &Parts, watch: &Watch) -> Result<(AnySource, String), Failure> {
        let Design {
            setup,
            table,
            reference: finer,
        } = self.design(parts, watch)?;
        let limit = setup.builder.memory_limit.unwrap_or(parts.memory);
        let energies = table.energies(limit)?;
        let share = Share {
            resume: self.resume,
            ..Share::ALL
        };
        let spec = TableSpec {
            storage: Storage {
                leave_out: LEAVE_OUT,
            },
            ..table.spec.clone()
        };
        bake(&self.path, &spec, &energies, share, watch)?;
        let mut store = TableStore::open(&self.path)?;
        let baked = store.load(parts.memory)?;
        let truth = match finer {
            Some(finer) => finer,
            None => reference(&table.pair, table.pair.spacing())?,
        };
        let error = truth.measure(&baked, &table.pair, held_out_poses(self.tolerance), SEED);
        store.write_error_report(&error)?;
        Ok(described(&store, baked))
    }
}

/// The folder in which a table is to be made exists.
fn require_folder(path: &Path) -> Result<(), Failure> {
    if TableFiles::is_remote(path) {
        return Ok(());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    match folder {
        Some(folder) if !folder.is_dir() => {
            let found = Failure::found(Kind::Table, "folder", "one that exists", "none");
            Err(found.in_file(folder.display()))
        }
        _ => Ok(()),
    }
}

/// Fills the table at `path`, measures its error, and reads it.
#[pyfunction]
#[pyo3(signature = (pair, path, half_extent, angle_deg, step_deg, tolerance, resume, progress))]
#[expect(clippy::too_many_arguments, reason = "what is asked of a table")]
pub(crate) fn bake_table(
    py: Python<'_>,
    pair: &PyPair,
    path: PathBuf,
    half_extent: Option<[f64; 3]>,
    angle_deg: Option<f64>,
    step_deg: Option<f64>,
    tolerance: Option<f64>,
    resume: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Source, String)> {
    require_folder(&path)?;
    let rotations = match (angle_deg, step_deg) {
        (None, None) => pair.parts.rotations.clone(),
        (angle, step) => RotationDomain::Ball {
            center: pair.parts.setup.assembled.rotation.to_array(),
            angle_deg: angle.unwrap_or(DEFAULT_BALL[0]),
            step_deg: step.unwrap_or(DEFAULT_BALL[1]),
        },
    };
    if tolerance.is_some_and(|t| !(t > 0.0 && t.is_finite())) {
        let expected = "a positive share of the rms force";
        let found = tolerance.unwrap_or_default();
        return Err(Failure::found(Kind::Scene, "tolerance", expected, found).into());
    }
    let wanted = TableRequest {
        path,
        half_extent: crate::pair_class::half_extent(half_extent)?,
        rotations,
        tolerance,
        resume,
    };
    let claim = Claim::wait(py, &wanted.path)?;
    let parts = Arc::clone(&pair.parts);
    let (source, said) = run(py, progress.as_ref(), move |watch| {
        let _until_it_ends = claim;
        wanted.bake(&parts, watch)
    })?;
    Ok((Source::new(source), said))
}

/// A table in memory and its description, JSON.
pub(super) fn described(store: &TableStore, table: EnergyTable) -> (AnySource, String) {
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
        "pivot": spec.provenance.pivot,
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
    Ok(described(&store, table))
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

/// Tables that this process is baking.
static BAKING: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Between two looks whether a table is still being baked.
const PAUSE: Duration = Duration::from_millis(5);

/// A table is being baked as long as this lives.
pub(super) struct Claim(PathBuf);

impl Claim {
    /// Waits while this process bakes the table already: of a bake that was interrupted, what it had
    /// begun may still end in the background. Waits on the calling thread, which computes nothing.
    pub(super) fn wait(py: Python<'_>, path: &Path) -> PyResult<Self> {
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let baking = || BAKING.lock().unwrap_or_else(PoisonError::into_inner);
        while !baking().insert(path.clone()) {
            py.check_signals()?;
            py.detach(|| std::thread::sleep(PAUSE));
        }
        Ok(Self(path))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let mut baking = BAKING.lock().unwrap_or_else(PoisonError::into_inner);
        baking.remove(&self.0);
    }
}
