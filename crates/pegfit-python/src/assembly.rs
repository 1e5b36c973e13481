//! Assemblies of loose parts.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pegfit::AssemblyReport;
use pegfit_assemble::{AssemblyError, AssemblyRequest, AssemblySearch, LoosePart};
use pyo3::prelude::*;

use crate::failure::{Failure, Kind};
use crate::parts::Mesh;
use crate::poses;
use crate::work::run;

/// Longest try, seconds: a week, as for paths.
const LONGEST: f64 = 604_800.0;

impl From<AssemblyError> for Failure {
    fn from(error: AssemblyError) -> Self {
        let kind = match &error {
            AssemblyError::Cancelled => Kind::General,
            AssemblyError::Pose { .. } => Kind::Pose,
            _ => Kind::Scene,
        };
        let said = Self::from_error(kind, &error);
        match error {
            AssemblyError::Option {
                name,
                expected,
                found,
            } => said.about(name, expected, found),
            AssemblyError::Journal {
                expected, found, ..
            } => said.about("resume", expected, found),
            _ => said,
        }
    }
}

/// The part whose frame is that of the assembly, and parts whose places are known.
type Known = (Option<usize>, Vec<(usize, [f64; 7])>);

/// Mating clearance (metres), width of the beam, assemblies at most, seconds for one try.
type Search = (Option<f64>, usize, usize, f64);

/// The assemblies of some parts by name: the report of `pegfit assemble`, as JSON.
#[pyfunction]
#[pyo3(signature = (parts, known, search, resume, progress))]
pub(crate) fn assemble(
    py: Python<'_>,
    parts: Vec<(String, Py<Mesh>)>,
    known: Known,
    search: Search,
    resume: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (mating_clearance, beam, top, seconds) = search;
    // Written so that NaN is refused.
    if !(0.0..=LONGEST).contains(&seconds) {
        let expected = "seconds, not negative, a week at most";
        return Err(Failure::found(Kind::Scene, "seconds", expected, seconds).into());
    }
    let mut placed = Vec::new();
    for (place, (part, row)) in known.1.iter().enumerate() {
        placed.push((*part, poses::pose(row, place)?));
    }
    let request = AssemblyRequest {
        fixed: known.0,
        placed,
        mating_clearance,
        beam,
        top,
        path_time: Duration::from_secs_f64(seconds),
    };
    let names = parts.iter().map(|(name, _)| name.clone()).collect();
    let loose = parts.into_iter().map(|(name, mesh)| LoosePart {
        name,
        mesh: Arc::clone(&mesh.get().mesh),
    });
    let loose: Vec<LoosePart> = loose.collect();
    run(py, progress.as_ref(), move |watch| {
        let mut search = AssemblySearch::new(loose, request)?;
        if let Some(file) = resume {
            search = search.resume(&file)?;
        }
        let result = search.run(watch)?;
        let report = AssemblyReport { result, names };
        report
            .json()
            .map_err(|e| Failure::from_error(Kind::General, &e))
    })
}
