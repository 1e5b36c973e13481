//! Tables on disk or in an object store: a Zarr v3 group, one chunk of energies per rotation node.
//!
//! `docs/table-format.md` describes the files. A table appears whole (its metadata is prepared
//! beside it and renamed into place, or in an object store written last), and so does every chunk;
//! a chunk that is there and passes its checksum is finished.

#[cfg(feature = "cloud")]
mod cloud;
mod error;
mod files;
mod header;
mod load;
mod skeleton;

use std::io;
use std::path::Path;

use half::f16;
use serde_json::{Value, json};
use zarrs::array::{Array, ArrayBuilder, ArrayError, ArrayMetadataOptions, CodecOptions};

pub use error::StoreError;
pub use files::TableFiles;

use crate::encode::{Encoded, Numbers, Probe, is_storable};
use crate::rotation_grid::RotationGrid;
use crate::table::{TableError, TableSpec};
use crate::table_error::ErrorReport;
use files::Storage;
use header::Header;
use skeleton::{energy_array, place, scale_array};

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 2;

/// A table on disk or in an object store, finished or not.
pub struct TableStore {
    files: TableFiles,
    header: Header,
    grid: RotationGrid,
    energies: Array<Storage>,
    /// Scales of whole numbers.
    scales: Option<Array<Storage>>,
}

impl std::fmt::Debug for TableStore {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { files, header, .. } = self;
        let fields = &mut f.debug_struct("TableStore");
        fields
            .field("files", files)
            .field("header", header)
            .finish_non_exhaustive()
    }
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
    /// Makes an empty table, or opens the one that is there if it has the same
    /// specification. `probe` is for a new table.
    ///
    /// # Errors
    /// If the specification is out of range, the path cannot be written, or there is something else
    /// at the path.
    pub(crate) fn create(
        files: &TableFiles,
        spec: &TableSpec,
        probe: Probe,
    ) -> Result<Self, StoreError> {
        spec.validate()?;
        if !files.exist()? {
            let grid = spec.grid().map_err(TableError::from)?;
            let header = Header {
                format: FORMAT_VERSION,
                program: concat!("pegfit ", env!("CARGO_PKG_VERSION")).into(),
                energy_unit: probe.unit,
                negligible: probe.negligible,
                table: spec.clone(),
                error: None,
            };
            place(files, &header, &grid)?;
        }
        let store = Self::open_files(files)?;
        store.expect_spec(spec)?;
        Ok(store)
    }

    /// Opens the table at a path or URL ([`TableFiles::at`]) without reading energies.
    ///
    /// # Errors
    /// If there is no table, or its metadata is of another format, damaged or out of range.
    pub fn open(path: &Path) -> Result<Self, StoreError> {
        Self::open_files(&TableFiles::at(path)?)
    }

    /// The same, wherever its files are.
    ///
    /// # Errors
    /// As [`TableStore::open`].
    pub fn open_files(files: &TableFiles) -> Result<Self, StoreError> {
        let header = Header::read(files)?;
        header.table.validate()?;
        expect_rotations(files, &header)?;
        let grid = header.table.grid().map_err(TableError::from)?;
        let energies = array(
            files,
            ["energy", "energy/zarr.json"],
            &energy_array(&header.table, &grid),
        )?;
        let scales = match header.table.storage.numbers {
            Numbers::Half => None,
            Numbers::Integer => Some(array(
                files,
                ["scale", "scale/zarr.json"],
                &scale_array(&grid),
            )?),
        };
        Ok(Self {
            files: files.clone(),
            header,
            grid,
            energies,
            scales,
        })
    }

    /// Where the table is: a path or a URL.
    pub fn path(&self) -> &Path {
        self.files.place()
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
                    path: self.path().into(),
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
            path: self.path().into(),
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

    fn damaged(&self, array: &Array<Storage>, row: usize, reason: String) -> StoreError {
        StoreError::Damaged {
            path: self.path().into(),
            key: array.chunk_key(&chunk_index(array, row)).to_string(),
            reason,
        }
    }

    fn chunk_error(&self, array: &Array<Storage>, row: usize, error: ArrayError) -> StoreError {
        match error {
            ArrayError::StorageError(e) => {
                let key = array.chunk_key(&chunk_index(array, row));
                self.files.io(key.as_str(), e)
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
            self.files
                .clean(&array.chunk_key(&chunk_index(array, row)))?;
        }
        Ok(())
    }

    /// Bytes of the files or objects that hold energies.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn bytes_on_disk(&self) -> Result<u64, StoreError> {
        self.files.bytes("energy/")
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
        let text = serde_json::to_vec_pretty(&header.group()).map_err(|e| StoreError::Io {
            path: self.path().join("zarr.json"),
            source: e.into(),
        })?;
        self.files.replace("zarr.json", text)?;
        self.header = header;
        Ok(())
    }
}

fn read<T: zarrs::array::ElementOwned>(
    array: &Array<Storage>,
    row: usize,
) -> Result<Option<Vec<T>>, ArrayError> {
    array.retrieve_chunk_if_exists_opt::<Vec<T>>(&chunk_index(array, row), &one_thread())
}

fn chunk_index(array: &Array<Storage>, row: usize) -> Vec<u64> {
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
    files: &TableFiles,
    [name, item]: [&'static str; 2],
    builder: &ArrayBuilder,
) -> Result<Array<Storage>, StoreError> {
    let metadata = |reason: String| StoreError::Metadata {
        path: files.place().into(),
        item,
        reason,
    };
    let array = builder
        .build(files.storage().clone(), &format!("/{name}"))
        .map_err(|e| metadata(e.to_string()))?;
    let text = files
        .read(item)?
        .ok_or_else(|| metadata("there is no such file".into()))?;
    let found: Value = serde_json::from_slice(&text).map_err(|e| metadata(e.to_string()))?;
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
fn expect_rotations(files: &TableFiles, header: &Header) -> Result<(), StoreError> {
    const KEY: &str = "quaternion/c/0/0";
    let bytes = files.size(KEY)?.ok_or_else(|| StoreError::Io {
        path: files.place().join(KEY),
        source: io::ErrorKind::NotFound.into(),
    })?;
    let (stored, box_nodes) = (bytes / 32, RotationGrid::box_nodes(&header.table.rotations));
    // A box has fewer than 64 nodes for each that is kept, once there are many.
    if box_nodes <= 64.0 * stored as f64 + 1e5 {
        return Ok(());
    }
    Err(StoreError::Metadata {
        path: files.place().into(),
        item: "quaternion",
        reason: format!("about {box_nodes:.1e} rotation nodes expected, {stored} found"),
    })
}
