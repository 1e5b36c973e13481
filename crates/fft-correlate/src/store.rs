//! Tables on disk: a Zarr v3 group, one chunk of half-precision energies per rotation node.
//!
//! `docs/table-format.md` describes the files. A table appears whole (its metadata is prepared
//! beside it and renamed into place), and so does every chunk; a chunk that is there and passes its
//! checksum is finished.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use half::f16;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use zarrs::array::codec::{
    BloscCodec, BloscCompressionLevel, BloscCompressor, BloscShuffleMode, Crc32cCodec,
};
use zarrs::array::{
    Array, ArrayBuilder, ArrayError, ArrayMetadataOptions, CodecOptions, data_type,
};
use zarrs::filesystem::FilesystemStore;
use zarrs::group::GroupBuilder;
use zarrs::storage::storage_adapter::atomic_write::AtomicWriteStorageAdapter;

use crate::rotation_grid::RotationGrid;
use crate::table::{EnergyTable, TableError, TableSpec};
use crate::table_error::ErrorReport;

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 1;

/// Why a table on disk cannot be made, read or extended.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// There is nothing at the path.
    #[error("{}: no table there", path.display())]
    Missing {
        /// Where.
        path: PathBuf,
    },
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// Which file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The metadata is not that of a table.
    #[error("{}: {item} is not that of an energy table: {reason}", path.display())]
    Metadata {
        /// The table.
        path: PathBuf,
        /// Which file or attribute.
        item: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The table is of another format.
    #[error("{}: table format {expected} expected, {found} found", path.display())]
    Version {
        /// The table.
        path: PathBuf,
        /// The format this program reads.
        expected: u32,
        /// The table's.
        found: u64,
    },
    /// The table is for another part.
    #[error("{}: table of another {part} part: mesh {expected} expected, {found} found", path.display())]
    Mesh {
        /// The table.
        path: PathBuf,
        /// `fixed` or `moving`.
        part: &'static str,
        /// Hash expected.
        expected: String,
        /// Hash in the table.
        found: String,
    },
    /// The table at the path was baked with another specification.
    #[error("{}: a table with another {item} is already there", path.display())]
    Different {
        /// The table.
        path: PathBuf,
        /// What differs first.
        item: String,
    },
    /// Rotation nodes are not baked yet.
    #[error(
        "{}: {missing} of {rotations} rotation nodes are missing, the first is {first}; bake with \
         resume",
        path.display()
    )]
    Incomplete {
        /// The table.
        path: PathBuf,
        /// How many.
        missing: usize,
        /// Of how many.
        rotations: usize,
        /// The first of them.
        first: usize,
    },
    /// A rotation node's chunk is truncated or does not pass its checksum.
    #[error("{}: chunk {key} is damaged: {reason}; bake with resume", path.display())]
    Damaged {
        /// The table.
        path: PathBuf,
        /// File of the chunk within the table.
        key: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The specification is out of range, or the table too large.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// The attribute `pegfit` of a table's group.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    format: u32,
    program: String,
    energy_unit: f64,
    table: TableSpec,
    #[serde(default)]
    error: Option<ErrorReport>,
}

type Storage = AtomicWriteStorageAdapter<FilesystemStore>;

/// A table on disk, finished or not.
#[derive(Debug)]
pub struct TableStore {
    path: PathBuf,
    header: Header,
    grid: RotationGrid,
    energies: Array<Storage>,
}

/// State of a rotation node's chunk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ChunkState {
    /// There and whole.
    Finished,
    /// Not there.
    Missing,
    /// There but truncated or wrong.
    Damaged(String),
}

impl TableStore {
    /// Makes an empty table at `path`, or opens the one that is there if it has the same
    /// specification. `unit` is the joules per stored unit of a new table.
    ///
    /// # Errors
    /// If the specification is out of range, the path cannot be written, or there is something else
    /// at the path.
    pub fn create(path: &Path, spec: &TableSpec, unit: f64) -> Result<Self, StoreError> {
        spec.validate()?;
        if !path.exists() {
            let grid = spec.grid().map_err(TableError::from)?;
            let header = Header {
                format: FORMAT_VERSION,
                program: concat!("pegfit ", env!("CARGO_PKG_VERSION")).into(),
                energy_unit: unit,
                table: spec.clone(),
                error: None,
            };
            place(path, &header, &grid)?;
        }
        let store = Self::open(path)?;
        store.expect_spec(spec)?;
        Ok(store)
    }

