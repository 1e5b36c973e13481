//! The files of a table without coefficients: the attribute `pegfit`, coordinates, surfaces.
//!
//! Coordinates follow from the attribute; they are for other readers, and must agree with it.
//!
//! Two digests tie a table's numbers together: one over the attribute `pegfit`, stored in it, so that
//! no number of it changes unseen; and one in every chunk, over its numbers, its place and everything
//! that the energies depend on, so that a chunk belongs to one place of one table. Neither stops
//! somebody who computes them again.

use std::io;
use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use sdf_grid::atomic::AtomicFolder;
use sdf_grid::text::quoted;
use sdf_grid::{ContactError, KernelError, RepairOptions, TriangleMesh};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::geometry::placement::Placement;
use crate::pair::builder::contact_bytes;
use crate::pair::contact::{Contact, Smoothing, jump};
use crate::pair::region::{ContactRegion, PoseWindow};
use crate::rotations::grid::RotationGrid;
use crate::table::accuracy::ErrorReport;
use crate::table::encode::Probe;
use crate::table::spec::{TableError, TableSpec};
use crate::table::store::array::{Chunking, Numbers, TableArray};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;

/// Bytes of a table's metadata at most: a hundred thousand listed rotations.
pub(super) const LONGEST: u64 = 1 << 24;

/// Content of the attribute.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    pub(super) format: u32,
    pub(super) program: String,
    pub(super) energy_unit: f64,
    /// Distance from the far energy that was left out, joules.
    pub(super) negligible: f64,
    pub(super) table: TableSpec,
    /// Sizes of the surfaces of the fixed and the moving part, if they are stored.
    #[serde(default)]
    pub(super) parts: Option<[PartSize; 2]>,
    #[serde(default)]
    pub(super) error: Option<ErrorReport>,
    /// Of all that stands before it ([`Header::sealed`]).
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) digest: String,
}

/// The keys that make a table's identity.
#[derive(Serialize)]
struct IdentityKeys<'a> {
    format: u32,
    energy_unit: f64,
    negligible: f64,
    parts: &'a Option<[PartSize; 2]>,
    table: TableSpec,
}

/// Of the metadata of a table's group what this program reads; the rest is others'.
#[derive(Deserialize)]
struct Group<T> {
    attributes: Attributes<T>,
}

#[derive(Deserialize)]
struct Attributes<T> {
    pegfit: T,
}

/// Another format may have other keys.
#[derive(Deserialize)]
struct FormatNumber {
    format: u64,
}

impl Header {
    pub(super) fn probe(&self) -> Probe {
        Probe {
            unit: self.energy_unit,
            negligible: self.negligible,
        }
    }

    /// The metadata of a table's group.
    pub(super) fn group(&self) -> Value {
        json!({ "zarr_format": 3, "node_type": "group", "attributes": { "pegfit": self } })
    }

    /// With the digest of its other keys.
    pub(super) fn sealed(mut self) -> Self {
        self.digest = String::new();
        self.digest = digest(&self);
        self
    }

    /// What the energies depend on: all of this but the placement, the error and who made it.
    pub(super) fn identity(&self) -> Identity {
        Identity::from_material(&IdentityKeys {
            format: self.format,
            energy_unit: self.energy_unit,
            negligible: self.negligible,
            parts: &self.parts,
            table: TableSpec {
                placement: Placement::IDENTITY,
                contact: None,
                ..self.table.clone()
            },
        })
    }

    pub(super) fn read(files: &TableFiles) -> Result<Self, StoreError> {
        let path = files.place();
        let text = files.get("zarr.json", LONGEST).map_err(|e| {
            e.or(|reason| StoreError::Metadata {
                path: path.into(),
                item: "zarr.json",
                reason,
            })
        })?;
        match text {
            Some(text) => Self::parse(path, &text),
            None => Err(StoreError::Missing { path: path.into() }),
        }
    }

