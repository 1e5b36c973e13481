//! The device on its servo thread.

use crate::device::contract::{DeviceError, DeviceSpec};
use crate::device::openhaptics::api::Api;
use crate::device::openhaptics::opened::Opened;
use crate::device::openhaptics::options::PhantomOptions;
use crate::device::openhaptics::scheduled;
use crate::device::servo::device::Servo;
use crate::device::servo::link::Link;

/// A Touch or PHANTOM.
pub(super) struct Phantom {
    options: PhantomOptions,
    opened: Option<Opened>,
}

impl Phantom {
    pub(super) fn new(options: PhantomOptions) -> Self {
        Self {
            options,
            opened: None,
        }
    }
}

impl Servo for Phantom {
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError> {
        // The old one is closed first: it can be opened only once.
        self.opened = None;
        let api = Api::load(self.options.library.clone())?;
        let mut opened = Opened::new(api, &self.options)?;
        let spec = opened.describe().spec;
        opened.calibrate()?;
        opened.enable()?;
        self.opened = Some(opened);
        Ok(spec)
    }

    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError> {
        let opened = self.opened.take().ok_or(DeviceError::Disconnected)?;
        scheduled::serve(&opened, link)
    }
}
