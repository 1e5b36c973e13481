//! How much of a part's surface is stored, and as which arrays.

use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::pair::contact::Contact;
use crate::table::store::array::{Chunking, Numbers, TableArray};

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

    /// The arrays of vertices and of triangles of the part of this name, called `names`.
    pub(super) fn arrays(self, part: &str, names: [[&'static str; 2]; 2]) -> [TableArray; 2] {
        let array = |names, rows: usize, row: &str, column, numbers, about: &str, unit: &str| {
            let dimensions = [(&*format!("{part}_{row}"), rows), (column, 3)];
            let attributes = json!({ "long_name": about, "units": unit });
            TableArray::new(names, numbers, &dimensions, Chunking::One, attributes)
        };
        [
            array(
                names[0],
                self.vertices,
                "vertex",
                "axis",
                Numbers::Float64,
                "vertices of the part's surface, x, y, z in its own frame",
                "m",
            ),
            array(
                names[1],
                self.triangles,
                "triangle",
                "corner",
                Numbers::UInt32,
                "vertices of the part's triangles, counter-clockwise from outside",
                "1",
            ),
        ]
    }
}
