//! A SpaceNavigator on a USB bus: configfs gadget with the HID function, on `dummy_hcd`.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::os::unix::fs::symlink;
use std::path::Path;

use crate::models::compact;

const GADGET: &str = "/sys/kernel/config/usb_gadget/g1";

/// A USB device; dropping it unplugs it for good.
pub(crate) struct Gadget {
    reports: Option<File>,
}

impl Gadget {
    /// Describes the device; it is not plugged in yet.
    pub(crate) fn describe() -> std::io::Result<Self> {
        let root = Path::new(GADGET);
        let write = |name: &str, text: &[u8]| fs::write(root.join(name), text);
        fs::create_dir_all(root.join("strings/0x409"))?;
        for (name, text) in [
            ("idVendor", "0x046d"),
            ("idProduct", "0xc626"),
            ("bcdUSB", "0x0200"),
            ("strings/0x409/manufacturer", "3Dconnexion"),
            ("strings/0x409/product", "SpaceNavigator"),
            ("strings/0x409/serialnumber", "VM-USB"),
        ] {
            write(name, text.as_bytes())?;
        }
        fs::create_dir_all(root.join("configs/c.1"))?;
        fs::create_dir_all(root.join("functions/hid.usb0"))?;
        write("functions/hid.usb0/report_length", b"7")?;
        write("functions/hid.usb0/report_desc", &compact().descriptor)?;
        symlink(
            root.join("functions/hid.usb0"),
            root.join("configs/c.1/hid.usb0"),
        )?;
        Ok(Self { reports: None })
    }

    /// Plugs it in.
    pub(crate) fn plug(&mut self) -> std::io::Result<()> {
        fs::write(Path::new(GADGET).join("UDC"), "dummy_udc.0")?;
        self.reports = Some(OpenOptions::new().write(true).open("/dev/hidg0")?);
        Ok(())
    }

    /// Unplugs it.
    pub(crate) fn unplug(&mut self) -> std::io::Result<()> {
        self.reports = None;
        fs::write(Path::new(GADGET).join("UDC"), "\n")
    }

    /// Sends an input report; waits until the host has taken the one before. Nothing is sent while
    /// the host is still setting the device up.
    pub(crate) fn input(&mut self, report: &[u8; 7]) {
        if let Some(file) = &mut self.reports {
            let _ = file.write_all(report); // "endpoint shutdown" until it is set up
        }
    }
}
