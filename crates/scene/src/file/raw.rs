//! The scene file as written: TOML keys, with their places in the text, before any check.

use std::fmt;
use std::marker::PhantomData;

use fft_correlate::RotationDomain;
use haptic::HapticConfig;
use sdf_grid::LengthUnit;
use serde::Deserialize;
use serde::de::{MapAccess, SeqAccess, Visitor, value::MapAccessDeserializer};
use toml::Spanned;

/// A whole scene file. Documented key by key in `docs/scene.md`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawScene {
    pub(super) unit: LengthUnit,
    pub(super) fixed: Spanned<RawFixed>,
    pub(super) moving: Spanned<OrPath<RawPart>>,
    pub(super) cache: Option<String>,
    #[serde(default)]
    pub(super) model: RawModel,
    #[serde(default)]
    pub(super) lattice: RawLattice,
    #[serde(default)]
    pub(super) window: RawWindow,
    pub(super) rotations: Option<RotationDomain>,
    #[serde(default)]
    pub(super) energy: RawEnergy,
    #[serde(default)]
    pub(super) fit: RawFit,
    pub(super) device: Option<Spanned<HapticConfig>>,
    #[serde(default)]
    pub(super) loading: RawLoading,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLoading {
    pub(super) memory_mib: Option<Spanned<f64>>,
    pub(super) ahead: Option<Spanned<f64>>,
    pub(super) turn_ahead_deg: Option<Spanned<f64>>,
    pub(super) watch_s: Option<Spanned<f64>>,
}

/// What may be written as a path alone, or as a table with more to say.
pub(super) trait FromPath {
    const EXPECTING: &str;
    fn from_path(path: &str) -> Self;
}

/// Something written in either way.
#[derive(Debug, Clone)]
pub(super) struct OrPath<T>(pub(super) T);

impl<'de, T: FromPath + Deserialize<'de>> Deserialize<'de> for OrPath<T> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OrPathVisitor(PhantomData))
    }
}

struct OrPathVisitor<T>(PhantomData<T>);

impl<'de, T: FromPath + Deserialize<'de>> Visitor<'de> for OrPathVisitor<T> {
    type Value = OrPath<T>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(T::EXPECTING)
    }

    fn visit_str<E: serde::de::Error>(self, path: &str) -> Result<OrPath<T>, E> {
        Ok(OrPath(T::from_path(path)))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<OrPath<T>, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(OrPath)
    }
}

/// A solid of a file: its name, or its number from 1.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected the name or the number of a solid")]
pub(super) enum RawSolid {
    Name(String),
    Number(u32),
}

impl RawSolid {
    pub(super) fn to_text(&self) -> String {
        match self {
            Self::Name(name) => name.clone(),
            Self::Number(number) => number.to_string(),
        }
    }
}

/// A part.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawPart {
    pub(super) mesh: Option<String>,
    pub(super) meshes: Option<Spanned<Vec<OrPath<RawMesh>>>>,
    pub(super) solid: Option<RawSolid>,
    pub(super) segments_per_turn: Option<Spanned<u32>>,
    pub(super) step_time_limit: Option<Spanned<u32>>,
    pub(super) lossy: Option<bool>,
    pub(super) name: Option<String>,
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) rotation: Option<Spanned<[f64; 4]>>,
    pub(super) table: Option<Spanned<String>>,
}

impl FromPath for RawPart {
    const EXPECTING: &str = "a mesh path, or a table with `mesh` (or `meshes`) and optionally \
                             `solid`, `segments_per_turn`, `step_time_limit`, `lossy`, `name`, \
                             `position`, `rotation`, `table`";

    fn from_path(mesh: &str) -> Self {
        Self {
            mesh: Some(mesh.to_owned()),
            ..Self::default()
        }
    }
}

/// One mesh of a part that has several.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawMesh {
    pub(super) mesh: String,
    pub(super) solid: Option<RawSolid>,
    pub(super) segments_per_turn: Option<Spanned<u32>>,
    pub(super) step_time_limit: Option<Spanned<u32>>,
    pub(super) lossy: Option<bool>,
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) rotation: Option<Spanned<[f64; 4]>>,
}

impl FromPath for RawMesh {
    const EXPECTING: &str = "a mesh path, or a table with `mesh` and optionally `solid`, \
                             `segments_per_turn`, `step_time_limit`, `lossy`, `position`, \
                             `rotation`";

    fn from_path(mesh: &str) -> Self {
        Self {
            mesh: mesh.to_owned(),
            ..Self::default()
        }
    }
}

/// The parts that stay: one, or a list of them.
#[derive(Debug, Clone)]
pub(super) struct RawFixed(pub(super) Vec<Spanned<OrPath<RawPart>>>);

impl<'de> Deserialize<'de> for RawFixed {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PartsVisitor;
        impl<'de> Visitor<'de> for PartsVisitor {
            type Value = RawFixed;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "{}, or a list of such parts", RawPart::EXPECTING)
            }

            fn visit_str<E: serde::de::Error>(self, mesh: &str) -> Result<RawFixed, E> {
                Ok(RawFixed(vec![Spanned::new(
                    0..0,
                    OrPath(RawPart::from_path(mesh)),
                )]))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RawFixed, A::Error> {
                let part = RawPart::deserialize(MapAccessDeserializer::new(map))?;
                Ok(RawFixed(vec![Spanned::new(0..0, OrPath(part))]))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<RawFixed, A::Error> {
                let mut parts = Vec::new();
                while let Some(part) = list.next_element()? {
                    parts.push(part);
                }
                Ok(RawFixed(parts))
            }
        }
        deserializer.deserialize_any(PartsVisitor)
    }
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Preset {
    Paper,
    #[default]
    Guided,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawModel {
    #[serde(default)]
    pub(super) preset: Preset,
    pub(super) sigma: Option<Spanned<f64>>,
    pub(super) lambda_exterior: Option<Spanned<f64>>,
    pub(super) lambda_interior: Option<Spanned<f64>>,
    pub(super) separation_weight: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawLattice {
    pub(super) spacing: Option<Spanned<f64>>,
    pub(super) points: Option<Spanned<u32>>,
    pub(super) halo: Option<Spanned<f64>>,
    pub(super) field_tolerance: Option<Spanned<f64>>,
}

/// One number for all axes, or one per axis.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "expected a number or three numbers")]
pub(super) enum PerAxis {
    Same(f64),
    Each([f64; 3]),
}

impl PerAxis {
    pub(super) fn to_array(self) -> [f64; 3] {
        match self {
            Self::Same(v) => [v; 3],
            Self::Each(v) => v,
        }
    }
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawWindow {
    pub(super) center: Option<Spanned<[f64; 3]>>,
    pub(super) half_extent: Option<Spanned<PerAxis>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawEnergy {
    pub(super) gamma: Option<Spanned<f64>>,
    pub(super) peak_force: Option<Spanned<f64>>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFit {
    pub(super) position: Option<Spanned<[f64; 3]>>,
    pub(super) rotation: Option<Spanned<[f64; 4]>>,
    pub(super) axis: Option<Spanned<[f64; 3]>>,
    pub(super) depth: Option<Spanned<f64>>,
}