    /// Opens the table at `path` without reading energies.
    ///
    /// # Errors
    /// If there is no table, or its metadata is of another format, damaged or out of range.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        let header = read_header(path)?;
        header.table.validate()?;
        let grid = header.table.grid().map_err(TableError::from)?;
        let metadata = |reason: String| StoreError::Metadata {
            path: path.into(),
            item: "energy/zarr.json",
            reason,
        };
        let files = FilesystemStore::new(path).map_err(|e| metadata(e.to_string()))?;
        let storage = Arc::new(AtomicWriteStorageAdapter::new(Arc::new(files)));
        // The header decides what the array must be; its own metadata is for other readers.
        let energies = energy_array(&header.table, &grid)
            .build(storage, "/energy")
            .map_err(|e| metadata(e.to_string()))?;
        let text = fs::read_to_string(path.join("energy").join("zarr.json"))
            .map_err(|e| metadata(e.to_string()))?;
        let found: Value = serde_json::from_str(&text).map_err(|e| metadata(e.to_string()))?;
        let expected = json!(energies.metadata_opt(&metadata_options()));
        for (key, value) in expected.as_object().into_iter().flatten() {
            if found.get(key) != Some(value) {
                let found = found.get(key).unwrap_or(&Value::Null);
                return Err(metadata(format!("{key} must be {value}, found {found}")));
            }
        }
        Ok(Self {
            path: path.into(),
            header,
            grid,
            energies,
        })
    }

    /// Where the table is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.header.table
    }

    /// The rotation nodes; chunk `i` holds node `i`.
    pub fn grid(&self) -> &RotationGrid {
        &self.grid
    }

    /// Joules per stored unit.
    pub fn unit(&self) -> f64 {
        self.header.energy_unit
    }

    /// Name and version of the program that made the table.
    pub fn program(&self) -> &str {
        &self.header.program
    }

    /// The error measured on held-out poses, if it was.
    pub fn error_report(&self) -> Option<&ErrorReport> {
        self.header.error.as_ref()
    }

    /// Checks that the table is for these meshes, by their hashes.
    ///
    /// # Errors
    /// Names the part whose hash differs.
    pub fn expect_meshes(&self, fixed: &str, moving: &str) -> Result<(), StoreError> {
        let spec = self.spec();
        for (part, expected, found) in [
            ("fixed", fixed, &spec.fixed_mesh),
            ("moving", moving, &spec.moving_mesh),
        ] {
            if expected != found {
                return Err(StoreError::Mesh {
                    path: self.path.clone(),
                    part,
                    expected: expected.into(),
                    found: found.clone(),
                });
            }
        }
        Ok(())
    }

    fn expect_spec(&self, spec: &TableSpec) -> Result<(), StoreError> {
        self.expect_meshes(&spec.fixed_mesh, &spec.moving_mesh)?;
        let (found, expected) = (json!(self.spec()), json!(spec));
        let Some(item) = expected
            .as_object()
            .and_then(|e| e.iter().find(|(k, v)| found.get(k.as_str()) != Some(v)))
        else {
            return Ok(());
        };
        Err(StoreError::Different {
            path: self.path.clone(),
            item: item.0.clone(),
        })
    }

    /// Whether the chunk of a rotation node is finished.
    ///
    /// # Errors
    /// If the chunk is there but cannot be read.
    pub fn state(&self, row: usize) -> Result<ChunkState, StoreError> {
        match self.chunk(row) {
            Ok(Some(_)) => Ok(ChunkState::Finished),
            Ok(None) => Ok(ChunkState::Missing),
            Err(StoreError::Damaged { reason, .. }) => Ok(ChunkState::Damaged(reason)),
            Err(e) => Err(e),
        }
    }

    /// The stored energies of a rotation node; `None` if they are not there.
    fn chunk(&self, row: usize) -> Result<Option<Vec<f16>>, StoreError> {
        self.energies
            .retrieve_chunk_if_exists_opt::<Vec<f16>>(&chunk_index(row), &one_thread())
            .map_err(|e| self.chunk_error(row, e))
    }

    fn chunk_error(&self, row: usize, error: ArrayError) -> StoreError {
        let key = self.energies.chunk_key(&chunk_index(row)).to_string();
        match error {
            ArrayError::StorageError(e) => StoreError::Io {
                path: self.path.join(key),
                source: io::Error::other(e.to_string()),
            },
            e => StoreError::Damaged {
                path: self.path.clone(),
                key,
                reason: e.to_string(),
            },
        }
    }

    /// Stores the energies of a rotation node (half-precision bits in [`TableStore::unit`], C
    /// order). The chunk appears whole or not at all.
    ///
    /// # Errors
    /// If the chunk cannot be written; what was there before stays.
    ///
    /// # Panics
    /// If there are not as many energies as the window has nodes.
    pub(crate) fn write(&self, row: usize, energies: &[u16]) -> Result<(), StoreError> {
        assert_eq!(
            energies.len(),
            self.spec().window.len(),
            "one energy per node"
        );
        let energies: &[f16] = bytemuck::cast_slice(energies);
        self.energies
            .store_chunk_opt(&chunk_index(row), energies, &one_thread())
            .map_err(|e| self.chunk_error(row, e))
    }

    /// Removes what an interrupted write of a rotation node left behind.
    ///
    /// # Errors
    /// If the left-over file cannot be removed.
    pub(crate) fn clean(&self, row: usize) -> Result<(), StoreError> {
        let key = self.energies.chunk_key(&chunk_index(row));
        let left = self.path.join(format!("{key}.tmp"));
        match fs::remove_file(&left) {
            Err(source) if source.kind() != io::ErrorKind::NotFound => {
                Err(StoreError::Io { path: left, source })
            }
            _ => Ok(()),
        }
    }

    /// Reads all energies into memory, in parallel, checking every checksum. `memory_limit` bounds
    /// the bytes of energies.
    ///
    /// # Errors
    /// If the table is too large, incomplete, damaged, or holds numbers that are not finite.
    pub fn load(&self, memory_limit: u64) -> Result<EnergyTable, StoreError> {
        let rotations = self.grid.nodes().len();
        self.spec().check_memory(rotations, memory_limit)?;
        let mut table = EnergyTable::zeroed(self.spec().clone(), self.grid.clone(), self.unit());
        let missing = table
            .rows_mut()
            .enumerate()
            .map(|(row, out)| match self.chunk(row)? {
                None => Ok(Some(row)),
                Some(energies) => {
                    if let Some(bad) = energies.iter().position(|e| !e.is_finite()) {
                        return Err(StoreError::Damaged {
                            path: self.path.clone(),
                            key: self.energies.chunk_key(&chunk_index(row)).to_string(),
                            reason: format!("value {bad} is {}", energies[bad]),
                        });
                    }
                    out.copy_from_slice(bytemuck::cast_slice(&energies));
                    Ok(None)
                }
            })
            .filter_map(Result::transpose)
            .collect::<Result<Vec<usize>, StoreError>>()?;
        match missing.iter().min() {
            None => Ok(table),
            Some(&first) => Err(StoreError::Incomplete {
                path: self.path.clone(),
                missing: missing.len(),
                rotations,
                first,
            }),
        }
    }

    /// Writes the measured error into the table's attributes.
    ///
    /// # Errors
    /// If the attributes cannot be written; what was there before stays.
    pub fn write_error_report(&mut self, report: &ErrorReport) -> Result<(), StoreError> {
        let header = Header {
            error: Some(report.clone()),
            ..self.header.clone()
        };
        let file = self.path.join("zarr.json");
        let io = |source: io::Error| StoreError::Io {
            path: file.clone(),
            source,
        };
        let metadata = json!({
            "zarr_format": 3, "node_type": "group", "attributes": attributes(&header),
        });
        let mut temporary = tempfile::NamedTempFile::new_in(&self.path).map_err(io)?;
        serde_json::to_writer_pretty(&mut temporary, &metadata).map_err(|e| io(e.into()))?;
        temporary.as_file().sync_all().map_err(io)?;
        temporary.persist(&file).map_err(|e| io(e.error))?;
        self.header = header;
        Ok(())
    }
}

