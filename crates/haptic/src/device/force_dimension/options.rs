//! Which device, and by which library.

use std::path::PathBuf;

use crate::device::force_dimension::api::WANTED;

/// Which device, and by which library.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DhdOptions {
    /// Place in the library's list, from 0; it lists devices that other programs hold too.
    pub index: u8,
    /// Serial number that the device there must have; `None` takes any.
    pub serial: Option<u16>,
    /// File of the library; `None` for the installed one.
    pub library: Option<PathBuf>,
}

impl DhdOptions {
    /// The first device, by the library that `PEGFIT_LIBDHD` names, else the installed one.
    pub fn of_system() -> Self {
        Self {
            library: WANTED.named(),
            ..Self::default()
        }
    }
}
