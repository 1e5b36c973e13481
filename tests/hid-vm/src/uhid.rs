//! A HID device of this program's own, through `/dev/uhid`: the kernel treats it as one on a bus.
//!
//! Events are those of `linux/uhid.h`: a packed `u32` type and a union of 4376 bytes.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::os::fd::AsRawFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// Bytes of an event.
const EVENT: usize = 4380;

const DESTROY: u32 = 1;
const OUTPUT: u32 = 6;
const GET_REPORT: u32 = 9;
const GET_REPORT_REPLY: u32 = 10;
const CREATE2: u32 = 11;
const INPUT2: u32 = 12;
const SET_REPORT: u32 = 13;
const SET_REPORT_REPLY: u32 = 14;

/// `BUS_USB` of `linux/input.h`.
const BUS_USB: u16 = 3;

/// What a device does when it is asked and told.
pub(crate) trait Firmware: Send {
    /// An output or feature report came.
    fn told(&mut self, report: &[u8]);
    /// The feature report with this id is wanted.
    fn asked(&mut self, id: u8) -> Vec<u8>;
}

/// Who the device says it is.
#[derive(Clone)]
pub(crate) struct Identity {
    pub(crate) name: &'static str,
    pub(crate) serial: &'static str,
    pub(crate) vendor: u16,
    pub(crate) product: u16,
    pub(crate) descriptor: Vec<u8>,
}

/// A plugged-in device; dropping it unplugs it.
pub(crate) struct Virtual {
    file: Arc<Mutex<File>>,
    quit: Arc<AtomicBool>,
    service: Option<JoinHandle<()>>,
}

impl Virtual {
    pub(crate) fn plug(identity: &Identity, firmware: Arc<Mutex<dyn Firmware>>) -> Self {
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .open("/dev/uhid")
            .expect("/dev/uhid");
        file.write_all(&create(identity)).expect("create");
        let reader = file.try_clone().expect("second handle");
        let file = Arc::new(Mutex::new(file));
        let quit = Arc::new(AtomicBool::new(false));
        let (replies, stop) = (Arc::clone(&file), Arc::clone(&quit));
        let service = std::thread::spawn(move || serve(reader, &replies, &stop, &firmware));
        Self {
            file,
            quit,
            service: Some(service),
        }
    }

    /// Sends an input report.
    pub(crate) fn input(&self, report: &[u8]) {
        let mut event = INPUT2.to_ne_bytes().to_vec();
        event.extend((report.len() as u16).to_ne_bytes());
        event.extend(report);
        let mut file = self.file.lock().expect("file");
        file.write_all(&event).expect("input");
    }
}

impl Drop for Virtual {
    fn drop(&mut self) {
        self.quit.store(true, Ordering::Release);
        if let Some(service) = self.service.take() {
            let _ = service.join();
        }
        let mut file = self.file.lock().expect("file");
        let _ = file.write_all(&DESTROY.to_ne_bytes());
    }
}

fn create(identity: &Identity) -> Vec<u8> {
    let mut event = vec![0; EVENT];
    let mut put = |at: usize, bytes: &[u8]| event[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &CREATE2.to_ne_bytes());
    put(4, identity.name.as_bytes()); // name[128], phys[64]
    put(196, identity.serial.as_bytes()); // uniq[64]
    put(260, &(identity.descriptor.len() as u16).to_ne_bytes());
    put(262, &BUS_USB.to_ne_bytes());
    put(264, &u32::from(identity.vendor).to_ne_bytes());
    put(268, &u32::from(identity.product).to_ne_bytes());
    put(272, &1u32.to_ne_bytes()); // version; country stays 0
    put(280, &identity.descriptor);
    event
}

fn serve(
    mut reader: File,
    replies: &Mutex<File>,
    quit: &AtomicBool,
    firmware: &Mutex<dyn Firmware>,
) {
    let mut event = vec![0; EVENT];
    while !quit.load(Ordering::Acquire) {
        if !readable(&reader) {
            continue;
        }
        let Ok(_) = reader.read(&mut event) else {
            return;
        };
        let u32_at = |at: usize| u32::from_ne_bytes(event[at..at + 4].try_into().expect("4"));
        let u16_at = |at: usize| u16::from_ne_bytes(event[at..at + 2].try_into().expect("2"));
        let mut firmware = firmware.lock().expect("firmware");
        let reply = match u32_at(0) {
            // data[4096], size
            OUTPUT => {
                firmware.told(&event[4..4 + usize::from(u16_at(4100))]);
                continue;
            }
            // id, report number, report type
            GET_REPORT => {
                let data = firmware.asked(event[8]);
                let mut reply = GET_REPORT_REPLY.to_ne_bytes().to_vec();
                reply.extend(u32_at(4).to_ne_bytes());
                reply.extend(0u16.to_ne_bytes());
                reply.extend((data.len() as u16).to_ne_bytes());
                reply.extend(data);
                reply
            }
            // id, report number, report type, size, data
            SET_REPORT => {
                firmware.told(&event[12..12 + usize::from(u16_at(10))]);
                let mut reply = SET_REPORT_REPLY.to_ne_bytes().to_vec();
                reply.extend(u32_at(4).to_ne_bytes());
                reply.extend(0u16.to_ne_bytes());
                reply
            }
            _ => continue,
        };
        drop(firmware);
        let _ = replies.lock().expect("file").write_all(&reply);
    }
}

/// Waits a moment for an event.
fn readable(file: &File) -> bool {
    let mut poll = libc::pollfd {
        fd: file.as_raw_fd(),
        events: libc::POLLIN,
        revents: 0,
    };
    // SAFETY: one valid pollfd, as the count says.
    unsafe { libc::poll(&raw mut poll, 1, 20) > 0 }
}