fn chunk_index(row: usize) -> [u64; 4] {
    [row as u64, 0, 0, 0]
}

/// Nodes are handled in parallel; within one, compression by one thread gives the same bytes always.
fn one_thread() -> CodecOptions {
    CodecOptions::default().with_concurrent_target(1)
}

/// Without the writing library's own version, which would make files depend on it.
fn metadata_options() -> ArrayMetadataOptions {
    ArrayMetadataOptions::default().with_include_zarrs_metadata(false)
}

fn attributes(header: &Header) -> Map<String, Value> {
    let mut attributes = Map::new();
    attributes.insert("pegfit".into(), json!(header));
    attributes
}

fn read_header(path: &Path) -> Result<Header, StoreError> {
    let file = path.join("zarr.json");
    let text = fs::read_to_string(&file).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => StoreError::Missing { path: path.into() },
        _ => StoreError::Io { path: file, source },
    })?;
    let metadata = |item, reason: String| StoreError::Metadata {
        path: path.into(),
        item,
        reason,
    };
    let group: Value =
        serde_json::from_str(&text).map_err(|e| metadata("zarr.json", e.to_string()))?;
    let header = &group["attributes"]["pegfit"];
    // Another format may have other keys: look at its number before the rest.
    let found = header["format"]
        .as_u64()
        .ok_or_else(|| metadata("zarr.json", "there is no format number".into()))?;
    if found != u64::from(FORMAT_VERSION) {
        return Err(StoreError::Version {
            path: path.into(),
            expected: FORMAT_VERSION,
            found,
        });
    }
    let header =
        Header::deserialize(header).map_err(|e| metadata("attribute pegfit", e.to_string()))?;
    let unit = header.energy_unit;
    if !(unit.is_finite() && unit > 0.0) {
        return Err(metadata("attribute energy_unit", format!("found {unit}")));
    }
    Ok(header)
}

