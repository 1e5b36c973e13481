//! The HID devices of this machine. The only file that names hidapi.

use std::collections::BTreeMap;
use std::ffi::CString;
use std::fs::OpenOptions;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

use crate::device::contract::{Device, DeviceError};
use crate::device::hid::pid;
use crate::device::hid::pid::PidLayout;
use crate::device::hid::pid::PidSettings;
use crate::device::hid::port::{Connector, HidInput, HidPort};
use crate::device::hid::spacemouse;
use crate::device::hid::spacemouse::{SpaceMouse, SpaceMouseSettings};
use crate::device::info::{Access, DeviceInfo, DeviceKind, UsbIds};
use crate::device::text::printable;
use crate::device::threaded::Cursor;
use crate::device::threaded::ThreadedDevice;
use hidapi::{HidApi, HidDevice, HidError};

/// Longest report descriptor the kernel keeps.
const DESCRIPTOR: usize = 4096;

/// The usable HID devices attached now, by path. A device that may not be opened is listed too.
///
/// # Errors
/// If the system's list cannot be read.
pub fn enumerate() -> Result<Vec<DeviceInfo>, DeviceError> {
    let api = HidApi::new().map_err(|e| system("HID devices", &e))?;
    // The system lists a device once per usage.
    let mut usages: BTreeMap<String, Vec<(u16, u16)>> = BTreeMap::new();
    for device in api.device_list() {
        let path = device.path().to_string_lossy().into_owned();
        let usage = (device.usage_page(), device.usage());
        usages.entry(path).or_default().push(usage);
    }
    let found = usages.iter().filter_map(|(path, usages)| {
        let device = api
            .device_list()
            .find(|d| d.path().to_string_lossy() == *path)?;
        describe(path, device, usages)
    });
    Ok(found.collect())
}

/// What a device can be, `None` if nothing here.
fn describe(path: &str, device: &hidapi::DeviceInfo, usages: &[(u16, u16)]) -> Option<DeviceInfo> {
    let (vendor, product) = (device.vendor_id(), device.product_id());
    let product_name = device.product_string().map(printable);
    let product_name = product_name.as_deref().filter(|n| !n.trim().is_empty());
    let (kind, name, spec) = match spacemouse::recognise(vendor, product, usages) {
        Some(model) => {
            let name = model.or(product_name).unwrap_or("3Dconnexion device");
            (DeviceKind::SpaceMouse, name, spacemouse::spec(name))
        }
        None => {
            let name = product_name.unwrap_or("unnamed");
            let layout = PidLayout::parse(name, &descriptor_at(path)?).ok()?;
            let spec = layout.spec(name, &PidSettings::default());
            (DeviceKind::ForceFeedback, name, spec)
        }
    };
    Some(DeviceInfo {
        path: path.to_owned(),
        usb: Some(UsbIds { vendor, product }),
        serial: serial(device),
        name: name.to_owned(),
        kind,
        spec,
        access: access(path),
    })
}

/// Its serial number as it is shown and typed, empty if it has none.
fn serial(device: &hidapi::DeviceInfo) -> String {
    device.serial_number().map(printable).unwrap_or_default()
}

fn access(path: &str) -> Access {
    match OpenOptions::new().read(true).write(true).open(path) {
        Ok(_) => Access::Ready,
        Err(e) if e.kind() == ErrorKind::PermissionDenied => Access::Denied,
        Err(e) => Access::Failed(e.to_string()),
    }
}

/// The report descriptor as the system has it: for that a device need not be opened.
fn descriptor_at(path: &str) -> Option<Vec<u8>> {
    let name = Path::new(path).file_name()?;
    let node = Path::new("/sys/class/hidraw").join(name);
    std::fs::read(node.join("device/report_descriptor")).ok()
}

/// Opens an attached device as the loop wants it, with default settings.
///
/// # Errors
/// If it is gone, may not be opened, or is not what it was listed as.
pub fn open(info: &DeviceInfo) -> Result<Box<dyn Device>, DeviceError> {
    open_with(info, SpaceMouseSettings::default(), PidSettings::default())
}

/// Opens an attached device as the loop wants it; of the settings, those of its kind count.
///
/// # Errors
/// If it is gone, may not be opened, or is not what it was listed as.
pub fn open_with(
    info: &DeviceInfo,
    feel: SpaceMouseSettings,
    settings: PidSettings,
) -> Result<Box<dyn Device>, DeviceError> {
    let device = match info.kind {
        DeviceKind::SpaceMouse => ThreadedDevice::spawn(
            spacemouse::spec(&info.name),
            Cursor::default(),
            Box::new(HidInput::new(connector(info), SpaceMouse::new(feel))),
            None,
        )?,
        DeviceKind::ForceFeedback => {
            pid::open(&info.name, connector(info), connector(info), settings)?
        }
        other => {
            return Err(DeviceError::Unsuitable {
                name: info.name.clone(),
                expected: "a HID device".into(),
                found: format!("a device of {}", other.maker()),
            });
        }
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
            let ids = UsbIds {
                vendor: d.vendor_id(),
                product: d.product_id(),
            };
            info.usb == Some(ids) && serial(d) == info.serial
        };
        let by_path = api
            .device_list()
            .filter(same)
            .find(|d| d.path().to_string_lossy() == info.path);
        let path: CString = by_path
            .or_else(|| api.device_list().find(same))
            .map(|d| d.path().to_owned())
            .ok_or(DeviceError::Disconnected)?;
        let device = api.open_path(&path).map_err(|e| system(&info.name, &e))?;
        Ok(Box::new(Port {
            device,
            name: info.name.clone(),
        }) as Box<dyn HidPort>)
    })
}

fn system(name: &str, error: &HidError) -> DeviceError {
    DeviceError::System {
        name: name.to_owned(),
        reason: error.to_string(),
    }
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
        let mut buffer = vec![0; DESCRIPTOR];
        let length = self.device.get_report_descriptor(&mut buffer);
        buffer.truncate(length.map_err(|e| system(&self.name, &e))?);
        Ok(buffer)
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
            usb: Some(UsbIds {
                vendor: 0xffff,
                product: 0xffff,
            }),
            serial: String::new(),
            name: "nothing".into(),
            kind: DeviceKind::SpaceMouse,
            spec: spacemouse::spec("nothing"),
            access: Access::Ready,
        };
        assert!(matches!(open(&gone), Err(DeviceError::Disconnected)));
        assert!(matches!(access(&gone.path), Access::Failed(_)));
    }
}
