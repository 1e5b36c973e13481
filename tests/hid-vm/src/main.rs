//! Checks of `haptic` against the HID stack of a real kernel, run as root in a virtual machine.
//!
//! `hid-vm uhid` plugs in devices through `/dev/uhid`; `hid-vm usb` plugs one into a USB host
//! controller through `dummy_hcd`; `hid-vm hold NAME FILE` only keeps a device plugged in until
//! FILE appears, for the programs beside it. Each check prints one line; the exit status says
//! whether all held.

mod checks;
mod gadget;
mod hold;
mod models;
mod uhid;

use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words.as_slice() {
        ["uhid"] => checks::all(&checks::UHID),
        ["usb"] => checks::all(&checks::USB),
        ["hold", name, release] => hold::hold(name, release.as_ref()),
        _ => {
            println!("usage: hid-vm uhid | usb | hold compact|joystick|both FILE");
            ExitCode::from(2)
        }
    }
}
