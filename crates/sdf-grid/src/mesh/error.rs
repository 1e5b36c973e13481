//! Why a mesh cannot be read, used, made or written.

use crate::text::quoted;
use std::path::PathBuf;

use glam::DVec3;

/// Why a mesh cannot be read, used, made or written. Every variant names the file or part, the
/// item in it, what was expected and what was found.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be opened or read.
    #[error("cannot read mesh file {}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write mesh file {}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The file's name ends in nothing that is read here.
    #[error("{}: expected a mesh file ending in {expected}, found {}", path.display(), quoted(found))]
    Format {
        /// The file.
        path: PathBuf,
        /// The endings that are read.
        expected: &'static str,
        /// The ending found, in lower case; empty if there is none.
        found: String,
    },
    /// The program that turns the file into triangles is missing or failed.
    #[error("{}: converter {}: expected {expected}, found {found}", path.display(), converter.display())]
    Converter {
        /// The file.
        path: PathBuf,
        /// The program.
        converter: PathBuf,
        /// The result that was expected.
        expected: String,
        /// The result that was found.
        found: String,
    },
    /// The file describes faces or curves, but no solid.
    #[error(
        "{}: expected a solid, found {found}: make it a solid in the program that made it, and \
         export that", path.display()
    )]
    NoSolid {
        /// The file.
        path: PathBuf,
        /// The content found instead.
        found: String,
    },
    /// The file does not follow its format.
    #[error("{file}: {place}: expected {expected}, found {found}")]
    Syntax {
        /// The file.
        file: String,
        /// Where in the file: a line, a byte offset or an element.
        place: String,
        /// The syntax that the format requires there.
        expected: String,
        /// The syntax found there.
        found: String,
    },
    /// The file is something else than its name says.
    #[error("{file}: expected {expected}, found {found}: {help}")]
    Foreign {
        /// The file.
        file: String,
        /// The content that its name promises.
        expected: &'static str,
        /// The content found.
        found: String,
        /// A remedy.
        help: &'static str,
    },
    /// The file has something that changes a solid and cannot be read. The option `lossy` of
    /// reading leaves it out.
    #[error(
        "{file}: {place}: expected what can be read of a solid, found {found}; to leave it out all \
         the same, ask for lossy reading (--lossy; lossy = true in scenes and in Python)"
    )]
    Unread {
        /// The file.
        file: String,
        /// Where in the file it is.
        place: String,
        /// The content found.
        found: String,
    },
    /// The file has no such solid, or several.
    #[error(
        "{file}: solid {}: expected one, found {matches} of that name among {found}",
        quoted(wanted)
    )]
    Solid {
        /// The file.
        file: String,
        /// The name or number asked for.
        wanted: String,
        /// How many have that name.
        matches: usize,
        /// Numbers and names of the solids there are.
        found: String,
    },
    /// Two shells cut through one another, and a union needs closed ones.
    #[error(
        "{part}: shells {} ({} triangles) and {} ({} triangles) cut through one another: expected closed \
         shells, whose union can be found, found open edges; close or unite them where they were made",
        shells[0], triangles[0], shells[1], triangles[1]
    )]
    Overlap {
        /// The file or part.
        part: String,
        /// Their numbers from 1, in the order of their first faces.
        shells: [usize; 2],
        /// Triangles of each.
        triangles: [usize; 2],
    },
    /// The mesh has more vertices or faces than 32-bit indices can name.
    #[error("{part}: expected at most {limit} {item}, found {found}")]
    TooLarge {
        /// The file or part.
        part: String,
        /// The items that are too many.
        item: &'static str,
        /// The largest number accepted.
        limit: u64,
        /// The number found.
        found: u64,
    },
    /// A vertex is NaN, infinite or absurdly far from the origin.
    #[error(
        "{part}: vertex {vertex}: expected finite coordinates within {limit:e} m, found {found}"
    )]
    NonFiniteVertex {
        /// The file or part.
        part: String,
        /// Index of the vertex in the file, from 0.
        vertex: usize,
        /// The largest magnitude of a coordinate that is accepted, metres.
        limit: f64,
        /// The position found, metres.
        found: DVec3,
    },
    /// A triangle names a vertex that does not exist.
    #[error("{part}: triangle {triangle}: expected vertex indices below {expected}, found {found}")]
    IndexOutOfRange {
        /// The file or part.
        part: String,
        /// Index of the triangle in the file, from 0.
        triangle: usize,
        /// The number of vertices.
        expected: usize,
        /// The index found.
        found: u32,
    },
    /// No face is left.
    #[error(
        "{part}: expected at least one triangle with an area, found {triangles} triangles on \
         {vertices} vertices, of which {zero_area} have no area and {duplicates} cancel or repeat"
    )]
    Empty {
        /// The file or part.
        part: String,
        /// Vertices in the input.
        vertices: usize,
        /// Triangles in the input.
        triangles: usize,
        /// Triangles dropped because they have no area.
        zero_area: usize,
        /// Triangles dropped because they repeat or cancel another.
        duplicates: usize,
    },
    /// Too much of the surface is missing.
    #[error(
        "{part}: surface is open: expected at most {} % of the area missing, found {:.1} % behind \
         {open_edges} open edges",
        100.0 * limit,
        100.0 * found
    )]
    Open {
        /// The file or part.
        part: String,
        /// Edges with only one face.
        open_edges: usize,
        /// The largest missing fraction accepted, 0..1.
        limit: f64,
        /// The missing fraction, 0..1.
        found: f64,
    },
    /// An option, size or count is outside its range.
    #[error("{part}: {item}: expected {expected}, found {found}")]
    OutOfRange {
        /// The part or operation.
        part: String,
        /// The name of the option or size.
        item: &'static str,
        /// The range accepted, in words.
        expected: &'static str,
        /// The value given.
        found: f64,
    },
    /// A polygon cannot be cut into triangles: it crosses itself or has no area.
    #[error(
        "{part}: polygon {polygon}: expected a simple polygon of at least 3 corners, found {found}"
    )]
    Polygon {
        /// The file or part.
        part: String,
        /// Index of the polygon, from 0.
        polygon: usize,
        /// The fault.
        found: String,
    },
    /// A length unit is not known.
    #[error("length unit: expected one of {expected}, found {}", quoted(found))]
    Unit {
        /// The units known.
        expected: &'static str,
        /// The name given.
        found: String,
    },
}
