//! What a user should know of a scene that can be used all the same.

use std::fmt;
use std::path::PathBuf;

use sdf_grid::LengthUnit;

/// What a user should know of a scene that can be used all the same.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneWarning {
    /// What had to be repaired in a mesh, in words.
    Mesh(String),
    /// The parts differ in size as if they were in different units.
    Scale {
        /// The fixed part's name.
        fixed: String,
        /// Its diagonal, metres.
        fixed_diagonal: f64,
        /// The moving part's name.
        moving: String,
        /// Its diagonal, metres.
        moving_diagonal: f64,
        /// The scene's unit.
        unit: LengthUnit,
    },
    /// Fields are not kept, and computed again by each run; why, in words.
    NoCache(String),
    /// The table was baked with another energy scale than the scene's; the table's counts.
    EnergyScale {
        /// The table.
        table: PathBuf,
    },
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(said) => f.write_str(said),
            Self::NoCache(said) => write!(f, "{said}; fields are computed again by each run"),
            Self::Scale {
                fixed,
                fixed_diagonal,
                moving,
                moving_diagonal,
                unit,
            } => {
                let metre = unit.in_metres();
                write!(
                    f,
                    "{fixed} is {:.4} {unit} across and {moving} is {:.4} {unit}: are both in \
                     {unit}?",
                    fixed_diagonal / metre,
                    moving_diagonal / metre
                )
            }
            Self::EnergyScale { table } => write!(
                f,
                "{} was baked with another energy scale than the scene's; the table's counts",
                table.display()
            ),
        }
    }
}