    fn parse(path: &Path, text: &[u8]) -> Result<Self, StoreError> {
        let metadata = |item, reason: String| StoreError::Metadata {
            path: path.into(),
            item,
            reason,
        };
        let numbered: Group<FormatNumber> =
            serde_json::from_slice(text).map_err(|e| metadata("zarr.json", e.to_string()))?;
        let found = numbered.attributes.pegfit.format;
        if found != u64::from(FORMAT_VERSION) {
            return Err(StoreError::Version {
                path: path.into(),
                expected: FORMAT_VERSION,
                found,
            });
        }
        let group: Group<Self> = serde_json::from_slice(text)
            .map_err(|e| metadata("attribute pegfit", e.to_string()))?;
        let stored = group.attributes.pegfit;
        let header = stored.clone().sealed();
        if header.digest != stored.digest {
            let reason = format!(
                "its digest is {}, that of what it says {}: it was changed after it was \
                 written; bake it again",
                quoted(&stored.digest),
                header.digest
            );
            return Err(metadata("attribute pegfit", reason));
        }
        let unit = header.energy_unit;
        if !(unit.is_normal() && unit > 0.0) {
            return Err(metadata("attribute energy_unit", format!("found {unit}")));
        }
        if !(header.negligible.is_finite() && header.negligible >= 0.0) {
            let found = format!("found {}", header.negligible);
            return Err(metadata("attribute negligible", found));
        }
        Ok(header)
    }
}

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 7;

/// One chunk of coefficients for each rotation node; stored numbers are `unit` joules each.
pub(super) fn coefficient_array(spec: &TableSpec, unit: f64, grid: &RotationGrid) -> TableArray {
    let name = match Smoothing::of_provenance(&spec.provenance) {
        Some(_) => "cubic B-spline coefficients of the energy, without what contact adds",
        None => "cubic B-spline coefficients of the energy",
    };
    // Readers that follow the CF conventions multiply by the scale factor and find joules.
    let attributes = json!({
        "long_name": name, "units": "J", "scale_factor": unit, "coordinates": "quaternion",
    });
    let [nx, ny, nz] = spec.window.shape();
    TableArray::new(
        ["coefficients", "coefficients/zarr.json"],
        Numbers::Float16,
        &[
            ("rotation", grid.nodes().len()),
            ("x", nx),
            ("y", ny),
            ("z", nz),
        ],
        Chunking::PackedRows,
        attributes,
    )
}

/// How much of a part is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartSize {
    pub(super) vertices: usize,
    pub(super) triangles: usize,
}

impl PartSize {
    /// The sizes of both parts.
    pub(super) fn from_contact(contact: &Contact) -> [Self; 2] {
        contact.parts().map(|part| Self {
            vertices: part.vertices().len(),
            triangles: part.triangles().len(),
        })
    }