/// Writes the metadata of an empty table to a folder beside `path` and renames it. If another
/// process was first, its table stays and this one is dropped.
fn place(path: &Path, header: &Header, grid: &RotationGrid) -> Result<(), StoreError> {
    let io = |source: io::Error| StoreError::Io {
        path: path.into(),
        source,
    };
    let parent = match path.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let folder = tempfile::Builder::new()
        .prefix(&format!(".{name}."))
        .suffix(".tmp")
        .tempdir_in(parent)
        .map_err(io)?;
    write_skeleton(folder.path(), header, grid).map_err(|e| io(io::Error::other(e)))?;
    match fs::rename(folder.path(), path) {
        Ok(()) => {
            let _ = folder.keep();
            fs::File::open(parent)
                .and_then(|d| d.sync_all())
                .map_err(io)
        }
        Err(_) if path.join("zarr.json").exists() => Ok(()),
        Err(source) => Err(io(source)),
    }
}

type AnyError = Box<dyn std::error::Error + Send + Sync>;

fn write_skeleton(folder: &Path, header: &Header, grid: &RotationGrid) -> Result<(), AnyError> {
    let files = Arc::new(FilesystemStore::new(folder)?);
    let window = &header.table.window;
    GroupBuilder::new()
        .attributes(attributes(header))
        .build(files.clone(), "/")?
        .store_metadata()?;
    energy_array(&header.table, grid)
        .build(files.clone(), "/energy")?
        .store_metadata_opt(&metadata_options())?;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let values: Vec<f64> = (0..window.shape()[axis])
            .map(|i| window.position([i; 3]).to_array()[axis])
            .collect();
        let about = "displacement of the moving part's pivot";
        coordinate(&files, name, &[(name, values.len())], &values, about, "m")?;
    }
    let quaternions: Vec<f64> = grid.nodes().iter().flat_map(|q| q.to_array()).collect();
    let shape = [("rotation", grid.nodes().len()), ("component", 4)];
    coordinate(
        &files,
        "quaternion",
        &shape,
        &quaternions,
        "x, y, z, w",
        "1",
    )
}

fn energy_array(spec: &TableSpec, grid: &RotationGrid) -> ArrayBuilder {
    let [nx, ny, nz] = spec.window.shape().map(|n| n as u64);
    let level = BloscCompressionLevel::try_from(5u8).expect("levels reach 9");
    let blosc = BloscCodec::new(
        BloscCompressor::LZ4,
        level,
        None,
        BloscShuffleMode::Shuffle,
        Some(2),
    )
    .expect("blosc has lz4 and the element size is given");
    let attributes = json!({
        "long_name": "energy in units of energy_unit", "coordinates": "quaternion",
    });
    let mut builder = ArrayBuilder::new(
        vec![grid.nodes().len() as u64, nx, ny, nz],
        vec![1, nx, ny, nz],
        data_type::float16(),
        f16::NAN,
    );
    builder
        .bytes_to_bytes_codecs(vec![Arc::new(blosc), Arc::new(Crc32cCodec::new())])
        .chunk_key_encoding_default_separator(zarrs::metadata::ChunkKeySeparator::Dot)
        .dimension_names(Some(["rotation", "x", "y", "z"]))
        .attributes(attributes.as_object().cloned().unwrap_or_default());
    builder
}

fn coordinate(
    files: &Arc<FilesystemStore>,
    name: &str,
    shape: &[(&str, usize)],
    values: &[f64],
    about: &str,
    unit: &str,
) -> Result<(), AnyError> {
    let lengths: Vec<u64> = shape.iter().map(|(_, n)| *n as u64).collect();
    let attributes = json!({ "long_name": about, "units": unit });
    let array = ArrayBuilder::new(
        lengths.clone(),
        lengths.clone(),
        data_type::float64(),
        f64::NAN,
    )
    .dimension_names(Some(shape.iter().map(|(n, _)| *n)))
    .bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())])
    .attributes(attributes.as_object().cloned().unwrap_or_default())
    .build(files.clone(), &format!("/{name}"))?;
    array.store_metadata_opt(&metadata_options())?;
    array.store_chunk_opt(&vec![0; shape.len()], values, &one_thread())?;
    Ok(())
}
