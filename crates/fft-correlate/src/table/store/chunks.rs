//! The chunks of a table: one rotation node's coefficients each, there or not.

use std::io;

use zarrs_storage::Bytes;

use crate::rotations::grid::RotationGrid;
use crate::table::encode::{Encoded, far_code};
use crate::table::error::TableError;
use crate::table::layout::Layout;
use crate::table::spec::TableSpec;
use crate::table::stencil::value_of;
use crate::table::store::array::TableArray;
use crate::table::store::coding::{most_packed, pack, unpack};
use crate::table::store::coordinates;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::coefficient_array;
use crate::table::store::header::Header;
use crate::table::store::seal::Identity;
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
    identity: Identity,
    coefficients: TableArray,
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
        let coefficients = coefficient_array(&header.table, header.energy_unit, &grid);
        coefficients.expect(files)?;
        coordinates::expect(files, &header, &grid)?;
        Ok(Self {
            files: files.clone(),
            identity: header.identity(),
            header,
            grid,
            coefficients,
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

    /// The stored numbers of a rotation node, all finite and those that were baked for it; `None`
    /// if they are not there.
    pub(super) fn chunk(&self, row: usize) -> Result<Option<Vec<u16>>, StoreError> {
        let (key, length) = (self.coefficients.key(row), self.bytes());
        let Some(packed) = self.get(&key, most_packed(length as u64))? else {
            return Ok(None);
        };
        let damaged = |reason| self.damaged(&key, reason);
        let (raw, stored) = unpack(&packed, length).map_err(damaged)?;
        if self.identity.chunk(row, &raw) != stored {
            let reason = "its digest is that of another place or table, or of other numbers";
            return Err(self.damaged(&key, reason.into()));
        }
        let codes = raw.as_chunks().0.iter().map(|c| u16::from_le_bytes(*c));
        let codes: Vec<u16> = codes.collect();
        if let Some(bad) = codes.iter().position(|&c| !value_of(c).is_finite()) {
            return Err(self.damaged(&key, format!("value {bad} is not finite")));
        }
        Ok(Some(codes))
    }

    /// Bytes of the numbers of a rotation node.
    fn bytes(&self) -> usize {
        size_of::<u16>() * self.header.table.window.len()
    }

    fn get(&self, key: &str, limit: u64) -> Result<Option<Bytes>, StoreError> {
        let get = self.files.get(key, limit);
        get.map_err(|e| e.or(|reason| self.damaged(key, reason)))
    }

    fn damaged(&self, key: &str, reason: String) -> StoreError {
        StoreError::Damaged {
            path: self.files.place().into(),
            key: key.to_string(),
            reason,
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
        let codes = encoded.codes.iter().flat_map(|c| c.to_le_bytes());
        let raw: Vec<u8> = codes.collect();
        let digest = self.identity.chunk(row, &raw);
        let key = self.coefficients.key(row);
        let packed = pack(&raw, &digest);
        let packed = packed.map_err(|e| self.files.io(&key, e.into()))?;
        self.files.set(&key, packed)
    }

    /// Removes what an interrupted write of a rotation node left behind.
    ///
    /// # Errors
    /// If the left-over file cannot be removed.
    pub(crate) fn clean(&self, row: usize) -> Result<(), StoreError> {
        self.files.clean(&self.coefficients.key(row))
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

    /// Reads a rotation node into `out`, arranged by `layout`, checking its checksum.
    ///
    /// # Errors
    /// If it is not there or damaged.
    pub(crate) fn read_row(
        &self,
        row: usize,
        layout: &Layout,
        out: &mut [u16],
    ) -> Result<(), StoreError> {
        let Some(codes) = self.chunk(row)? else {
            return Err(self.incomplete(1, row));
        };
        let far = far_code(&self.header.table, self.header.energy_unit);
        layout.pack(&codes, far, out);
        Ok(())
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
    let (stored, box_nodes) = (bytes / 32, header.table.box_nodes());
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
