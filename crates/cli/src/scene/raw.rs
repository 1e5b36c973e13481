//! The scene file as written: TOML keys, with their places in the text, before any check.

use std::fmt;

use fft_correlate::RotationDomain;
use haptic::HapticConfig;
use sdf_grid::LengthUnit;
use serde::Deserialize;
use serde::de::{MapAccess, Visitor, value::MapAccessDeserializer};
use toml::Spanned;

/// A whole scene file. Documented key by key in `docs/scene.md`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawScene {
    pub(crate) unit: LengthUnit,
    pub(crate) fixed: Spanned<RawPart>,
    pub(crate) moving: Spanned<RawPart>,
    pub(crate) cache: Option<String>,
    #[serde(default)]
    pub(crate) model: RawModel,
    #[serde(default)]
    pub(crate) lattice: RawLattice,
    #[serde(default)]
    pub(crate) window: RawWindow,
    pub(crate) rotations: Option<RotationDomain>,
    #[serde(default)]
    pub(crate) energy: RawEnergy,
    #[serde(default)]
    pub(crate) fit: RawFit,
    pub(crate) device: Option<Spanned<HapticConfig>>,
}

/// A part: a mesh path alone, or a table with more to say.
#[derive(Debug, Clone, Default)]
pub(crate) struct RawPart {
    pub(crate) mesh: String,
    pub(crate) name: Option<String>,
    pub(crate) position: Option<Spanned<[f64; 3]>>,
    pub(crate) rotation: Option<Spanned<[f64; 4]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartTable {
    mesh: String,
    name: Option<String>,
    position: Option<Spanned<[f64; 3]>>,
    rotation: Option<Spanned<[f64; 4]>>,
}

impl<'de> Deserialize<'de> for RawPart {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PartVisitor;
        impl<'de> Visitor<'de> for PartVisitor {
            type Value = RawPart;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a mesh path, or a table with `mesh` and optionally `name`, `position`, `rotation`")
            }

            fn visit_str<E: serde::de::Error>(self, mesh: &str) -> Result<RawPart, E> {
                Ok(RawPart {
                    mesh: mesh.to_owned(),
                    ..RawPart::default()
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RawPart, A::Error> {
                let table = PartTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(RawPart {
                    mesh: table.mesh,
                    name: table.name,
                    position: table.position,
                    rotation: table.rotation,
                })
            }
        }
        deserializer.deserialize_any(PartVisitor)
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Preset {
    Paper,
    #[default]
    Guided,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawModel {
    #[serde(default)]
    pub(crate) preset: Preset,
    pub(crate) sigma: Option<Spanned<f64>>,
    pub(crate) lambda_exterior: Option<Spanned<f64>>,
    pub(crate) lambda_interior: Option<Spanned<f64>>,
    pub(crate) separation_weight: Option<Spanned<f64>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RawSampling {
    Point,
    CellAverage,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLattice {
    pub(crate) spacing: Option<Spanned<f64>>,
    pub(crate) points: Option<Spanned<u32>>,
    pub(crate) halo: Option<Spanned<f64>>,
    pub(crate) field_tolerance: Option<Spanned<f64>>,
    pub(crate) sampling: Option<RawSampling>,
    pub(crate) deaverage: Option<Spanned<bool>>,
}

/// One number for all axes, or one per axis.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number or three numbers")]
pub(crate) enum PerAxis {
    Same(f64),
    Each([f64; 3]),
}

impl PerAxis {
    pub(crate) fn to_array(self) -> [f64; 3] {
        match self {
            Self::Same(v) => [v; 3],
            Self::Each(v) => v,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawWindow {
    pub(crate) center: Option<Spanned<[f64; 3]>>,
    pub(crate) half_extent: Option<Spanned<PerAxis>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawEnergy {
    pub(crate) gamma: Option<Spanned<f64>>,
    pub(crate) peak_force: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawFit {
    pub(crate) position: Option<Spanned<[f64; 3]>>,
    pub(crate) rotation: Option<Spanned<[f64; 4]>>,
    pub(crate) axis: Option<Spanned<[f64; 3]>>,
    pub(crate) depth: Option<Spanned<f64>>,
}
