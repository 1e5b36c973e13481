//! The device on its servo thread.

use std::sync::Arc;

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::force_dimension::api::Api;
use crate::device::force_dimension::opened::Opened;
use crate::device::force_dimension::options::DhdOptions;
use crate::device::servo::device::Servo;
use crate::device::servo::link::Link;
use crate::device::servo::pull::pull;

/// A Force Dimension device or a Falcon.
pub(super) struct Arm {
    options: DhdOptions,
    opened: Option<Opened>,
}

impl Arm {
    pub(super) fn new(options: DhdOptions) -> Self {
        Self {
            options,
            opened: None,
        }
    }
}

impl Servo for Arm {
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError> {
        // The old one is closed first: it can be opened only once.
        self.opened = None;
        let api = Api::load(self.options.library.clone())?;
        let opened = Opened::new(Arc::new(api), self.options.index)?;
        let spec = opened.spec();
        if let Some(wanted) = self.options.serial
            && opened.serial() != Some(wanted)
        {
            return Err(DeviceError::Unsuitable {
                name: spec.name,
                expected: format!("serial number {wanted}"),
                found: format!("{:?}", opened.serial()),
            });
        }
        opened.ready()?;
        opened.enable()?;
        self.opened = Some(opened);
        Ok(spec)
    }

    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let opened = self.opened.take().ok_or(DeviceError::Disconnected)?;
        pull(link, |wrench| opened.exchange(wrench))
    }
}
