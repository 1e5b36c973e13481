//! The arrays of a table as Zarr v3 describes them: metadata, and keys of chunks.

use serde_json::{Value, json};

use crate::table::store::coding::{CHECKSUM, LEVEL, checked, with_checksum};
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;

/// Bytes of an array's metadata at most.
const LONGEST: u64 = 1 << 16;

/// Numbers of an array, as Zarr calls them, and what stands where there are none.
#[derive(Debug, Clone, Copy)]
pub(super) enum Numbers {
    Float16,
    Float64,
    UInt32,
}

/// How an array is cut into chunks, and these coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chunking {
    /// All of it in one, as it is.
    One,
    /// A chunk for each place along the first dimension, packed.
    PackedRows,
}

/// An array: where it is, and what its metadata must be.
#[derive(Debug, Clone)]
pub(super) struct TableArray {
    /// Its folder, and its metadata file.
    names: [&'static str; 2],
    metadata: Value,
    chunking: Chunking,
    dimensions: usize,
}

impl TableArray {
    /// An array of `dimensions`, by name and length.
    pub(super) fn new(
        names: [&'static str; 2],
        numbers: Numbers,
        dimensions: &[(&str, usize)],
        chunking: Chunking,
        attributes: Value,
    ) -> Self {
        let (kind, fill) = match numbers {
            Numbers::Float16 => ("float16", json!("NaN")),
            Numbers::Float64 => ("float64", json!("NaN")),
            Numbers::UInt32 => ("uint32", json!(0)),
        };
        let shape: Vec<usize> = dimensions.iter().map(|(_, n)| *n).collect();
        let named: Vec<&str> = dimensions.iter().map(|(name, _)| *name).collect();
        let (mut chunk, mut separator) = (shape.clone(), "/");
        if chunking != Chunking::One {
            (chunk[0], separator) = (1, ".");
        }
        let mut codecs = vec![json!({ "name": "bytes", "configuration": { "endian": "little" } })];
        if chunking == Chunking::PackedRows {
            codecs.push(json!({ "name": "gzip", "configuration": { "level": LEVEL } }));
        }
        codecs.push(json!({ "name": "crc32c" }));
        let metadata = json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": shape,
            "data_type": kind,
            "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
            "chunk_key_encoding": {
                "name": "default", "configuration": { "separator": separator },
            },
            "fill_value": fill,
            "codecs": codecs,
            "attributes": attributes,
            "dimension_names": named,
        });
        Self {
            names,
            metadata,
            chunking,
            dimensions: dimensions.len(),
        }
    }

    /// The key of the chunk at `row` along the first dimension, 0 where there is one chunk.
    pub(super) fn key(&self, row: usize) -> String {
        let separator = match self.chunking {
            Chunking::One => "/",
            Chunking::PackedRows => ".",
        };
        let rest = format!("{separator}0").repeat(self.dimensions - 1);
        format!("{}/c{separator}{row}{rest}", self.names[0])
    }

    /// Writes the metadata.
    pub(super) fn write(&self, files: &TableFiles) -> Result<(), StoreError> {
        files.set_json(self.names[1], &self.metadata)
    }

    /// Checks the metadata, which is for other readers: this one knows already. Keys that are not of
    /// the array's are theirs.
    pub(super) fn expect(&self, files: &TableFiles) -> Result<(), StoreError> {
        let item = self.names[1];
        let refused = |reason: String| StoreError::Metadata {
            path: files.place().into(),
            item,
            reason,
        };
        let text = files.get(item, LONGEST).map_err(|e| e.or(refused))?;
        let text = text.ok_or_else(|| refused("there is no such file".into()))?;
        let found: Value = serde_json::from_slice(&text).map_err(|e| refused(e.to_string()))?;
        for (key, value) in self.metadata.as_object().into_iter().flatten() {
            if found.get(key) != Some(value) {
                let found = found.get(key).unwrap_or(&Value::Null);
                return Err(refused(format!("{key} must be {value}, found {found}")));
            }
        }
        Ok(())
    }

    /// Writes the only chunk of an array from its numbers' little-endian bytes.
    pub(super) fn write_whole(&self, files: &TableFiles, raw: Vec<u8>) -> Result<(), StoreError> {
        self.write(files)?;
        files.set(&self.key(0), with_checksum(raw))
    }

    /// All `count` numbers of an array of one chunk, each made `of` its little-endian bytes. Nothing
    /// is read unless the chunk's file has their length.
    pub(super) fn read_whole<T, const N: usize>(
        &self,
        files: &TableFiles,
        count: usize,
        of: fn([u8; N]) -> T,
    ) -> Result<Vec<T>, StoreError> {
        self.expect(files)?;
        let key = self.key(0);
        let damaged = |reason: String| StoreError::Damaged {
            path: files.place().into(),
            key: key.clone(),
            reason,
        };
        let expected = (count as u64)
            .saturating_mul(N as u64)
            .saturating_add(CHECKSUM as u64);
        let bytes = files.get(&key, expected).map_err(|e| e.or(damaged))?;
        let bytes = bytes.ok_or_else(|| damaged("there is no such file".into()))?;
        if bytes.len() as u64 != expected {
            let found = bytes.len();
            return Err(damaged(format!("{expected} bytes expected, found {found}")));
        }
        let content = checked(&bytes).map_err(damaged)?;
        Ok(content.as_chunks().0.iter().map(|b| of(*b)).collect())
    }
}
