//! How a table stores energies.

use serde::{Deserialize, Serialize};

use crate::table::error::TableError;

/// How a table stores energies: in half precision, with a relative error of at most 4.9e-4.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "StorageKeys", try_from = "StorageKeys")]
pub struct Storage {
    /// Bricks of [`Storage::BRICK`]³ displacement nodes of a rotation node are left out where no
    /// energy differs from the far energy by more than this share of the largest probed energy.
    /// 0 leaves out nothing. 0 ..= 0.1.
    pub leave_out: f64,
}

/// The keys of a table's metadata.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StorageKeys {
    numbers: String,
    leave_out: f64,
}

impl From<Storage> for StorageKeys {
    fn from(storage: Storage) -> Self {
        Self {
            numbers: Storage::NUMBERS.into(),
            leave_out: storage.leave_out,
        }
    }
}

impl TryFrom<StorageKeys> for Storage {
    type Error = String;

    fn try_from(keys: StorageKeys) -> Result<Self, String> {
        match &*keys.numbers {
            Self::NUMBERS => Ok(Self {
                leave_out: keys.leave_out,
            }),
            found => Err(format!(
                "storage.numbers must be {}, found {found:?}: bake the table again with \
                 `pegfit bake SCENE -o TABLE`",
                Self::NUMBERS
            )),
        }
    }
}

impl Storage {
    /// Displacement nodes along each side of a brick.
    pub const BRICK: usize = 8;

    /// Zarr's name of the numbers that hold energies.
    const NUMBERS: &str = "float16";

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