    /// The arrays of vertices and of triangles of the part of this name, called `names`.
    pub(super) fn arrays(self, part: &str, names: [[&'static str; 2]; 2]) -> [TableArray; 2] {
        let array = |names, rows: usize, row: &str, column, numbers, about: &str, unit: &str| {
            let dimensions = [(&*format!("{part}_{row}"), rows), (column, 3)];
            let attributes = json!({ "long_name": about, "units": unit });
            TableArray::new(names, numbers, &dimensions, Chunking::One, attributes)
        };
        [
            array(
                names[0],
                self.vertices,
                "vertex",
                "axis",
                Numbers::Float64,
                "vertices of the part's surface, x, y, z in its own frame",
                "m",
            ),
            array(
                names[1],
                self.triangles,
                "triangle",
                "corner",
                Numbers::UInt32,
                "vertices of the part's triangles, counter-clockwise from outside",
                "1",
            ),
        ]
    }
}

/// What distinguishes a table's identity from other digests of the same bytes.
const CONTEXT: &str = "pegfit 2026-11 energies of a table";

/// What the energies of a table depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Identity([u8; blake3::OUT_LEN]);

impl Identity {
    /// Of everything that the energies depend on.
    pub(super) fn from_material(material: &impl Serialize) -> Self {
        Self(blake3::derive_key(CONTEXT, &text(material)))
    }

    /// The digest of a rotation node's numbers, as little-endian bytes.
    pub(super) fn chunk(&self, row: usize, codes: &[u8]) -> [u8; blake3::OUT_LEN] {
        let mut hasher = blake3::Hasher::new_keyed(&self.0);
        hasher.update(&(row as u64).to_le_bytes());
        // What numbers are multiplied by, which formats up to 6 could choose.
        hasher.update(&1f32.to_le_bytes());
        hasher.update(codes);
        hasher.finalize().into()
    }
}

/// The digest of a table's attributes.
pub(super) fn digest(header: &impl Serialize) -> String {
    blake3::hash(&text(header)).to_hex().to_string()
}

/// Keys as they are declared, no spaces, numbers as short as they can be.
fn text(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).expect("headers hold no maps but those of their fields' names")
}

/// Writes the metadata of an empty table, its own last: what makes it one. In a store of objects,
/// processes that do this at the same time write the same bytes.
pub(super) fn write_empty_table(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    // What is written is to be read again.
    let text = serde_json::to_vec_pretty(&header.group()).map_err(|e| StoreError::Io {
        path: files.place().join("zarr.json"),
        source: e.into(),
    })?;
    if text.len() as u64 > LONGEST {
        return Err(TableError::Spec {
            name: "rotations",
            expected: "a list that fits in 16 MiB of metadata",
            found: format!("{} bytes", text.len()),
        }
        .into());
    }
    let Some(folder) = files.folder() else {
        return write_skeleton(files, header, grid);
    };
    write_folder(folder, header, grid)
}

/// Writes to a folder beside `path` and renames it. If another process was first, its table stays
/// and this one is dropped.
fn write_folder(path: &Path, header: &Header, grid: &RotationGrid) -> Result<(), StoreError> {
    let io = |source: io::Error| StoreError::Io {
        path: path.into(),
        source,
    };
    let folder = AtomicFolder::create(path).map_err(|e| io(e.into()))?;
    let beside = TableFiles::in_folder(folder.temporary())?;
    write_skeleton(&beside, header, grid)?;
    match folder.commit_new() {
        Ok(_) => Ok(()),
        Err(_) if path.join("zarr.json").exists() => Ok(()),
        Err(e) => Err(io(e.into())),
    }
}

fn write_skeleton(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    coefficient_array(&header.table, header.energy_unit, grid).write(files)?;
    write_coordinates(files, header, grid)?;
    if let Some(contact) = &header.table.contact {
        write_surfaces(files, contact)?;
    }
    files.set_json("zarr.json", &header.group())
}

/// By how much a component of a rotation may differ: another system's sines differ in their last
/// bits.
const TURN: f64 = 1e-12;

/// Names and metadata files.
const COORDINATES: [[&str; 2]; 4] = [
    ["x", "x/zarr.json"],
    ["y", "y/zarr.json"],
    ["z", "z/zarr.json"],
    ["quaternion", "quaternion/zarr.json"],
];

/// A coordinate: its name, its array, its values, and by how much these may differ.
struct Coordinate {
    name: &'static str,
    array: TableArray,
    values: Vec<f64>,
    tolerance: f64,
}

fn coordinates(header: &Header, grid: &RotationGrid) -> [Coordinate; 4] {
    let window = &header.table.window;
    let array = |names, dimensions: &[(&str, usize)], about: &str, unit: &str| {
        let attributes = json!({ "long_name": about, "units": unit });
        TableArray::new(
            names,
            Numbers::Float64,
            dimensions,
            Chunking::One,
            attributes,
        )
    };
    let axis = |axis: usize| {
        let along = (0..window.shape()[axis]).map(|i| window.position([i; 3]).to_array()[axis]);
        let (names, values) = (COORDINATES[axis], along.collect::<Vec<_>>());
        let about = "displacement of the moving part's pivot";
        Coordinate {
            name: names[0],
            array: array(names, &[(names[0], values.len())], about, "m"),
            values,
            tolerance: 0.0,
        }
    };
    let shape = [("rotation", grid.nodes().len()), ("component", 4)];
    let rotations = Coordinate {
        name: COORDINATES[3][0],
        array: array(COORDINATES[3], &shape, "x, y, z, w", "1"),
        values: grid.nodes().iter().flat_map(|q| q.to_array()).collect(),
        tolerance: TURN,
    };
    [axis(0), axis(1), axis(2), rotations]
}

/// Writes the coordinates.
fn write_coordinates(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    for Coordinate { array, values, .. } in coordinates(header, grid) {
        let raw = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        array.write_whole(files, raw)?;
    }
    Ok(())
}

/// Refuses coordinates that do not follow from the header.
pub(super) fn expect_coordinates(
    files: &TableFiles,
    header: &Header,
    grid: &RotationGrid,
) -> Result<(), StoreError> {
    for coordinate in coordinates(header, grid) {
        let Coordinate { array, values, .. } = &coordinate;
        let found = array.read_whole(files, values.len(), f64::from_le_bytes)?;
        let mut pairs = values.iter().zip(&found);
        // What is no number differs.
        let agrees = |(a, b): (&f64, &f64)| (a - b).abs() <= coordinate.tolerance;
        if let Some(at) = pairs.position(|pair| !agrees(pair)) {
            return Err(StoreError::Metadata {
                path: files.place().into(),
                item: coordinate.name,
                reason: format!("value {at} must be {}, found {}", values[at], found[at]),
            });
        }
    }
    Ok(())
}

/// Name and metadata file of the vertices and of the triangles of the fixed and the moving part.
const SURFACES: [[[&str; 2]; 2]; 2] = [
    [
        ["fixed_vertices", "fixed_vertices/zarr.json"],
        ["fixed_triangles", "fixed_triangles/zarr.json"],
    ],
    [
        ["moving_vertices", "moving_vertices/zarr.json"],
        ["moving_triangles", "moving_triangles/zarr.json"],
    ],
];

/// Their names.
const PARTS: [&str; 2] = ["fixed", "moving"];

/// Writes the surfaces of both parts.
pub(super) fn write_surfaces(files: &TableFiles, contact: &Contact) -> Result<(), StoreError> {
    let sizes = PartSize::from_contact(contact);
    for (((part, size), names), name) in
        (contact.parts().into_iter().zip(sizes).zip(SURFACES)).zip(PARTS)
    {
        let [vertices, triangles] = size.arrays(name, names);
        let numbers = part.vertices().iter().flat_map(|v| v.to_array());
        vertices.write_whole(files, numbers.flat_map(f64::to_le_bytes).collect())?;
        let corners = part.triangles().as_flattened().iter();
        triangles.write_whole(files, corners.flat_map(|c| c.to_le_bytes()).collect())?;
    }
    Ok(())
}

/// Reads both surfaces and prepares their sum; none for a table of densities that were not
/// smoothed.
pub(super) fn read_surfaces(
    files: &TableFiles,
    header: &Header,
) -> Result<Option<Contact>, StoreError> {
    let Some((smoothing, [fixed, moving])) = read_parts(files, header)? else {
        return Ok(None);
    };
    let metadata = |item, reason| metadata_error(files, item, reason);
    let jump = jump(&header.table.provenance.model)
        .map_err(|e: KernelError| metadata("sigma", e.to_string()))?;
    let window = &header.table.window;
    let region = ContactRegion::Window(PoseWindow {
        pivot: header.table.pivot(),
        // What is read there goes on a little outside.
        displacements: window.node_bounds().grown(3.0 * window.spacing()),
    });
    let parts = [fixed, moving].map(Arc::new);
    let contact = Contact::new(parts, &smoothing, jump, contact_bytes(None))
        .map_err(|e: ContactError| metadata("surfaces", e.to_string()))?;
    contact.prepare(&region);
    Ok(Some(contact))
}

/// Reads both surfaces, which must be those of the provenance; none for a table of densities that
/// were not smoothed.
pub(super) fn read_parts(
    files: &TableFiles,
    header: &Header,
) -> Result<Option<(Smoothing, [TriangleMesh; 2])>, StoreError> {
    let provenance = &header.table.provenance;
    let Some(smoothing) = Smoothing::of_provenance(provenance) else {
        return Ok(None);
    };
    let Some(sizes) = header.parts else {
        return Err(metadata_error(
            files,
            "attribute parts",
            "there is none".into(),
        ));
    };
    let hashes =
        [&provenance.fixed, &provenance.moving].map(|f| f.as_ref().map_or("", |f| &f.mesh));
    let read = |i: usize| {
        let part = read_part(files, sizes[i], PARTS[i], SURFACES[i])?;
        if blake3::Hash::from_bytes(part.hash()).to_hex().as_str() == hashes[i] {
            return Ok(part);
        }
        let reason = "the surface is not that of the provenance".to_owned();
        Err(metadata_error(files, SURFACES[i][1][1], reason))
    };
    Ok(Some((smoothing, [read(0)?, read(1)?])))
}

fn metadata_error(files: &TableFiles, item: &'static str, reason: String) -> StoreError {
    StoreError::Metadata {
        path: files.place().into(),
        item,
        reason,
    }
}

fn read_part(
    files: &TableFiles,
    size: PartSize,
    name: &str,
    names: [[&'static str; 2]; 2],
) -> Result<TriangleMesh, StoreError> {
    let [vertices, triangles] = size.arrays(name, names);
    let [count, corners] = [size.vertices, size.triangles].map(|n| n.saturating_mul(3));
    let numbers = vertices.read_whole(files, count, f64::from_le_bytes)?;
    let corners = triangles.read_whole(files, corners, u32::from_le_bytes)?;
    let vertices = numbers.as_chunks().0.iter().map(|v| DVec3::from_array(*v));
    // A part that was cleaned before stays as it is.
    let options = RepairOptions {
        weld_tolerance: 0.0,
        max_open_fraction: 1.0,
    };
    let corners = corners.as_chunks().0.to_vec();
    TriangleMesh::clean(names[0][0], vertices.collect(), corners, &options)
        .map(|(mesh, _)| mesh)
        .map_err(|e| StoreError::Metadata {
            path: files.place().into(),
            item: names[0][1],
            reason: e.to_string(),
        })
}
