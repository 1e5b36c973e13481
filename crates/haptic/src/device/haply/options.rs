//! Which device, and where its service listens.

use std::net::{Ipv4Addr, SocketAddr};

use crate::device::contract::DeviceError;

/// Where the service listens by default.
const PORT: u16 = 10001;

/// Environment variable that names another address.
pub(super) const VARIABLE: &str = "PEGFIT_HAPLY";

/// Which device, and where its service listens.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InverseOptions {
    /// Address of the service's WebSocket.
    pub address: SocketAddr,
    /// The service's id of the device, such as `049D`; `None` for the first.
    pub id: Option<String>,
}

impl Default for InverseOptions {
    fn default() -> Self {
        Self {
            address: (Ipv4Addr::LOCALHOST, PORT).into(),
            id: None,
        }
    }
}

impl InverseOptions {
    /// The device of this id, at the address that `PEGFIT_HAPLY` names, else the service's own.
    ///
    /// # Errors
    /// If `PEGFIT_HAPLY` is set to something that is no address.
    pub fn of_system(id: Option<&str>) -> Result<Self, DeviceError> {
        let default = Self {
            id: id.map(str::to_owned),
            ..Self::default()
        };
        let named = std::env::var_os(VARIABLE).filter(|text| !text.is_empty());
        let Some(named) = named else {
            return Ok(default);
        };
        let text = named.to_string_lossy();
        match text.parse() {
            Ok(address) => Ok(Self { address, ..default }),
            Err(_) => Err(DeviceError::Unsuitable {
                name: VARIABLE.into(),
                expected: "an address and port, such as 127.0.0.1:10001".into(),
                found: text.into_owned(),
            }),
        }
    }
}
