//! How a table stores energies.

use serde::{Deserialize, Serialize};

use crate::table::error::TableError;
use crate::table::stencil::Code;

/// How a table stores energies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Storage {
    /// Kind of number.
    pub numbers: Numbers,
    /// Bricks of [`Storage::BRICK`]³ displacement nodes of a rotation node are left out where no
    /// energy differs from the far energy by more than this share of the largest probed energy.
    /// 0 leaves out nothing. 0 ..= 0.1.
    pub leave_out: f64,
}

/// Numbers that hold energies, two bytes each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Numbers {
    /// Half precision: a relative error of at most 4.9e-4 for every energy of a table.
    #[default]
    #[serde(rename = "float16")]
    Half,
    /// Whole numbers and one scale for each rotation node: an absolute error of at most 1.5e-5 of
    /// the rotation node's largest energy.
    #[serde(rename = "int16")]
    Integer,
}

impl Default for Storage {
    fn default() -> Self {
        Self {
            numbers: Numbers::Half,
            leave_out: 0.0,
        }
    }
}

impl Storage {
    /// Displacement nodes along each side of a brick.
    pub const BRICK: usize = 8;

    pub(crate) fn validate(&self) -> Result<(), TableError> {
        if (0.0..=0.1).contains(&self.leave_out) {
            return Ok(());
        }
        Err(TableError::Spec {
            name: "leave_out",
            expected: "in 0 ..= 0.1",
            found: self.leave_out.to_string(),
        })
    }
}

impl Numbers {
    pub(crate) fn code(self) -> Code {
        match self {
            Self::Half => Code::Half,
            Self::Integer => Code::Integer,
        }
    }
}
