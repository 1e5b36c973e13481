//! Meshes written.

use std::io;
use std::path::Path;

use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::mesh_io::unit::LengthUnit;
use crate::support::atomic;

/// Writes a mesh as OBJ in metres, with enough digits to read back the same numbers. The file
/// appears whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), MeshError> {
    write_obj_in(path, mesh, LengthUnit::M)
}

/// As [`write_obj`], with coordinates in `unit`: they read back to within rounding.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj_in(
    path: impl AsRef<Path>,
    mesh: &TriangleMesh,
    unit: LengthUnit,
) -> Result<(), MeshError> {
    let path = path.as_ref();
    let comment = match unit {
        LengthUnit::M => "metres",
        other => other.name(),
    };
    atomic::write_with(path, |out| -> io::Result<()> {
        writeln!(out, "# {comment}")?;
        for v in mesh.vertices() {
            let v = *v / unit.in_metres();
            writeln!(out, "v {} {} {}", v.x, v.y, v.z)?;
        }
        for t in mesh.triangles() {
            let [a, b, c] = t.map(|i| i + 1);
            writeln!(out, "f {a} {b} {c}")?;
        }
        Ok(())
    })
    .map_err(|source| MeshError::Write {
        path: path.to_owned(),
        source,
    })
}
