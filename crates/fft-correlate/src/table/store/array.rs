//! The arrays of a table as Zarr v3 describes them: metadata, keys of chunks, and their coding.
//!
//! The codecs are Zarr's own: `bytes` (little-endian), for coefficients `gzip`, and `crc32c`. They
//! are written here because unpacked bytes must not grow beyond what a chunk holds, and because a
//! gzip header has room for the digest of the packed bytes, which other readers skip.

use std::io;
use std::io::{Read, Write};

use flate2::bufread::GzDecoder;
use flate2::{Compression, GzBuilder};
use serde_json::{Value, json};

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

/// Of the fast ones the first that counts how often each byte occurs, which is nearly all that can
/// be gained.
pub(super) const LEVEL: u32 = 2;

/// Bytes of a checksum.
pub(super) const CHECKSUM: usize = 4;

/// Bytes of a digest.
type Digest = [u8; blake3::OUT_LEN];

/// How the digest's field in a gzip header begins: the field's name and its length.
const FIELD: [u8; 4] = [b'P', b'F', blake3::OUT_LEN as u8, 0];

/// The most bytes that a chunk of `raw` bytes may take: Deflate adds less than a hundredth to what
/// it cannot pack.
pub(super) fn most_packed(raw: u64) -> u64 {
    raw.saturating_add(raw / 64).saturating_add(1024)
}

/// Packs numbers, their digest beside them.
pub(super) fn pack(raw: &[u8], digest: &Digest) -> io::Result<Vec<u8>> {
    let field = [&FIELD[..], digest].concat();
    let builder = GzBuilder::new().extra(field);
    let mut packer = builder.write(Vec::new(), Compression::new(LEVEL));
    packer.write_all(raw)?;
    Ok(with_checksum(packer.finish()?))
}

/// Unpacks exactly `length` bytes, and their digest.
pub(super) fn unpack(bytes: &[u8], length: usize) -> Result<(Vec<u8>, Digest), String> {
    let mut packed = checked(bytes)?;
    let mut unpacker = GzDecoder::new(&mut packed);
    // Deflate packs to a thousandth at most: nothing is allocated for what cannot come.
    let mut raw = Vec::with_capacity(length.min(bytes.len().saturating_mul(1100)));
    let mut bounded = (&mut unpacker).take(length as u64 + 1);
    bounded.read_to_end(&mut raw).map_err(|e| e.to_string())?;
    if raw.len() != length {
        let found = if raw.len() > length { "more" } else { "fewer" };
        return Err(format!("{length} bytes of numbers expected, found {found}"));
    }
    let field = unpacker.header().and_then(|h| h.extra());
    let digest = field.and_then(|f| f.strip_prefix(&FIELD));
    let digest = digest.and_then(|d| Digest::try_from(d).ok());
    let digest = digest.ok_or("there is no digest in it")?;
    match packed.is_empty() {
        true => Ok((raw, digest)),
        false => Err(format!("{} bytes too many at its end", packed.len())),
    }
}

/// The bytes before a checksum, which must be theirs.
pub(super) fn checked(bytes: &[u8]) -> Result<&[u8], String> {
    let Some((content, stored)) = bytes.split_last_chunk::<CHECKSUM>() else {
        return Err(format!("{} bytes hold no checksum", bytes.len()));
    };
    let (stored, found) = (u32::from_le_bytes(*stored), crc32c::crc32c(content));
    match stored == found {
        true => Ok(content),
        false => Err(format!(
            "the checksum is {stored:08x}, that of the bytes {found:08x}"
        )),
    }
}

pub(super) fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let checksum = crc32c::crc32c(&bytes);
    bytes.extend_from_slice(&checksum.to_le_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIGEST: Digest = [7; blake3::OUT_LEN];

    fn noise(length: usize) -> Vec<u8> {
        let mut state = 1u32;
        let next = |_| {
            state = state.wrapping_mul(1664525).wrapping_add(1013904223);
            (state >> 24) as u8
        };
        (0..length).map(next).collect()
    }

    #[test]
    fn what_is_packed_is_unpacked_and_within_its_bound() {
        for length in [0, 1, 54, 70_000] {
            for raw in [vec![0; length], noise(length)] {
                let packed = pack(&raw, &DIGEST).unwrap();
                assert!(
                    packed.len() as u64 <= most_packed(length as u64),
                    "{length}"
                );
                assert_eq!(unpack(&packed, length).unwrap(), (raw, DIGEST));
            }
        }
    }

    #[test]
    fn what_unpacks_to_another_length_is_refused_before_it_grows() {
        // A thousandth of what it unpacks to.
        let bomb = pack(&vec![0; 1 << 22], &DIGEST).unwrap();
        assert!(bomb.len() < 1 << 14);
        assert!(unpack(&bomb, 100).unwrap_err().contains("found more"));
        let short = pack(&[1, 2], &DIGEST).unwrap();
        assert!(unpack(&short, 100).unwrap_err().contains("found fewer"));
    }

    #[test]
    fn what_else_is_in_a_chunk_is_refused() {
        let packed = pack(&[1, 2, 3], &DIGEST).unwrap();
        let inner = checked(&packed).unwrap();
        let twice = with_checksum([inner, inner].concat());
        assert!(unpack(&twice, 3).unwrap_err().contains("too many"));
        let plain = GzBuilder::new().write(Vec::new(), Compression::new(LEVEL));
        let plain = with_checksum(plain.finish().unwrap());
        assert!(unpack(&plain, 0).unwrap_err().contains("no digest"));
        assert!(unpack(&with_checksum(vec![2, 1, 16, 2]), 3).is_err());
        for at in 0..packed.len() {
            let mut changed = packed.clone();
            changed[at] ^= 1;
            assert!(unpack(&changed, 3).is_err(), "byte {at}");
            assert!(unpack(&packed[..at], 3).is_err(), "cut at {at}");
        }
    }
}
