//! The solids of a scene: read, cleaned, joined, each part in its own frame.

use fft_correlate::Pose;
use sdf_grid::{HygieneOptions, HygieneReport, MeshError, TriangleMesh, mesh_io};

use crate::scene::{Part, Scene};
use crate::setup::warning::SceneWarning;

/// Parts whose diagonals differ by more than this are probably in different units.
const SUSPICIOUS_RATIO: f64 = 30.0;

/// Reads and cleans the meshes of a part, in its own frame; several become one.
pub(crate) fn read_part(
    scene: &Scene,
    part: &Part,
    warnings: &mut Vec<SceneWarning>,
) -> Result<TriangleMesh, MeshError> {
    let mut warn = |report: HygieneReport| {
        warnings.extend(report.warnings().into_iter().map(SceneWarning::Mesh));
    };
    let mut meshes = Vec::new();
    for placed in &part.meshes {
        let (mesh, report) = mesh_io::read_with(&placed.path, &placed.options(scene.unit))?;
        warn(report);
        meshes.push(moved(mesh, &placed.pose));
    }
    if meshes.len() == 1 {
        return Ok(meshes.remove(0));
    }
    let (mesh, report) = joined(&part.name, &meshes)?;
    warn(report);
    Ok(mesh)
}

fn moved(mesh: TriangleMesh, pose: &Pose) -> TriangleMesh {
    match *pose == Pose::IDENTITY {
        true => mesh,
        false => mesh.transformed(pose.rotation, pose.translation),
    }
}

/// All meshes as one. Walls between solids that touch disappear.
fn joined(name: &str, meshes: &[TriangleMesh]) -> Result<(TriangleMesh, HygieneReport), MeshError> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in meshes {
        // Each mesh was small enough for 32-bit indices; together they are checked when cleaned.
        let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        vertices.extend_from_slice(mesh.vertices());
        let shifted = |t: &[u32; 3]| t.map(|v| v.saturating_add(first));
        triangles.extend(mesh.triangles().iter().map(shifted));
    }
    TriangleMesh::clean(name, vertices, triangles, &HygieneOptions::default())
}

/// Whether the parts differ in size as if they were in different units.
pub(super) fn compare_scale(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
) -> Option<SceneWarning> {
    let (a, b) = (fixed.bounds().diagonal(), moving.bounds().diagonal());
    (a.max(b) / a.min(b) > SUSPICIOUS_RATIO).then(|| SceneWarning::Scale {
        fixed: scene.fixed.name.clone(),
        fixed_diagonal: a,
        moving: scene.moving.name.clone(),
        moving_diagonal: b,
        unit: scene.unit,
    })
}
