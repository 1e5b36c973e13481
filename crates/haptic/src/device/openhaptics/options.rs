//! Which device, and by which library.

use std::ffi::CString;
use std::path::PathBuf;

use crate::device::contract::DeviceError;
use crate::device::openhaptics::api::WANTED;

/// Which device, and by which library.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PhantomOptions {
    /// The name that the maker's setup program gave it; `None` for the default device.
    pub name: Option<String>,
    /// File of the library; `None` for the installed one.
    pub library: Option<PathBuf>,
}

impl PhantomOptions {
    /// The device of this name, by the library that `PEGFIT_LIBHD` names, else the installed one.
    pub fn of_system(name: Option<&str>) -> Self {
        Self {
            name: name.map(str::to_owned),
            library: WANTED.named(),
        }
    }

    /// What the driver calls it.
    pub(super) fn called(&self) -> &str {
        self.name.as_deref().unwrap_or("Default Device")
    }

    /// The same for the driver; `None` stands for the default.
    pub(super) fn c_name(&self) -> Result<Option<CString>, DeviceError> {
        let name = self.name.as_deref().map(CString::new).transpose();
        name.map_err(|_| DeviceError::Unsuitable {
            name: self.called().to_owned(),
            expected: "a name without zero bytes".into(),
            found: "one".into(),
        })
    }
}
