//! Tables on disk: a Zarr v3 group, one chunk of energies per rotation node.
//!
//! `docs/table-format.md` describes the files. A table appears whole (its metadata is prepared
//! beside it and renamed into place), and so does every chunk; a chunk that is there and passes its
//! checksum is finished.

mod error;
mod header;
mod load;
mod skeleton;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use half::f16;
use serde_json::{Value, json};
use zarrs::array::{Array, ArrayBuilder, ArrayError, ArrayMetadataOptions, CodecOptions};
use zarrs::filesystem::FilesystemStore;
use zarrs::storage::storage_adapter::atomic_write::AtomicWriteStorageAdapter;

pub use error::StoreError;

use crate::encode::{Encoded, Numbers, Probe, is_storable};
use crate::rotation_grid::RotationGrid;
use crate::table::{TableError, TableSpec};
use crate::table_error::ErrorReport;
use header::Header;
use skeleton::{energy_array, place, scale_array};

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 2;

type Files = AtomicWriteStorageAdapter<FilesystemStore>;

/// A table on disk, finished or not.
#[derive(Debug)]
pub struct TableStore {
    path: PathBuf,
    header: Header,
    grid: RotationGrid,
    energies: Array<Files>,
    /// Scales of whole numbers.
    scales: Option<Array<Files>>,
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
    /// specification. `probe` is for a new table.
    ///
    /// # Errors
    /// If the specification is out of range, the path cannot be written, or there is something else
    /// at the path.
    pub(crate) fn create(path: &Path, spec: &TableSpec, probe: Probe) -> Result<Self, StoreError> {
        spec.validate()?;
        if !path.exists() {
            let grid = spec.grid().map_err(TableError::from)?;
            let header = Header {
                format: FORMAT_VERSION,
                program: concat!("pegfit ", env!("CARGO_PKG_VERSION")).into(),
                energy_unit: probe.unit,
                negligible: probe.negligible,
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
        let header = Header::read(path)?;
        header.table.validate()?;
        expect_rotations(path, &header)?;
        let grid = header.table.grid().map_err(TableError::from)?;
        let energies = array(path, "energy", &energy_array(&header.table, &grid))?;
        let scales = match header.table.storage.numbers {
            Numbers::Half => None,
            Numbers::Integer => Some(array(path, "scale", &scale_array(&grid))?),
        };
        Ok(Self {
            path: path.into(),
            header,
            grid,
            energies,
            scales,
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

    /// Distance from the far energy up to which energies were left out, joules.
    pub fn negligible(&self) -> f64 {
        self.header.negligible
    }

    pub(crate) fn probe(&self) -> Probe {
        self.header.probe()
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

    /// The stored numbers of a rotation node, all finite; `None` if they are not there.
    fn chunk(&self, row: usize) -> Result<Option<Encoded>, StoreError> {
        let codes = match self.spec().storage.numbers {
            Numbers::Half => read::<f16>(&self.energies, row)
                .map(|c| c.map(|c| c.into_iter().map(f16::to_bits).collect())),
            Numbers::Integer => read::<i16>(&self.energies, row)
                .map(|c| c.map(|c| c.into_iter().map(|i| i as u16).collect())),
        };
        let codes: Option<Vec<u16>> =
            codes.map_err(|e| self.chunk_error(&self.energies, row, e))?;
        let Some(codes) = codes else { return Ok(None) };
        let numbers = self.spec().storage.numbers;
        if let Some(bad) = codes.iter().position(|&c| !is_storable(c, numbers)) {
            let reason = format!("value {bad} is not finite");
            return Err(self.damaged(&self.energies, row, reason));
        }
        let Some(scales) = &self.scales else {
            return Ok(Some(Encoded {
                codes,
                scale: 1.0,
                ..Encoded::default()
            }));
        };
        let scale = read::<f32>(scales, row).map_err(|e| self.chunk_error(scales, row, e))?;
        // It is written first, so one that is missing was lost.
        match scale.as_deref() {
            None => Ok(None),
            Some([scale]) if scale.is_normal() && *scale > 0.0 => Ok(Some(Encoded {
                codes,
                scale: *scale,
                ..Encoded::default()
            })),
            Some(found) => Err(self.damaged(scales, row, format!("the scale is {found:?}"))),
        }
    }

    fn damaged(&self, array: &Array<Files>, row: usize, reason: String) -> StoreError {
        StoreError::Damaged {
            path: self.path.clone(),
            key: array.chunk_key(&chunk_index(array, row)).to_string(),
            reason,
        }
    }

    fn chunk_error(&self, array: &Array<Files>, row: usize, error: ArrayError) -> StoreError {
        match error {
            ArrayError::StorageError(e) => {
                let key = array.chunk_key(&chunk_index(array, row)).to_string();
                StoreError::Io {
                    path: self.path.join(key),
                    source: io::Error::other(e.to_string()),
                }
            }
            e => self.damaged(array, row, e.to_string()),
        }
    }

    /// Stores a rotation node. Its chunk appears whole or not at all.
    ///
    /// # Errors
    /// If the chunk cannot be written; what was there before stays.
    ///
    /// # Panics
    /// If there are not as many energies as the window has nodes.
    pub(crate) fn write(&self, row: usize, encoded: &Encoded) -> Result<(), StoreError> {
        let nodes = self.spec().window.len();
        assert_eq!(encoded.codes.len(), nodes, "one energy per node");
        if let Some(scales) = &self.scales {
            scales
                .store_chunk_opt(&chunk_index(scales, row), &[encoded.scale], &one_thread())
                .map_err(|e| self.chunk_error(scales, row, e))?;
        }
        let (index, options) = (chunk_index(&self.energies, row), one_thread());
        match self.spec().storage.numbers {
            Numbers::Half => {
                let energies: &[f16] = bytemuck::cast_slice(&encoded.codes);
                self.energies.store_chunk_opt(&index, energies, &options)
            }
            Numbers::Integer => {
                let energies: &[i16] = bytemuck::cast_slice(&encoded.codes);
                self.energies.store_chunk_opt(&index, energies, &options)
            }
        }
        .map_err(|e| self.chunk_error(&self.energies, row, e))
    }

    /// Removes what an interrupted write of a rotation node left behind.
    ///
    /// # Errors
    /// If the left-over file cannot be removed.
    pub(crate) fn clean(&self, row: usize) -> Result<(), StoreError> {
        for array in self.scales.iter().chain([&self.energies]) {
            let key = array.chunk_key(&chunk_index(array, row));
            let left = self.path.join(format!("{key}.tmp"));
            match fs::remove_file(&left) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(StoreError::Io { path: left, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Bytes of the files that hold energies.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn bytes_on_disk(&self) -> Result<u64, StoreError> {
        let folder = self.path.join("energy");
        let io = |source| StoreError::Io {
            path: folder.clone(),
            source,
        };
        let mut bytes = 0;
        for entry in fs::read_dir(&folder).map_err(io)? {
            // Temporary files of other processes come and go.
            match entry.and_then(|e| e.metadata()) {
                Ok(metadata) => bytes += metadata.len(),
                Err(e) if e.kind() == io::ErrorKind::NotFound => {}
                Err(e) => return Err(io(e)),
            }
        }
        Ok(bytes)
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
        let mut temporary = tempfile::NamedTempFile::new_in(&self.path).map_err(io)?;
        serde_json::to_writer_pretty(&mut temporary, &header.group()).map_err(|e| io(e.into()))?;
        temporary.as_file().sync_all().map_err(io)?;
        temporary.persist(&file).map_err(|e| io(e.error))?;
        self.header = header;
        Ok(())
    }
}

fn read<T: zarrs::array::ElementOwned>(
    array: &Array<Files>,
    row: usize,
) -> Result<Option<Vec<T>>, ArrayError> {
    array.retrieve_chunk_if_exists_opt::<Vec<T>>(&chunk_index(array, row), &one_thread())
}

fn chunk_index(array: &Array<Files>, row: usize) -> Vec<u64> {
    let mut index = vec![0; array.shape().len()];
    index[0] = row as u64;
    index
}

/// Nodes are handled in parallel; within one, compression by one thread gives the same bytes always.
fn one_thread() -> CodecOptions {
    CodecOptions::default().with_concurrent_target(1)
}

/// Without the writing library's own version, which would make files depend on it.
fn metadata_options() -> ArrayMetadataOptions {
    ArrayMetadataOptions::default().with_include_zarrs_metadata(false)
}

/// An array of the table. The header decides what it must be; its own metadata, which is for other
/// readers, must agree.
fn array(
    path: &Path,
    name: &'static str,
    builder: &ArrayBuilder,
) -> Result<Array<Files>, StoreError> {
    let metadata = |reason: String| StoreError::Metadata {
        path: path.into(),
        item: match name {
            "energy" => "energy/zarr.json",
            _ => "scale/zarr.json",
        },
        reason,
    };
    let files = FilesystemStore::new(path).map_err(|e| metadata(e.to_string()))?;
    let files = Arc::new(AtomicWriteStorageAdapter::new(Arc::new(files)));
    let array = builder
        .build(files, &format!("/{name}"))
        .map_err(|e| metadata(e.to_string()))?;
    let text = fs::read_to_string(path.join(name).join("zarr.json"))
        .map_err(|e| metadata(e.to_string()))?;
    let found: Value = serde_json::from_str(&text).map_err(|e| metadata(e.to_string()))?;
    let expected = json!(array.metadata_opt(&metadata_options()));
    for (key, value) in expected.as_object().into_iter().flatten() {
        if found.get(key) != Some(value) {
            let found = found.get(key).unwrap_or(&Value::Null);
            return Err(metadata(format!("{key} must be {value}, found {found}")));
        }
    }
    Ok(array)
}

/// Refuses a header whose rotation domain is of another order of size than the file of the nodes'
/// quaternions, before the nodes are made: a damaged step must not fill the memory.
fn expect_rotations(path: &Path, header: &Header) -> Result<(), StoreError> {
    let file = path.join("quaternion").join("c").join("0").join("0");
    let bytes = match fs::metadata(&file) {
        Ok(m) => m.len(),
        Err(source) => return Err(StoreError::Io { path: file, source }),
    };
    let (stored, box_nodes) = (bytes / 32, RotationGrid::box_nodes(&header.table.rotations));
    // A box has fewer than 64 nodes for each that is kept, once there are many.
    if box_nodes <= 64.0 * stored as f64 + 1e5 {
        return Ok(());
    }
    Err(StoreError::Metadata {
        path: path.into(),
        item: "quaternion",
        reason: format!("about {box_nodes:.1e} rotation nodes expected, {stored} found"),
    })
}
