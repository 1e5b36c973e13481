//! The attribute `pegfit` of a table: what it holds, how, and what was measured of it.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::table::accuracy::ErrorReport;
use crate::table::encode::Probe;
use crate::table::spec::TableSpec;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::FORMAT_VERSION;
use crate::table::store::part_size::PartSize;

/// Content of the attribute.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Header {
    pub(super) format: u32,
    pub(super) program: String,
    pub(super) energy_unit: f64,
    /// Distance from the far energy that was left out, joules.
    pub(super) negligible: f64,
    pub(super) table: TableSpec,
    /// Sizes of the surfaces of the fixed and the moving part, if they are stored.
    #[serde(default)]
    pub(super) parts: Option<[PartSize; 2]>,
    #[serde(default)]
    pub(super) error: Option<ErrorReport>,
}

impl Header {
    pub(super) fn probe(&self) -> Probe {
        Probe {
            unit: self.energy_unit,
            negligible: self.negligible,
        }
    }

    /// The metadata of a table's group.
    pub(super) fn group(&self) -> Value {
        json!({ "zarr_format": 3, "node_type": "group", "attributes": self.attributes() })
    }

    pub(super) fn attributes(&self) -> Map<String, Value> {
        let mut attributes = Map::new();
        attributes.insert("pegfit".into(), json!(self));
        attributes
    }

    pub(super) fn read(files: &TableFiles) -> Result<Self, StoreError> {
        let path = files.place();
        match files.read("zarr.json")? {
            Some(text) => Self::parse(path, &text),
            None => Err(StoreError::Missing { path: path.into() }),
        }
    }

    fn parse(path: &Path, text: &[u8]) -> Result<Self, StoreError> {
        let metadata = |item, reason: String| StoreError::Metadata {
            path: path.into(),
            item,
            reason,
        };
        let group: Value =
            serde_json::from_slice(text).map_err(|e| metadata("zarr.json", e.to_string()))?;
        let header = &group["attributes"]["pegfit"];
        // Another format may have other keys: look at its number before the rest.
        let found = header["format"]
            .as_u64()
            .ok_or_else(|| metadata("zarr.json", "there is no format number".into()))?;
        if found != u64::from(FORMAT_VERSION) {
            return Err(StoreError::Version {
                path: path.into(),
                expected: FORMAT_VERSION,
                found,
            });
        }
        let header =
            Self::deserialize(header).map_err(|e| metadata("attribute pegfit", e.to_string()))?;
        let unit = header.energy_unit;
        if !(unit.is_normal() && unit > 0.0) {
            return Err(metadata("attribute energy_unit", format!("found {unit}")));
        }
        if !(header.negligible.is_finite() && header.negligible >= 0.0) {
            let found = format!("found {}", header.negligible);
            return Err(metadata("attribute negligible", found));
        }
        Ok(header)
    }
}
