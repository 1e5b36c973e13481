//! Units of length that files come in.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::mesh::error::MeshError;

/// The unit of a file's coordinates. Written as `m`, `mm`, `cm`, `um`, `inch` or `foot`.
///
/// ```
/// use sdf_grid::LengthUnit;
///
/// let unit: LengthUnit = "inch".parse()?;
/// assert_eq!(unit.in_metres(), 0.0254);
/// assert_eq!(LengthUnit::default().name(), "mm");
/// assert!("parsec".parse::<LengthUnit>().is_err());
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    /// Metre.
    M,
    /// Centimetre.
    Cm,
    /// Millimetre, which CAD programs export most.
    #[default]
    Mm,
    /// Micrometre.
    Um,
    /// Inch, 25.4 mm.
    #[serde(alias = "in")]
    Inch,
    /// Foot, 304.8 mm.
    #[serde(alias = "ft")]
    Foot,
}

impl LengthUnit {
    /// One of the unit, in metres.
    pub fn in_metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 1e-2,
            Self::Mm => 1e-3,
            Self::Um => 1e-6,
            Self::Inch => 0.0254,
            Self::Foot => 0.3048,
        }
    }

    /// The name it is written by.
    pub fn name(self) -> &'static str {
        match self {
            Self::M => "m",
            Self::Cm => "cm",
            Self::Mm => "mm",
            Self::Um => "um",
            Self::Inch => "inch",
            Self::Foot => "foot",
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for LengthUnit {
    type Err = MeshError;

    fn from_str(name: &str) -> Result<Self, MeshError> {
        match name {
            "m" => Ok(Self::M),
            "cm" => Ok(Self::Cm),
            "mm" => Ok(Self::Mm),
            "um" => Ok(Self::Um),
            "inch" | "in" => Ok(Self::Inch),
            "foot" | "ft" => Ok(Self::Foot),
            _ => Err(MeshError::Unit {
                expected: "m, cm, mm, um, inch, foot",
                found: name.to_owned(),
            }),
        }
    }
}
