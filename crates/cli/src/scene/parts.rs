//! The solids of a scene: read, cleaned, joined, each part in its own frame.

use fft_correlate::Pose;
use sdf_grid::{HygieneOptions, HygieneReport, TriangleMesh, mesh_io};

use super::types::{Part, Scene};
use crate::context::Context;
use crate::error::CommandError;

/// Parts whose diagonals differ by more than this are probably in different units.
const SUSPICIOUS_RATIO: f64 = 30.0;

/// Reads and cleans the meshes of a part, in its own frame; several become one.
pub(crate) fn read_part(
    scene: &Scene,
    part: &Part,
    context: &Context,
) -> Result<TriangleMesh, CommandError> {
    let options = HygieneOptions::default();
    let mut meshes = Vec::new();
    for placed in &part.meshes {
        let reading = placed.choice().options(scene.unit);
        let (mesh, report) = mesh_io::read_with(&placed.path, &reading)?;
        for warning in report.warnings() {
            context.progress.note(&format!("note: {warning}"));
        }
        meshes.push(moved(mesh, &placed.pose));
    }
    if meshes.len() == 1 {
        return Ok(meshes.remove(0));
    }
    let (mesh, report) = joined(&part.name, &meshes, &options)?;
    for warning in report.warnings() {
        context.progress.note(&format!("note: {warning}"));
    }
    Ok(mesh)
}

fn moved(mesh: TriangleMesh, pose: &Pose) -> TriangleMesh {
    match *pose == Pose::IDENTITY {
        true => mesh,
        false => mesh.transformed(pose.rotation, pose.translation),
    }
}

/// All meshes as one. Walls between solids that touch disappear.
fn joined(
    name: &str,
    meshes: &[TriangleMesh],
    options: &HygieneOptions,
) -> Result<(TriangleMesh, HygieneReport), CommandError> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in meshes {
        // Each mesh was small enough for 32-bit indices; together they are checked when cleaned.
        let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        vertices.extend_from_slice(mesh.vertices());
        let shifted = |t: &[u32; 3]| t.map(|v| v.saturating_add(first));
        triangles.extend(mesh.triangles().iter().map(shifted));
    }
    Ok(TriangleMesh::clean(name, vertices, triangles, options)?)
}

pub(super) fn warn_of_scale(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    context: &Context,
) {
    let (a, b) = (fixed.bounds().diagonal(), moving.bounds().diagonal());
    let ratio = a.max(b) / a.min(b);
    if ratio > SUSPICIOUS_RATIO {
        let unit = scene.unit;
        let metre = unit.in_metres();
        context.progress.note(&format!(
            "warning: {} is {:.4} {unit} across and {} is {:.4} {unit}: are both in {unit}?",
            scene.fixed.name,
            a / metre,
            scene.moving.name,
            b / metre
        ));
    }
}
