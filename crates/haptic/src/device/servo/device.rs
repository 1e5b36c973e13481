//! A device on a servo thread, as the loop sees it.

use std::sync::PoisonError;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::Wrench;

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::device::servo::link::{Link, LoopEnd};

/// Longest wait for the device to confirm a stop.
const STOP_WAIT: Duration = Duration::from_millis(200);

/// Pause between two looks at whether it has.
const REST: Duration = Duration::from_micros(500);

/// Pause before trying to reach a device again that is gone.
const RETRY: Duration = Duration::from_millis(300);

/// A device as its servo thread has it. All calls come from that thread.
pub(crate) trait Servo: Send {
    /// Opens it (again) and makes it ready to push, without force; says what it can do.
    fn connect(&mut self) -> Result<DeviceSpec, DeviceError>;

    /// Exchanges wrenches and inputs by `link` until told to quit or until the device fails; on
    /// return the device is without force and closed.
    fn serve(&mut self, link: &mut Link) -> Result<(), DeviceError>;
}

/// A device on a servo thread.
pub(crate) struct ServoDevice {
    spec: DeviceSpec,
    end: LoopEnd,
    thread: Option<JoinHandle<()>>,
}

impl ServoDevice {
    /// Starts the thread, which connects, and waits until it has.
    pub(crate) fn spawn(servo: Box<dyn Servo>) -> Result<Self, DeviceError> {
        let (end, link) = Link::pair();
        let (first, connected) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("haptic-servo".into())
            .spawn(move || run(servo, link, &first))
            .map_err(|e| DeviceError::System {
                name: "servo thread".into(),
                reason: e.to_string(),
            })?;
        match connected.recv() {
            Ok(spec) => Ok(Self {
                spec: spec?,
                end,
                thread: Some(thread),
            }),
            // A thread that says nothing has panicked.
            Err(_) => Err(DeviceError::Disconnected),
        }
    }
}

/// Connects, serves, and connects again after a fault until told to quit.
fn run(
    mut servo: Box<dyn Servo>,
    mut link: Link,
    first: &SyncSender<Result<DeviceSpec, DeviceError>>,
) {
    let connected = servo.connect();
    let spec = connected.clone().ok();
    // Nobody waits any more only if the process ends.
    let _ = first.send(connected);
    let Some(spec) = spec else {
        return;
    };
    while let Err(fault) = servo.serve(&mut link) {
        link.lost(fault);
        if !reconnect(servo.as_mut(), &mut link, &spec) {
            return;
        }
        link.back();
    }
}

/// Tries until it works (true) or the device is dropped.
fn reconnect(servo: &mut dyn Servo, link: &mut Link, spec: &DeviceSpec) -> bool {
    while !link.quit() {
        let begin = Instant::now();
        match servo.connect() {
            Ok(found) if found == *spec => return true,
            Ok(other) => link.lost(DeviceError::Unsuitable {
                name: spec.name.clone(),
                expected: "the same device as before".into(),
                found: other.name,
            }),
            // What somebody has to do now; else why it went says more than that it is away.
            Err(fault @ DeviceError::NotReady { .. }) => link.lost(fault),
            Err(_) => {}
        }
        while begin.elapsed() < RETRY && !link.quit() {
            std::thread::sleep(REST);
        }
    }
    false
}

impl Device for ServoDevice {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let seen = self.end.seen.read();
        if !seen.connected {
            return Err(DeviceError::Disconnected);
        }
        let handle = seen.handle.ok_or(DeviceError::NoInput)?;
        Ok(DeviceState {
            pose: handle.pose,
            twist: handle.twist,
            buttons: handle.buttons,
            timestamp: now - seen.alive.elapsed().as_secs_f64(),
        })
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.end.mailbox.write(*wrench);
        match self.end.signals.gone.load(Ordering::Relaxed) {
            true => Err(DeviceError::Disconnected),
            false => Ok(()),
        }
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        let signals = &self.end.signals;
        self.end.mailbox.write(Wrench::ZERO);
        let asked = signals.stops_asked.fetch_add(1, Ordering::AcqRel) + 1;
        let begin = Instant::now();
        while signals.stops_done.load(Ordering::Acquire) != asked {
            if signals.gone.load(Ordering::Acquire) {
                return Err(DeviceError::Disconnected);
            }
            if begin.elapsed() > STOP_WAIT {
                return Err(DeviceError::System {
                    name: self.spec.name.clone(),
                    reason: format!("no stop within {STOP_WAIT:?}"),
                });
            }
            std::thread::sleep(REST);
        }
        Ok(())
    }

    fn last_fault(&self) -> Option<DeviceError> {
        let fault = self.end.signals.fault.lock();
        fault.unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for ServoDevice {
    fn drop(&mut self) {
        self.end.signals.quit.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // A servo that panicked has closed its device while unwinding.
            let _ = thread.join();
        }
    }
}
