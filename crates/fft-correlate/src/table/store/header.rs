//! The attribute `pegfit` of a table: what it holds, how, and what was measured of it.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::geometry::placement::Placement;
use crate::table::accuracy::ErrorReport;
use crate::table::encode::Probe;
use crate::table::spec::TableSpec;
use crate::table::store::error::StoreError;
use crate::table::store::files::TableFiles;
use crate::table::store::format::FORMAT_VERSION;
use crate::table::store::part_size::PartSize;
use crate::table::store::seal::{Identity, digest};

/// Bytes of a table's metadata at most: a hundred thousand listed rotations.
pub(super) const LONGEST: u64 = 1 << 24;

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
    /// Of all that stands before it ([`Header::sealed`]).
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub(super) digest: String,
}

/// What a table's identity is made of.
#[derive(Serialize)]
struct Material<'a> {
    format: u32,
    energy_unit: f64,
    negligible: f64,
    parts: &'a Option<[PartSize; 2]>,
    table: TableSpec,
}

/// Of the metadata of a table's group what this program reads; the rest is others'.
#[derive(Deserialize)]
struct Group<T> {
    attributes: Attributes<T>,
}

#[derive(Deserialize)]
struct Attributes<T> {
    pegfit: T,
}

/// Another format may have other keys.
#[derive(Deserialize)]
struct Numbered {
    format: u64,
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
        json!({ "zarr_format": 3, "node_type": "group", "attributes": { "pegfit": self } })
    }

    /// With the digest of what it says.
    pub(super) fn sealed(mut self) -> Self {
        self.digest = String::new();
        self.digest = digest(&self);
        self
    }

    /// What the energies depend on: all of this but the placement, the error and who made it.
    pub(super) fn identity(&self) -> Identity {
        Identity::of(&Material {
            format: self.format,
            energy_unit: self.energy_unit,
            negligible: self.negligible,
            parts: &self.parts,
            table: TableSpec {
                placement: Placement::IDENTITY,
                contact: None,
                ..self.table.clone()
            },
        })
    }

    pub(super) fn read(files: &TableFiles) -> Result<Self, StoreError> {
        let path = files.place();
        let text = files.get("zarr.json", LONGEST).map_err(|e| {
            e.or(|reason| StoreError::Metadata {
                path: path.into(),
                item: "zarr.json",
                reason,
            })
        })?;
        match text {
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
        let numbered: Group<Numbered> =
            serde_json::from_slice(text).map_err(|e| metadata("zarr.json", e.to_string()))?;
        let found = numbered.attributes.pegfit.format;
        if found != u64::from(FORMAT_VERSION) {
            return Err(StoreError::Version {
                path: path.into(),
                expected: FORMAT_VERSION,
                found,
            });
        }
        let group: Group<Self> = serde_json::from_slice(text)
            .map_err(|e| metadata("attribute pegfit", e.to_string()))?;
        let stored = group.attributes.pegfit;
        let header = stored.clone().sealed();
        if header.digest != stored.digest {
            let reason = format!(
                "its digest is {:?}, that of what it says {}: it was changed after it was \
                 written; bake it again",
                stored.digest, header.digest
            );
            return Err(metadata("attribute pegfit", reason));
        }
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
