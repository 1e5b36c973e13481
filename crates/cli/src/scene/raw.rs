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
pub(crate) struct RawScene {
    pub(crate) unit: LengthUnit,
    pub(crate) fixed: Spanned<RawFixed>,
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
    #[serde(default)]
    pub(crate) loading: RawLoading,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawLoading {
    pub(crate) memory_mib: Option<Spanned<f64>>,
    pub(crate) ahead: Option<Spanned<f64>>,
    pub(crate) turn_ahead_deg: Option<Spanned<f64>>,
    pub(crate) watch_s: Option<Spanned<f64>>,
}

/// How a file's path may be given: as text alone, or as a table with more to say.
trait FromPath: Sized {
    const EXPECTING: &str;
    type Table: for<'de> Deserialize<'de>;
    fn path(path: &str) -> Self;
    fn table(table: Self::Table) -> Self;
}

fn text_or_table<'de, T: FromPath, D: serde::Deserializer<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    struct Either<T>(PhantomData<T>);
    impl<'de, T: FromPath> Visitor<'de> for Either<T> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str(T::EXPECTING)
        }

        fn visit_str<E: serde::de::Error>(self, path: &str) -> Result<T, E> {
            Ok(T::path(path))
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
            T::Table::deserialize(MapAccessDeserializer::new(map)).map(T::table)
        }
    }
    deserializer.deserialize_any(Either(PhantomData))
}

/// A solid of a file: its name, or its number from 1.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "expected the name or the number of a solid")]
pub(crate) enum RawSolid {
    Name(String),
    Number(u32),
}

impl RawSolid {
    pub(crate) fn to_text(&self) -> String {
        match self {
            Self::Name(name) => name.clone(),
            Self::Number(number) => number.to_string(),
        }
    }
}

/// A part: a mesh path alone, or a table with more to say.
#[derive(Debug, Clone, Default)]
pub(crate) struct RawPart {
    pub(crate) mesh: Option<String>,
    pub(crate) meshes: Option<Spanned<Vec<RawMesh>>>,
    pub(crate) solid: Option<RawSolid>,
    pub(crate) segments_per_turn: Option<Spanned<u32>>,
    pub(crate) name: Option<String>,
    pub(crate) position: Option<Spanned<[f64; 3]>>,
    pub(crate) rotation: Option<Spanned<[f64; 4]>>,
    pub(crate) table: Option<Spanned<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartTable {
    mesh: Option<String>,
    meshes: Option<Spanned<Vec<RawMesh>>>,
    solid: Option<RawSolid>,
    segments_per_turn: Option<Spanned<u32>>,
    name: Option<String>,
    position: Option<Spanned<[f64; 3]>>,
    rotation: Option<Spanned<[f64; 4]>>,
    table: Option<Spanned<String>>,
}

impl FromPath for RawPart {
    const EXPECTING: &str = "a mesh path, or a table with `mesh` (or `meshes`) and optionally \
                             `solid`, `segments_per_turn`, `name`, `position`, `rotation`, \
                             `table`";
    type Table = PartTable;

    fn path(mesh: &str) -> Self {
        Self {
            mesh: Some(mesh.to_owned()),
            ..Self::default()
        }
    }

    fn table(t: PartTable) -> Self {
        Self {
            mesh: t.mesh,
            meshes: t.meshes,
            solid: t.solid,
            segments_per_turn: t.segments_per_turn,
            name: t.name,
            position: t.position,
            rotation: t.rotation,
            table: t.table,
        }
    }
}

impl<'de> Deserialize<'de> for RawPart {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer)
    }
}

/// One mesh of a part that has several.
#[derive(Debug, Clone, Default)]
pub(crate) struct RawMesh {
    pub(crate) mesh: String,
    pub(crate) solid: Option<RawSolid>,
    pub(crate) segments_per_turn: Option<Spanned<u32>>,
    pub(crate) position: Option<Spanned<[f64; 3]>>,
    pub(crate) rotation: Option<Spanned<[f64; 4]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshTable {
    mesh: String,
    solid: Option<RawSolid>,
    segments_per_turn: Option<Spanned<u32>>,
    position: Option<Spanned<[f64; 3]>>,
    rotation: Option<Spanned<[f64; 4]>>,
}

impl FromPath for RawMesh {
    const EXPECTING: &str = "a mesh path, or a table with `mesh` and optionally `solid`, \
                             `segments_per_turn`, `position`, `rotation`";
    type Table = MeshTable;

    fn path(mesh: &str) -> Self {
        Self {
            mesh: mesh.to_owned(),
            ..Self::default()
        }
    }

    fn table(t: MeshTable) -> Self {
        Self {
            mesh: t.mesh,
            solid: t.solid,
            segments_per_turn: t.segments_per_turn,
            position: t.position,
            rotation: t.rotation,
        }
    }
}

impl<'de> Deserialize<'de> for RawMesh {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        text_or_table(deserializer)
    }
}

/// The parts that stay: one, or a list of them.
#[derive(Debug, Clone)]
pub(crate) struct RawFixed(pub(crate) Vec<Spanned<RawPart>>);

impl<'de> Deserialize<'de> for RawFixed {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PartsVisitor;
        impl<'de> Visitor<'de> for PartsVisitor {
            type Value = RawFixed;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "{}, or a list of such parts", RawPart::EXPECTING)
            }

            fn visit_str<E: serde::de::Error>(self, mesh: &str) -> Result<RawFixed, E> {
                Ok(RawFixed(vec![Spanned::new(0..0, RawPart::path(mesh))]))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<RawFixed, A::Error> {
                let table = PartTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(RawFixed(vec![Spanned::new(0..0, RawPart::table(table))]))
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
