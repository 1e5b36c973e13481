//! The port of a HID device, and the reading half that all of them share.

use std::time::{Duration, Instant};

use crate::device::contract::DeviceError;
use crate::device::threaded::{InputHalf, Reading};

/// Longest input report read, bytes.
const LONGEST: usize = 1024;

/// An open HID device. Reports begin with their id, zero where a device has none.
pub trait HidPort: Send {
    /// Waits for an input report, `timeout` at most; gives its length, zero if none came.
    ///
    /// # Errors
    /// If the device is gone.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, DeviceError>;

    /// Sends an output report.
    ///
    /// # Errors
    /// If the device is gone.
    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError>;

    /// Sends a feature report.
    ///
    /// # Errors
    /// If the device is gone or refuses it.
    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError>;

    /// Asks for the feature report whose id is `report[0]`; gives its length.
    ///
    /// # Errors
    /// If the device is gone or has no such report.
    fn get_feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError>;

    /// The report descriptor.
    ///
    /// # Errors
    /// If the device is gone.
    fn descriptor(&mut self) -> Result<Vec<u8>, DeviceError>;
}

/// Opens a device, each time anew.
pub type Connector = Box<dyn FnMut() -> Result<Box<dyn HidPort>, DeviceError> + Send>;

/// What the input reports of a kind of device mean.
pub trait Decoder: Send {
    /// Starts afresh with a device that was just opened.
    ///
    /// # Errors
    /// If the device cannot be understood.
    fn start(&mut self, port: &mut dyn HidPort) -> Result<(), DeviceError>;

    /// What the reports so far, this one last, add up to; `None` if this one says nothing. Any
    /// bytes will do: a report too short or unknown says nothing.
    fn decode(&mut self, report: &[u8]) -> Option<Reading>;

    /// What it means that no report came for so long, if anything.
    fn silence(&mut self, lasting: Duration) -> Option<Reading>;
}

/// The reading half of a HID device.
pub struct HidInput<D> {
    connector: Connector,
    decoder: D,
    port: Option<Box<dyn HidPort>>,
    heard: Instant,
}

impl<D: Decoder> HidInput<D> {
    /// Reads the device that `connector` opens.
    pub fn new(connector: Connector, decoder: D) -> Self {
        Self {
            connector,
            decoder,
            port: None,
            heard: Instant::now(),
        }
    }
}

impl<D: Decoder> InputHalf for HidInput<D> {
    fn connect(&mut self) -> Result<(), DeviceError> {
        // The old one is closed first: some devices can be opened only once.
        self.port = None;
        let mut port = (self.connector)()?;
        self.decoder.start(port.as_mut())?;
        self.port = Some(port);
        self.heard = Instant::now();
        Ok(())
    }

    fn read(&mut self, timeout: Duration) -> Result<Option<Reading>, DeviceError> {
        let port = self.port.as_mut().ok_or(DeviceError::Disconnected)?;
        let mut buffer = [0; LONGEST];
        let length = port.read(&mut buffer, timeout)?;
        if length == 0 {
            return Ok(self.decoder.silence(self.heard.elapsed()));
        }
        self.heard = Instant::now();
        Ok(self.decoder.decode(&buffer[..length]))
    }
}
