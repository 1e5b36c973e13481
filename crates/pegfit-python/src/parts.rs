//! Meshes and their densities.

use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use glam::DVec3;
use ndarray::Array2;
use num_complex::Complex32;
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2};
use pyo3::prelude::*;
use sdf_grid::mesh_io::{MeshFile, ReadOptions};
use sdf_grid::shapes::PegInHole;
use sdf_grid::{
    DensityField, DensityKernel, DensityOptions, Lattice, Ledger, LengthUnit, RepairOptions,
    RepairReport, Sampling, TriangleMesh, symmetry,
};
use serde_json::json;

use crate::failure::{Failure, Kind};
use crate::memory_budget;
use crate::work::{guarded, run};

/// Deviation from symmetry that counts as none, as a fraction of the diagonal: as `pegfit check`.
const SYMMETRY_TOLERANCE: f64 = 5e-4;

/// A repaired mesh, metres, and the report of its repair.
#[pyclass(frozen, module = "pegfit._core")]
pub(crate) struct Mesh {
    pub(crate) mesh: Arc<TriangleMesh>,
    report: RepairReport,
    /// What was read of its file, what was ignored and what was assumed; empty without a file.
    ledger: Ledger,
}

pub(crate) fn unit_named(unit: &str) -> Result<LengthUnit, Failure> {
    Ok(LengthUnit::from_str(unit)?)
}

fn no_unit(file: &str) -> Failure {
    let expected = "one of m, cm, mm, um, inch, foot, as the file states none";
    Failure::found(Kind::Mesh, "unit", expected, "none").in_file(file)
}

fn read(
    path: PathBuf,
    unit: Option<LengthUnit>,
    solid: Option<String>,
    segments_per_turn: u32,
    step_time_limit: u64,
    lossy: bool,
) -> Result<Mesh, Failure> {
    let limit = Duration::from_secs(step_time_limit);
    let options = ReadOptions::choosing(unit.unwrap_or_default(), solid, segments_per_turn)
        .within(limit, lossy);
    let file = MeshFile::open(&path, &options.step)?;
    if unit.is_none() && file.stated_unit().is_none() {
        return Err(no_unit(&path.display().to_string()));
    }
    let (mesh, report) = file.clean(&options)?;
    Ok(Mesh {
        mesh: Arc::new(mesh),
        report,
        ledger: file.ledger(&options),
    })
}

fn cleaned(name: &str, vertices: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Mesh, Failure> {
    let options = RepairOptions::default();
    let (mesh, report) = TriangleMesh::clean(name, vertices, triangles, &options)?;
    Ok(Mesh {
        mesh: Arc::new(mesh),
        report,
        ledger: Ledger::default(),
    })
}

/// One of the paper's three pairs: the hole, `clearance` metres wider on every side, and the peg.
#[pyfunction]
pub(crate) fn peg_in_hole(section: &str, clearance: f64) -> Result<(Mesh, Mesh), Failure> {
    let found = PegInHole::ALL.into_iter().find(|s| s.name() == section);
    let found = found.ok_or_else(|| {
        let expected = "circular, rectangular or combined";
        Failure::found(Kind::Mesh, "section", expected, section)
    })?;
    let named = |part: &str, mesh: TriangleMesh| {
        let (vertices, triangles) = (mesh.vertices().to_vec(), mesh.triangles().to_vec());
        cleaned(&format!("{section} {part}"), vertices, triangles)
    };
    guarded(|| {
        let (hole, peg) = found.pair(clearance)?;
        Ok((named("hole", hole)?, named("peg", peg)?))
    })
}

/// Vertices, (n, 3), and their indices, (m, 3).
pub(crate) type Surface<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>);

pub(crate) fn vertex_array<'py>(py: Python<'py>, vertices: &[DVec3]) -> Bound<'py, PyArray2<f64>> {
    let at = |(i, k): (usize, usize)| vertices[i][k];
    Array2::from_shape_fn((vertices.len(), 3), at).into_pyarray(py)
}

pub(crate) fn index_array<'py>(
    py: Python<'py>,
    triangles: &[[u32; 3]],
) -> Bound<'py, PyArray2<u32>> {
    let at = |(i, k): (usize, usize)| triangles[i][k];
    Array2::from_shape_fn((triangles.len(), 3), at).into_pyarray(py)
}

