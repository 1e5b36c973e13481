//! Numbers in buffers.

use std::borrow::Cow;

use gltf::Accessor;
use gltf::accessor::sparse::{IndexType, Sparse};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::View;
use rustc_hash::FxHashMap;

use crate::mesh::error::MeshError;
use crate::mesh_io::soup::syntax;

/// Most values of an accessor that has no buffer: they are zeros that no byte of the file backs.
const MOST_ZEROS: usize = 1 << 22;

/// Bytes of the largest element read: four single-precision numbers.
const LARGEST: usize = 16;

/// A zero of any kind.
const ZEROS: &[u8] = &[0; LARGEST];

/// The bytes of a document's buffers, and the name of the file for errors.
pub(super) struct Numbers<'a> {
    pub(super) file: &'a str,
    pub(super) buffers: Vec<Cow<'a, [u8]>>,
}

impl Numbers<'_> {
    /// The vectors of an accessor, as numbers. Whole numbers are read as they are, or, if the
    /// accessor says `normalized`, as fractions of the largest.
    pub(super) fn vectors<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        types: &[DataType],
        place: &str,
    ) -> Result<Vec<[f64; N]>, MeshError> {
        let shape = if N == 4 {
            Dimensions::Vec4
        } else {
            Dimensions::Vec3
        };
        let (kind, normalized) = (accessor.data_type(), accessor.normalized());
        let size = kind.size();
        let vector = |at: &[u8]| -> [f64; N] {
            std::array::from_fn(|k| number(&at[k * size..], kind, normalized))
        };
        let elements = self.elements(accessor, shape, types, place)?;
        Ok(elements.map(vector).collect())
    }

    /// Indices, each below `limit`.
    pub(super) fn indices(
        &self,
        accessor: &Accessor<'_>,
        limit: usize,
        place: &str,
    ) -> Result<Vec<u32>, MeshError> {
        let types = [DataType::U8, DataType::U16, DataType::U32];
        let elements = self.elements(accessor, Dimensions::Scalar, &types, place)?;
        let checked = elements.map(|at| {
            let index = whole(at);
            if (index as usize) < limit {
                return Ok(index);
            }
            let expected = format!("vertex indices below {limit}");
            Err(syntax(self.file, place, expected, index.to_string()))
        });
        checked.collect()
    }

    /// The bytes of each element of an accessor, which is checked to lie inside its buffer.
    fn elements<'b>(
        &'b self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        types: &[DataType],
        place: &str,
    ) -> Result<impl Iterator<Item = &'b [u8]> + use<'b>, MeshError> {
        let place = format!("{place}, accessor {}", accessor.index());
        let (kind, number) = (accessor.dimensions(), accessor.data_type());
        if kind != dimensions || !types.contains(&number) {
            let expected = format!("{dimensions:?} of {types:?}");
            let found = format!("{kind:?} of {number:?}");
            return Err(syntax(self.file, place, expected, found));
        }
        let (count, size) = (accessor.count(), kind.multiplicity() * number.size());
        let (base, stride) = match accessor.view() {
            Some(view) => {
                let stride = view.stride().unwrap_or(size).max(size);
                let offset = accessor.offset();
                let base = self.strided(&view, offset, stride, size, count, &place)?;
                (Some(base), stride)
            }
            None if count > MOST_ZEROS => {
                let expected = format!("at most {MOST_ZEROS} values without a buffer view");
                return Err(syntax(self.file, place, expected, count.to_string()));
            }
            None => (None, size),
        };
        let mut replaced: FxHashMap<usize, &'b [u8]> = FxHashMap::default();
        if let Some(sparse) = accessor.sparse() {
            replaced = self.replaced(&sparse, size, &place)?;
        }
        Ok((0..count).map(move |i| {
            let of_base = || match base {
                Some(bytes) => &bytes[i * stride..i * stride + size],
                None => &ZEROS[..size],
            };
            replaced.get(&i).copied().unwrap_or_else(of_base)
        }))
    }

    /// The elements that a sparse accessor has others in place of.
    fn replaced<'b>(
        &'b self,
        sparse: &Sparse<'_>,
        size: usize,
        place: &str,
    ) -> Result<FxHashMap<usize, &'b [u8]>, MeshError> {
        let (count, indices, values) = (sparse.count(), sparse.indices(), sparse.values());
        let wide = match indices.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        let place = format!("{place}, sparse");
        let (view, offset) = (indices.view(), indices.offset());
        let at = self.strided(&view, offset, wide, wide, count, &place)?;
        let (view, offset) = (values.view(), values.offset());
        let with = self.strided(&view, offset, size, size, count, &place)?;
        let pair = |i: usize| {
            let index = whole(&at[i * wide..(i + 1) * wide]) as usize;
            (index, &with[i * size..(i + 1) * size])
        };
        Ok((0..count).map(pair).collect())
    }

    /// The bytes of a view from an offset on, with room for so many elements.
    fn strided<'b>(
        &'b self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
        place: &str,
    ) -> Result<&'b [u8], MeshError> {
        let buffer = self.buffers.get(view.buffer().index());
        let bytes =
            buffer.and_then(|b| b.get(view.offset()..)?.get(..view.length())?.get(offset..));
        let needed = count
            .checked_sub(1)
            .map_or(Some(0), |n| n.checked_mul(stride)?.checked_add(size));
        match (bytes, needed) {
            (Some(bytes), Some(needed)) if needed <= bytes.len() => Ok(bytes),
            _ => {
                let expected = format!("{count} values of {size} bytes inside their buffer view");
                Err(syntax(self.file, place, expected, "fewer bytes"))
            }
        }
    }
}

/// An unsigned whole number, its low byte first.
fn whole(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b))
}

/// The number at the start of bytes.
fn number(bytes: &[u8], kind: DataType, normalized: bool) -> f64 {
    let unsigned = whole(&bytes[..kind.size()]);
    let (value, most) = match kind {
        DataType::I8 => (f64::from(unsigned as u8 as i8), 127.0),
        DataType::U8 => (f64::from(unsigned), 255.0),
        DataType::I16 => (f64::from(unsigned as u16 as i16), 32767.0),
        DataType::U16 => (f64::from(unsigned), 65535.0),
        DataType::U32 => (f64::from(unsigned), f64::from(u32::MAX)),
        DataType::F32 => return f64::from(f32::from_bits(unsigned)),
    };
    match normalized {
        true => (value / most).max(-1.0),
        false => value,
    }
}
