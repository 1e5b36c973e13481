//! Reading and writing mesh files.
//!
//! Files are untrusted: nothing is allocated from a count that the file states before the bytes
//! that back it have been seen, and every mesh goes through [`crate::hygiene`].

mod obj;
mod ply;
mod step;
mod stl;
mod unit;

use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;

use glam::DVec3;

pub use step::{StepOptions, read_step};
pub use unit::LengthUnit;

use crate::hygiene::{HygieneOptions, HygieneReport};
use crate::mesh::TriangleMesh;
use crate::mesh_error::MeshError;

/// The file name endings that [`read`] understands.
pub const FORMATS: &str = ".obj, .stl, .ply, .step or .stp";

/// Vertices in the file's unit and triangles, as a file gives them.
#[derive(Debug, Clone, Default, PartialEq)]
struct Soup {
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// Reads a mesh file whose coordinates are in `unit` and cleans it; the mesh is in metres. All
/// objects or solids in the file become one mesh. The format follows from the name's ending.
/// A STEP file states its own unit, whatever `unit` says, and needs a converter: see
/// [`read_step`].
///
/// # Errors
/// If the file cannot be read, has an unknown ending or does not follow its format, if the
/// converter of a STEP file fails, or if [`TriangleMesh::clean`] refuses the mesh.
pub fn read(
    path: impl AsRef<Path>,
    unit: LengthUnit,
    options: &HygieneOptions,
) -> Result<(TriangleMesh, HygieneReport), MeshError> {
    let path = path.as_ref();
    let name = path.display().to_string();
    let ending = path
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let parse = match ending.as_str() {
        "obj" => obj::parse,
        "ply" => ply::parse,
        "stl" => stl::parse,
        "step" | "stp" => return read_step(path, &StepOptions::default(), options),
        _ => {
            return Err(MeshError::Format {
                path: path.to_owned(),
                expected: FORMATS,
                found: ending,
            });
        }
    };
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|mut f| f.read_to_end(&mut bytes))
        .map_err(|source| MeshError::Read {
            path: path.to_owned(),
            source,
        })?;
    let soup = parse(&name, &bytes)?;
    let scale = unit.in_metres();
    let vertices = soup.vertices.iter().map(|v| scale * *v).collect();
    TriangleMesh::clean(&name, vertices, soup.triangles, options)
}

/// Writes a mesh as OBJ in metres, with enough digits to read back the same numbers. The file
/// appears whole or not at all.
///
/// # Errors
/// If the file cannot be written.
pub fn write_obj(path: impl AsRef<Path>, mesh: &TriangleMesh) -> Result<(), MeshError> {
    let path = path.as_ref();
    write_whole(path, |out| {
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

/// Writes through a temporary file in the same folder, synced before it takes its name.
fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let file = tempfile::NamedTempFile::new_in(folder)?;
    // Temporary files are made for their owner only; a mesh is an ordinary file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::Permissions::from_mode(0o644);
        file.as_file().set_permissions(mode)?;
    }
    let mut out = BufWriter::new(file.as_file());
    write(&mut out)?;
    out.flush()?;
    drop(out);
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// An error at a place in a file.
fn syntax(
    file: &str,
    place: impl Into<String>,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> MeshError {
    MeshError::Syntax {
        file: file.to_owned(),
        place: place.into(),
        expected: expected.into(),
        found: found.into(),
    }
}