#[pymethods]
impl Mesh {
    /// Reads a file.
    #[staticmethod]
    #[pyo3(signature = (path, unit, solid, segments_per_turn, step_time_limit, lossy))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        unit: Option<&str>,
        solid: Option<String>,
        segments_per_turn: u32,
        step_time_limit: u64,
        lossy: bool,
    ) -> PyResult<Self> {
        let unit = unit.map(unit_named).transpose()?;
        run(py, None, move |_| {
            read(path, unit, solid, segments_per_turn, step_time_limit, lossy)
        })
    }

    /// Cleans arrays of vertices, in `unit`, and faces.
    #[staticmethod]
    fn from_arrays(
        py: Python<'_>,
        name: String,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
        unit: &str,
    ) -> PyResult<Self> {
        let scale = unit_named(unit)?.in_metres();
        let rows = vertices.as_array();
        let point = |row: ndarray::ArrayView1<'_, f64>| scale * DVec3::new(row[0], row[1], row[2]);
        let vertices: Vec<DVec3> = rows.rows().into_iter().map(point).collect();
        // What is no 32-bit index is none of a vertex either: cleaning refuses it by its number.
        let index = |i: i64| u32::try_from(i).unwrap_or(u32::MAX);
        let faces = faces.as_array();
        let triangles: Vec<[u32; 3]> = (faces.rows().into_iter())
            .map(|row| [index(row[0]), index(row[1]), index(row[2])])
            .collect();
        run(py, None, move |_| cleaned(&name, vertices, triangles))
    }

    /// Metres, (n, 3).
    fn vertices<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        vertex_array(py, self.mesh.vertices())
    }

    /// Indices of vertices, (m, 3).
    fn faces<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<u32>> {
        index_array(py, self.mesh.triangles())
    }

    /// Its name in the report of its repair.
    pub(crate) fn name(&self) -> &str {
        &self.report.name
    }

    /// Numbers of vertices and faces.
    fn size(&self) -> (usize, usize) {
        (self.mesh.vertices().len(), self.mesh.triangles().len())
    }

    /// Corners of the smallest box around it, metres.
    fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let bounds = self.mesh.bounds();
        (bounds.min.to_array(), bounds.max.to_array())
    }

    /// The report of its repair, its warnings and axes of symmetry, as JSON.
    fn check(&self, py: Python<'_>) -> PyResult<String> {
        let mesh = Arc::clone(&self.mesh);
        let axes = run(py, None, move |_| {
            let tolerance = SYMMETRY_TOLERANCE * mesh.bounds().diagonal();
            Ok(symmetry::detect(&mesh, tolerance))
        })?;
        let said = json!({
            "report": self.report,
            "warnings": self.report.warnings(),
            "ledger": self.ledger,
            "symmetry": axes,
        });
        Ok(said.to_string())
    }
}

/// Lattice cells along the longest side unless a spacing is given: as `pegfit field`.
const DEFAULT_CELLS: f64 = 48.0;

type Arrays<'py> = (
    Bound<'py, PyArray3<Complex32>>,
    Bound<'py, PyArray3<Complex32>>,
    Bound<'py, PyArray3<f32>>,
    [f64; 3],
    f64,
);

/// Unit exterior and interior density, signed distance, first node and spacing, metres. Nothing is
/// copied: the arrays are those that were computed.
#[pyfunction]
#[pyo3(signature = (mesh, spacing, sigma, tolerance, margin, progress))]
pub(crate) fn density<'py>(
    py: Python<'py>,
    mesh: &Mesh,
    spacing: Option<f64>,
    sigma: f64,
    tolerance: f64,
    margin: Option<f64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Arrays<'py>> {
    let mesh = Arc::clone(&mesh.mesh);
    let field = run(py, progress.as_ref(), move |watch| {
        let kernel = DensityKernel::new(sigma)?;
        let bounds = mesh.bounds();
        let longest = bounds.size().max_element();
        let spacing = spacing.unwrap_or(longest / DEFAULT_CELLS);
        let lattice = Lattice::covering(&bounds, margin.unwrap_or(0.25 * longest), spacing)?;
        let (needed, limit) = (DensityField::memory_bytes(&lattice), memory_budget(None));
        if needed > limit {
            let what = "the density";
            return Err(Failure::memory(Kind::Scene, what, needed.into(), limit));
        }
        let options = DensityOptions {
            tolerance,
            sampling: Sampling::Point,
            ..DensityOptions::default()
        };
        Ok(DensityField::compute(
            &mesh, &kernel, &lattice, &options, watch,
        )?)
    })?;
    let lattice = *field.lattice();
    Ok((
        field.exterior.into_pyarray(py),
        field.interior.into_pyarray(py),
        field.signed_distance.into_pyarray(py),
        lattice.origin().to_array(),
        lattice.spacing(),
    ))
}
