//! Meshes written.

use std::io;
use std::path::Path;

use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::atomic;

/// Writes a mesh as OBJ in metres, with enough digits to read back the same numbers. The file
/// appears whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), MeshError> {
    let path = path.as_ref();
    atomic::write_with(path, |out| -> io::Result<()> {
        writeln!(out, "# metres")?;
        for v in mesh.vertices() {
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
