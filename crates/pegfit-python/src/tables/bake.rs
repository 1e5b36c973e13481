//! The table of a pair: designed, filled, measured.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fft_correlate::{
    DirectEvaluator, DirectOptions, Pair, PairSetup, RotationDomain, Share, Storage, TableFiles,
    TablePlan, TableSpec, TableStore, bake,
};
use pegfit_scene::{TableReference, held_out_poses};
use pyo3::prelude::*;

use super::claim::Claim;
use super::open::told;
use crate::failure::raised::{Failure, Kind};
use crate::pair_class::{DEFAULT_BALL, Parts, PyPair};
use crate::source::any::AnySource;
use crate::source::source_class::Source;
use crate::work::run::{Watch, run};

/// Of the held-out poses at which the error of a finished table is measured, as `pegfit bake` has it.
const SEED: u64 = 1;

/// Share of the largest energy below which energies are left out, as `pegfit bake` has it.
const LEAVE_OUT: f64 = 5e-4;

/// What is asked of a table.
struct Wanted {
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

impl Wanted {
    /// The table as it is to be baked. One that is already there has chosen for its tolerance.
    fn design(&self, parts: &Parts, watch: &Watch) -> Result<Design, Failure> {
        let mut setup = parts.setup.clone();
        setup.half_extent = self.half_extent.or(setup.half_extent);
        let mut rotations = self.rotations.clone();
        let (mut found, mut pair) = (None, None);
        match self.tolerance {
            None if self.half_extent.is_none() => pair = Some((*parts.pair(watch)?).clone()),
            None => {}
            Some(_) if TableFiles::at(&self.path)?.exist()? => {
                let store = TableStore::open(&self.path)?;
                store.expect_setup(&setup)?;
                setup = setup.as_baked(store.spec());
                rotations = store.spec().rotations.clone();
                let mut finer = setup.clone();
                finer.builder.spacing = Some(0.5 * store.spec().window.spacing());
                let fine = finer.load(watch)?;
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
        let pair = pair.map_or_else(|| setup.load(watch), Ok)?;
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
        Ok(told(&store, baked))
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
    let wanted = Wanted {
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
