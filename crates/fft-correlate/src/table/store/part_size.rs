//! How much of a part's surface is stored, and as which arrays.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::json;
use zarrs::array::ArrayBuilder;
use zarrs::array::builder::ArrayBuilderFillValue;
use zarrs::array::codec::Crc32cCodec;
use zarrs::array::data_type;

use crate::pair::contact::Contact;

/// How much of a part is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PartSize {
    pub(super) vertices: usize,
    pub(super) triangles: usize,
}

impl PartSize {
    /// The sizes of both parts.
    pub(super) fn of(contact: &Contact) -> [Self; 2] {
        contact.parts().map(|part| Self {
            vertices: part.vertices().len(),
            triangles: part.triangles().len(),
        })
    }

    /// The arrays of vertices and of triangles of the part of this name.
    pub(super) fn builders(self, part: &str) -> [ArrayBuilder; 2] {
        let builder =
            |rows: usize, names: [&str; 2], numbers, empty: ArrayBuilderFillValue, about, unit| {
                let shape = vec![rows as u64, 3];
                let attributes = json!({ "long_name": about, "units": unit });
                let mut builder = ArrayBuilder::new(shape.clone(), shape, numbers, empty);
                builder
                    .bytes_to_bytes_codecs(vec![Arc::new(Crc32cCodec::new())])
                    .dimension_names(Some([format!("{part}_{}", names[0]), names[1].to_owned()]))
                    .attributes(attributes.as_object().cloned().unwrap_or_default());
                builder
            };
        [
            builder(
                self.vertices,
                ["vertex", "axis"],
                data_type::float64(),
                f64::NAN.into(),
                "vertices of the part's surface, x, y, z in its own frame",
                "m",
            ),
            builder(
                self.triangles,
                ["triangle", "corner"],
                data_type::uint32(),
                0u32.into(),
                "vertices of the part's triangles, counter-clockwise from outside",
                "1",
            ),
        ]
    }
}
