//! HID devices of this machine. The only file that names hidapi.

use std::ffi::{CStr, CString};
use std::time::Duration;

use hidapi::{HidApi, HidDevice, HidError};
use serde::Serialize;

use crate::io_thread::{Cursor, Threaded};
use crate::pid::{self, PidSettings};
use crate::spacemouse::{self, Feel, SpaceMouse};
use crate::{Device, DeviceError};

/// Longest report descriptor the kernel keeps.
const DESCRIPTOR: usize = 4096;

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

/// What a HID device can be to this crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A 3Dconnexion device: six axes, no force.
    SpaceMouse,
    /// A USB HID PID device: pushes along its axes.
    ForceFeedback,
}

/// A device that is attached and usable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceInfo {
    /// Where the system has it, such as `/dev/hidraw3`.
    pub path: String,
    /// USB vendor id.
    pub vendor: u16,
    /// USB product id.
    pub product: u16,
    /// Serial number, empty if it has none.
    pub serial: String,
    /// Model.
    pub name: String,
    /// What it can be.
    pub kind: DeviceKind,
    /// Why it cannot be opened, if it cannot.
    pub problem: Option<String>,
}

/// The usable HID devices attached now. A device whose descriptor cannot be read, for want of
/// permission, is listed only if its ids are known.
///
/// # Errors
/// If the system's list cannot be read.
pub fn enumerate() -> Result<Vec<DeviceInfo>, DeviceError> {
    let api = HidApi::new().map_err(|e| system("HID devices", &e))?;
    let mut found: Vec<DeviceInfo> = Vec::new();
    for device in api.device_list() {
        let path = device.path().to_string_lossy().into_owned();
        if found.iter().any(|f| f.path == path) {
            continue;
        }
        let opened = api.open_path(device.path());
        let ids = (device.vendor_id(), device.product_id());
        let mouse = spacemouse::model(ids.0, ids.1);
        let kind = match (&mouse, &opened) {
            (Some(_), _) => DeviceKind::SpaceMouse,
            (None, Ok(open)) if pushes(open) => DeviceKind::ForceFeedback,
            _ => continue,
        };
        found.push(DeviceInfo {
            path,
            vendor: ids.0,
            product: ids.1,
            serial: device.serial_number().unwrap_or_default().to_owned(),
            name: mouse
                .or(device.product_string())
                .unwrap_or("unnamed")
                .to_owned(),
            kind,
            problem: opened.err().map(|e| e.to_string()),
        });
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

fn pushes(device: &HidDevice) -> bool {
    descriptor_of(device).is_ok_and(|d| pid::PidLayout::parse("", &d).is_ok())
}

/// Opens an attached device as the loop wants it.
///
/// # Errors
/// If it is gone, may not be opened, or is not what it was listed as.
pub fn open(info: &DeviceInfo) -> Result<Box<dyn Device>, DeviceError> {
    let device = match info.kind {
        DeviceKind::SpaceMouse => Threaded::spawn(
            spacemouse::spec(&info.name),
            Cursor::default(),
            Box::new(SpaceMouse::new(connector(info), Feel::default())),
            None,
        )?,
        DeviceKind::ForceFeedback => pid::open(
            &info.name,
            connector(info),
            connector(info),
            PidSettings::default(),
        )?,
    };
    Ok(Box::new(device))
}

/// Finds the same device again wherever the system has it now: by serial number if it has one, else
/// by path, else by ids alone.
pub fn connector(info: &DeviceInfo) -> Connector {
    let info = info.clone();
    Box::new(move || {
        let api = HidApi::new().map_err(|e| system(&info.name, &e))?;
        let same = |d: &&hidapi::DeviceInfo| {
            (d.vendor_id(), d.product_id()) == (info.vendor, info.product)
                && d.serial_number().unwrap_or_default() == info.serial
        };
        let by_path = api
            .device_list()
            .filter(same)
            .find(|d| d.path().to_string_lossy() == info.path);
        let path: CString = by_path
            .or_else(|| api.device_list().find(same))
            .map(|d| d.path().to_owned())
            .ok_or(DeviceError::Disconnected)?;
        Ok(Box::new(open_path(&api, &path, &info.name)?) as Box<dyn HidPort>)
    })
}

fn open_path(api: &HidApi, path: &CStr, name: &str) -> Result<Port, DeviceError> {
    let device = api.open_path(path).map_err(|e| system(name, &e))?;
    Ok(Port {
        device,
        name: name.to_owned(),
    })
}

fn system(name: &str, error: &HidError) -> DeviceError {
    DeviceError::System {
        name: name.to_owned(),
        reason: error.to_string(),
    }
}

fn descriptor_of(device: &HidDevice) -> Result<Vec<u8>, HidError> {
    let mut buffer = vec![0; DESCRIPTOR];
    let length = device.get_report_descriptor(&mut buffer)?;
    buffer.truncate(length);
    Ok(buffer)
}

struct Port {
    device: HidDevice,
    name: String,
}

impl HidPort for Port {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> Result<usize, DeviceError> {
        let millis = i32::try_from(timeout.as_millis()).unwrap_or(i32::MAX);
        self.device
            .read_timeout(buffer, millis)
            .map_err(|e| system(&self.name, &e))
    }

    fn write(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        let written = self.device.write(report);
        written.map(drop).map_err(|e| system(&self.name, &e))
    }

    fn set_feature(&mut self, report: &[u8]) -> Result<(), DeviceError> {
        let sent = self.device.send_feature_report(report);
        sent.map_err(|e| system(&self.name, &e))
    }

    fn get_feature(&mut self, report: &mut [u8]) -> Result<usize, DeviceError> {
        let got = self.device.get_feature_report(report);
        got.map_err(|e| system(&self.name, &e))
    }

    fn descriptor(&mut self) -> Result<Vec<u8>, DeviceError> {
        descriptor_of(&self.device).map_err(|e| system(&self.name, &e))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_without_devices_lists_none_and_a_missing_one_is_disconnected() {
        // What is attached differs; that the list can be read does not.
        let found = enumerate().unwrap();
        assert!(found.iter().all(|d| !d.path.is_empty()));
        let gone = DeviceInfo {
            path: "/dev/hidraw999".into(),
            vendor: 0xffff,
            product: 0xffff,
            serial: String::new(),
            name: "nothing".into(),
            kind: DeviceKind::SpaceMouse,
            problem: None,
        };
        assert!(matches!(open(&gone), Err(DeviceError::Disconnected)));
    }
}
