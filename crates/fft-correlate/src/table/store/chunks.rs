//! The chunks of a table: one rotation node's coefficients each, there or not.

use std::io;

use half::f16;
use zarrs::array::{Array, ArrayError};

use crate::rotations::grid::RotationGrid;
use crate::table::encode::{Encoded, far_code, is_storable};
use crate::table::error::TableError;
use crate::table::layout::Layout;
use crate::table::spec::TableSpec;
use crate::table::storage::Numbers;
use crate::table::store::backend::Backend;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::{
    array, chunk_index, coefficient_array, one_thread, read, scale_array,
};
use crate::table::store::header::Header;
use crate::table::store::surfaces;

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

/// What the files of a table say, and its arrays.
pub(crate) struct Chunks {
    pub(super) files: TableFiles,
    pub(super) header: Header,
    pub(super) grid: RotationGrid,
    coefficients: Array<Backend>,
    /// Scales of whole numbers.
    scales: Option<Array<Backend>>,
}

impl Chunks {
    /// Reads all metadata of a table; no coefficients.
    ///
    /// # Errors
    /// If there is no table, or its metadata is of another format, damaged or out of range.
    pub(super) fn open(files: &TableFiles) -> Result<Self, StoreError> {
        let header = Header::read(files)?;
        header.table.validate()?;
        expect_rotations(files, &header)?;
        let grid = header.table.grid().map_err(TableError::from)?;
        let coefficients = array(
            files,
            ["coefficients", "coefficients/zarr.json"],
            &coefficient_array(&header.table, header.energy_unit, &grid),
        )?;
        let scales = match header.table.storage.numbers {
            Numbers::Half => None,
            Numbers::Integer => Some(array(
                files,
                ["scale", "scale/zarr.json"],
                &scale_array(header.energy_unit, &grid),
            )?),
        };
        Ok(Self {
            files: files.clone(),
            header,
            grid,
            coefficients,
            scales,
        })
    }

    /// What the table holds, with what smoothing took from the energies.
    pub(super) fn whole_spec(&self) -> Result<TableSpec, StoreError> {
        Ok(TableSpec {
            contact: surfaces::read(&self.files, &self.header)?,
            ..self.header.table.clone()
        })
    }

    /// Whether the chunk of a rotation node is finished.
    ///
    /// # Errors
    /// If the chunk is there but cannot be read.
    pub(super) fn state(&self, row: usize) -> Result<ChunkState, StoreError> {
        match self.chunk(row) {
            Ok(Some(_)) => Ok(ChunkState::Finished),
            Ok(None) => Ok(ChunkState::Missing),
            Err(StoreError::Damaged { reason, .. }) => Ok(ChunkState::Damaged(reason)),
            Err(e) => Err(e),
        }
    }

    /// The stored numbers of a rotation node, all finite; `None` if they are not there.
    pub(super) fn chunk(&self, row: usize) -> Result<Option<Encoded>, StoreError> {
        let codes = match self.header.table.storage.numbers {
            Numbers::Half => read::<f16>(&self.coefficients, row)
                .map(|c| c.map(|c| c.into_iter().map(f16::to_bits).collect())),
            Numbers::Integer => read::<i16>(&self.coefficients, row)
                .map(|c| c.map(|c| c.into_iter().map(|i| i as u16).collect())),
        };
        let codes: Option<Vec<u16>> =
            codes.map_err(|e| self.chunk_error(&self.coefficients, row, e))?;
        let Some(codes) = codes else { return Ok(None) };
        let numbers = self.header.table.storage.numbers;
        if let Some(bad) = codes.iter().position(|&c| !is_storable(c, numbers)) {
            let reason = format!("value {bad} is not finite");
            return Err(self.damaged(&self.coefficients, row, reason));
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

    fn damaged(&self, array: &Array<Backend>, row: usize, reason: String) -> StoreError {
        StoreError::Damaged {
            path: self.files.place().into(),
            key: array.chunk_key(&chunk_index(array, row)).to_string(),
            reason,
        }
    }

    fn chunk_error(&self, array: &Array<Backend>, row: usize, error: ArrayError) -> StoreError {
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
    /// If there are not as many coefficients as the window has nodes.
    pub(crate) fn write(&self, row: usize, encoded: &Encoded) -> Result<(), StoreError> {
        let nodes = self.header.table.window.len();
        assert_eq!(encoded.codes.len(), nodes, "one coefficient per node");
        if let Some(scales) = &self.scales {
            scales
                .store_chunk_opt(&chunk_index(scales, row), &[encoded.scale], &one_thread())
                .map_err(|e| self.chunk_error(scales, row, e))?;
        }
        let (index, options) = (chunk_index(&self.coefficients, row), one_thread());
        match self.header.table.storage.numbers {
            Numbers::Half => {
                let coefficients: &[f16] = bytemuck::cast_slice(&encoded.codes);
                self.coefficients
                    .store_chunk_opt(&index, coefficients, &options)
            }
            Numbers::Integer => {
                let coefficients: &[i16] = bytemuck::cast_slice(&encoded.codes);
                self.coefficients
                    .store_chunk_opt(&index, coefficients, &options)
            }
        }
        .map_err(|e| self.chunk_error(&self.coefficients, row, e))
    }

    /// Removes what an interrupted write of a rotation node left behind.
    ///
    /// # Errors
    /// If the left-over file cannot be removed.
    pub(crate) fn clean(&self, row: usize) -> Result<(), StoreError> {
        for array in self.scales.iter().chain([&self.coefficients]) {
            self.files
                .clean(&array.chunk_key(&chunk_index(array, row)))?;
        }
        Ok(())
    }

    /// Checks, by the names of the files alone, that there is a chunk for every rotation node.
    pub(crate) fn expect_all_there(&self) -> Result<(), StoreError> {
        let mut there = vec![false; self.grid.nodes().len()];
        for key in self.files.keys_under("coefficients/")? {
            let row = key
                .strip_prefix("coefficients/c.")
                .and_then(|k| k.split('.').next());
            let row = row.and_then(|row| row.parse::<usize>().ok());
            if let Some(there) = row.and_then(|row| there.get_mut(row)) {
                *there = true;
            }
        }
        let missing = there.iter().enumerate().filter(|(_, there)| !**there);
        self.expect_none(missing.map(|(row, _)| row).collect())
    }

    /// Reads a rotation node into `out`, arranged by `layout`, checking its checksum, and gives its
    /// scale.
    ///
    /// # Errors
    /// If it is not there or damaged.
    pub(crate) fn read_row(
        &self,
        row: usize,
        layout: &Layout,
        out: &mut [u16],
    ) -> Result<f32, StoreError> {
        let Some(chunk) = self.chunk(row)? else {
            return Err(self.incomplete(1, row));
        };
        let far = far_code(&self.header.table, self.header.energy_unit, chunk.scale);
        layout.pack(&chunk.codes, far, out);
        Ok(chunk.scale)
    }

    /// Refuses missing rotation nodes.
    pub(super) fn expect_none(&self, missing: Vec<usize>) -> Result<(), StoreError> {
        match missing.iter().min() {
            None => Ok(()),
            Some(&first) => Err(self.incomplete(missing.len(), first)),
        }
    }

    fn incomplete(&self, missing: usize, first: usize) -> StoreError {
        StoreError::Incomplete {
            path: self.files.place().into(),
            missing,
            rotations: self.grid.nodes().len(),
            first,
        }
    }
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
