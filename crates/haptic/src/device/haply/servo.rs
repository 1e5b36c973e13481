//! The device on its servo thread.

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::haply::opened::Opened;
use crate::device::haply::options::InverseOptions;
use crate::device::servo::device::Servo;
use crate::device::servo::link::Link;
use crate::device::servo::pull::pull;

/// An Inverse3.
pub(super) struct Inverse {
    options: InverseOptions,
    opened: Option<Opened>,
}

impl Inverse {
    pub(super) fn new(options: InverseOptions) -> Self {
        Self {
            options,
            opened: None,
        }
    }
}

impl Servo for Inverse {
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError> {
        self.opened = None;
        let (opened, spec) = Opened::new(&self.options)?;
        self.opened = Some(opened);
        Ok(spec)
    }

    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let mut opened = self.opened.take().ok_or(DeviceError::Disconnected)?;
        pull(link, |wrench| opened.exchange(wrench))
    }
}
