//! The format of a table's files: its version, its arrays and how their chunks are coded.

use std::sync::Arc;

use half::f16;
use serde_json::{Value, json};
use zarrs::array::codec::{
    BloscCodec, BloscCompressionLevel, BloscCompressor, BloscShuffleMode, Crc32cCodec,
};
use zarrs::array::{
    Array, ArrayBuilder, ArrayError, ArrayMetadataOptions, CodecOptions, data_type,
};
use zarrs::metadata::ChunkKeySeparator;

use crate::pair::contact::Smoothing;
use crate::rotations::grid::RotationGrid;
use crate::table::spec::TableSpec;
use crate::table::storage::Numbers;
use crate::table::store::backend::Backend;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;

/// Version of the layout and of the meaning of the attributes.
pub const FORMAT_VERSION: u32 = 5;

/// One chunk of coefficients for each rotation node; stored numbers are `unit` joules each.
pub(super) fn coefficient_array(spec: &TableSpec, unit: f64, grid: &RotationGrid) -> ArrayBuilder {
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
    // What readers that follow the CF conventions multiply by: they find joules. Whole numbers have
    // a scale per rotation, which those conventions cannot say: joules are the product of two
    // arrays.
    let name = match Smoothing::of_recipe(&spec.recipe) {
        Some(_) => "cubic B-spline coefficients of the energy, without what contact adds",
        None => "cubic B-spline coefficients of the energy",
    };
    let attributes = match spec.storage.numbers {
        Numbers::Half => json!({
            "long_name": name, "units": "J", "scale_factor": unit,
            "coordinates": "quaternion",
        }),
        Numbers::Integer => json!({
            "long_name": format!("{name}, as a multiple of scale"), "units": "1", "_FillValue": i16::MIN,
            "coordinates": "quaternion scale",
        }),
    };
    let (shape, chunk) = (
        vec![grid.nodes().len() as u64, nx, ny, nz],
        vec![1, nx, ny, nz],
    );
    let mut builder = match spec.storage.numbers {
        Numbers::Half => ArrayBuilder::new(shape, chunk, data_type::float16(), f16::NAN),
        Numbers::Integer => ArrayBuilder::new(shape, chunk, data_type::int16(), i16::MIN),
    };
    builder
        .bytes_to_bytes_codecs(vec![Arc::new(blosc), Arc::new(Crc32cCodec::new())])
        .chunk_key_encoding_default_separator(ChunkKeySeparator::Dot)
        .dimension_names(Some(["rotation", "x", "y", "z"]))
        .attributes(attributes.as_object().cloned().unwrap_or_default());
    builder
}

/// What the whole numbers of each rotation node are multiplied by, in `unit` joules.
pub(super) fn scale_array(unit: f64, grid: &RotationGrid) -> ArrayBuilder {
    let attributes = json!({
        "long_name": "coefficient per whole number", "units": "J", "scale_factor": unit,
    });
    let shape = vec![grid.nodes().len() as u64];
    let mut builder = ArrayBuilder::new(shape, vec![1], data_type::float32(), f32::NAN);
    builder
        .bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())])
        .chunk_key_encoding_default_separator(ChunkKeySeparator::Dot)
        .dimension_names(Some(["rotation"]))
        .attributes(attributes.as_object().cloned().unwrap_or_default());
    builder
}

pub(super) fn read<T: zarrs::array::ElementOwned>(
    array: &Array<Backend>,
    row: usize,
) -> Result<Option<Vec<T>>, ArrayError> {
    array.retrieve_chunk_if_exists_opt::<Vec<T>>(&chunk_index(array, row), &one_thread())
}

pub(super) fn chunk_index(array: &Array<Backend>, row: usize) -> Vec<u64> {
    let mut index = vec![0; array.shape().len()];
    index[0] = row as u64;
    index
}

/// Nodes are handled in parallel; within one, compression by one thread gives the same bytes
/// always.
pub(super) fn one_thread() -> CodecOptions {
    CodecOptions::default().with_concurrent_target(1)
}

/// Without the writing library's own version, which would make files depend on it.
pub(super) fn metadata_options() -> ArrayMetadataOptions {
    ArrayMetadataOptions::default().with_include_zarrs_metadata(false)
}

/// An array of the table. The header decides what it must be; its own metadata, which is for other
/// readers, must agree.
pub(super) fn array(
    files: &TableFiles,
    [name, item]: [&'static str; 2],
    builder: &ArrayBuilder,
) -> Result<Array<Backend>, StoreError> {
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
