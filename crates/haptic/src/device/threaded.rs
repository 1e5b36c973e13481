//! Devices on threads of their own, so that the loop never waits for one.
//!
//! The loop leaves the newest wrench in a mailbox and finds the newest input in another. One thread
//! serves a device that exchanges a wrench for an input in one call (`OpenDevice`, the makers'
//! drivers); two threads serve one whose input and output block separately ([`InputHalf`] and
//! [`OutputHalf`], USB HID: a write can take ten milliseconds).
//!
//! Every wrench passes the `Outlet`, which ends the force when the loop says stop or falls
//! silent, and lets it rise again after the device was away.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};

/// Longest wait for the device to confirm a stop.
const STOP_WAIT: Duration = Duration::from_millis(200);

/// Pause between two checks of a signal, and of the output thread while there is nothing new.
const REST: Duration = Duration::from_micros(500);

/// Pause before trying to reach a device again that is gone.
const RETRY: Duration = Duration::from_millis(300);

/// Longest wait for input before the input thread shows that it is alive.
const READ_TIMEOUT: Duration = Duration::from_millis(5);

/// Time from one exchange to the next: half a tick of the loop.
const EXCHANGE_PERIOD: Duration = Duration::from_micros(500);

/// Seconds in which the force rises to full strength after the device was away, had taken it away
/// by itself, or had lost the loop.
const RAMP: f64 = 0.5;

/// The motion of a handle, device frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// The handle's pose.
    Position {
        /// Metres and a unit quaternion.
        pose: Pose,
        /// rad/s and m/s; zero where the device does not measure it.
        twist: Twist,
    },
    /// The velocity at which the cursor should move, rad/s and m/s.
    Rate(Twist),
}

/// One input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Pose or rate.
    pub motion: Motion,
    /// Bit `i` is set while button `i` is held.
    pub buttons: u32,
}

/// The half of a device that is read.
pub trait InputHalf: Send {
    /// Opens it (again).
    ///
    /// # Errors
    /// If it is not there or the system refuses.
    fn connect(&mut self) -> Result<(), DeviceError>;

    /// Waits for input, `timeout` at most; `None` if there was none.
    ///
    /// # Errors
    /// If the device is gone; [`InputHalf::connect`] is tried then.
    fn read(&mut self, timeout: Duration) -> Result<Option<Reading>, DeviceError>;
}

/// The half of a device that is written.
pub trait OutputHalf: Send {
    /// Opens it (again) and makes it ready to push.
    ///
    /// # Errors
    /// If it is not there or the system refuses.
    fn connect(&mut self) -> Result<(), DeviceError>;

    /// Pushes with `wrench` from now on.
    ///
    /// # Errors
    /// If the device is gone; [`OutputHalf::connect`] is tried then.
    fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError>;

    /// Takes every force away.
    ///
    /// # Errors
    /// If the command could not be sent.
    fn stop_all(&mut self) -> Result<(), DeviceError>;
}

/// A device's answer to a wrench.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Exchange {
    /// The handle; `None` while the device does not know.
    pub(crate) reading: Option<Reading>,
    /// Why the device took the force away by itself, if it did: too much of it, or warm motors.
    /// The force rises anew from nothing.
    pub(crate) refused: Option<DeviceError>,
}

/// A device that is open on its own thread. Dropping it takes its force away and closes it.
pub(crate) trait OpenDevice: Sized {
    /// Pushes with `wrench` from now on and reads the handle.
    fn exchange(&mut self, wrench: &Wrench) -> Result<Exchange, DeviceError>;

    /// Exchanges by `link` until the device is dropped, the last time without force, or until the
    /// device fails.
    fn serve(mut self, link: &mut Link) -> Result<(), DeviceError> {
        loop {
            let begin = Instant::now();
            let last = link.must_quit();
            link.exchange(|wrench| self.exchange(wrench))?;
            if last {
                return Ok(());
            }
            std::thread::sleep(EXCHANGE_PERIOD.saturating_sub(begin.elapsed()));
        }
    }
}

/// The newest state of the input.
#[derive(Debug, Clone)]
struct InputState {
    reading: Option<Reading>,
    connected: bool,
    alive: Instant,
}

impl InputState {
    fn new(reading: Option<Reading>, connected: bool) -> Self {
        Self {
            reading,
            connected,
            alive: Instant::now(),
        }
    }
}

/// Shared by the loop and the device's threads.
#[derive(Debug, Default)]
struct Signals {
    quit: AtomicBool,
    /// The output is disconnected.
    gone: AtomicBool,
    stops_asked: AtomicU32,
    stops_done: AtomicU32,
    /// Locked by the pushing thread in a fault, and by [`Device::last_fault`].
    fault: Mutex<Option<DeviceError>>,
}

impl Signals {
    fn must_quit(&self) -> bool {
        self.quit.load(Ordering::Acquire)
    }

    /// Attempts until one succeeds (true) or the device is dropped.
    fn retry(&self, mut attempt: impl FnMut() -> bool) -> bool {
        while !self.must_quit() {
            if attempt() {
                return true;
            }
            let begin = Instant::now();
            while begin.elapsed() < RETRY && !self.must_quit() {
                std::thread::sleep(REST);
            }
        }
        false
    }
}

/// When the loop counts as silent: after twice its last pause, within these bounds.
#[derive(Debug, Clone, Copy)]
struct Watchdog {
    least: Duration,
    greatest: Duration,
    /// Whether the force rises slowly when the loop is heard again.
    ramp: bool,
}

/// Of devices that exchange on one thread.
const EXCHANGE_WATCHDOG: Watchdog = Watchdog {
    least: Duration::from_millis(12),
    greatest: Duration::from_millis(50),
    ramp: true,
};

/// Of devices whose output may block.
const OUTPUT_WATCHDOG: Watchdog = Watchdog {
    least: Duration::from_millis(50),
    greatest: Duration::from_millis(50),
    ramp: false,
};

/// The state of the loop, judged by its wrenches.
#[derive(Debug, Clone, Copy, PartialEq)]
enum LoopState {
    /// Nothing since the start or a stop.
    Idle,
    /// Sends; counts as silent if nothing comes for `patience`.
    Pushing { patience: Duration },
    /// Sent, and then no more.
    Silent,
}

/// What the pushing thread has to do.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Order {
    /// Take the force away.
    Stop,
    /// Push with this wrench.
    Push { wrench: Wrench, new: bool },
    /// Leave the device without force.
    Idle,
}

/// The pushing thread's end of the mailbox: decides which wrench the device gets.
struct Outlet {
    mailbox: Output<Wrench>,
    signals: Arc<Signals>,
    watchdog: Watchdog,
    state: LoopState,
    last_new: Instant,
    ramp_start: Option<Instant>,
}

impl Outlet {
    fn new(mailbox: Output<Wrench>, signals: &Arc<Signals>, watchdog: Watchdog) -> Self {
        Self {
            mailbox,
            signals: Arc::clone(signals),
            watchdog,
            state: LoopState::Idle,
            last_new: Instant::now(),
            ramp_start: None,
        }
    }

    /// The number of stops asked for so far, and whether one is still to be done.
    fn stops(&self) -> (u32, bool) {
        let asked = self.signals.stops_asked.load(Ordering::Acquire);
        (
            asked,
            asked != self.signals.stops_done.load(Ordering::Acquire),
        )
    }

    fn confirm_stops(&self, asked: u32) {
        self.signals.stops_done.store(asked, Ordering::Release);
    }

    /// What to do now.
    fn next(&mut self, stop: bool) -> Order {
        let new = self.mailbox.update();
        if stop {
            self.state = LoopState::Idle;
            return Order::Stop;
        }
        let pause = self.last_new.elapsed();
        match self.state {
            state if new => {
                self.last_new = Instant::now();
                if state == LoopState::Silent && self.watchdog.ramp {
                    self.ramp_start = Some(self.last_new);
                }
                let Watchdog {
                    least, greatest, ..
                } = self.watchdog;
                let patience = match state {
                    LoopState::Idle => least,
                    _ => (2 * pause).clamp(least, greatest),
                };
                self.state = LoopState::Pushing { patience };
            }
            LoopState::Pushing { patience } if pause > patience => {
                self.state = LoopState::Silent;
                return Order::Stop;
            }
            LoopState::Pushing { .. } => {}
            LoopState::Idle | LoopState::Silent => return Order::Idle,
        }
        let wrench = *self.mailbox.output_buffer();
        let finite = wrench.force.is_finite() && wrench.torque.is_finite();
        let wrench = match finite {
            true => wrench * self.ramp(),
            false => Wrench::ZERO,
        };
        Order::Push { wrench, new }
    }

    /// Share of the force to be shown, 0 ..= 1.
    fn ramp(&mut self) -> f64 {
        let Some(start) = self.ramp_start else {
            return 1.0;
        };
        let share = start.elapsed().as_secs_f64() / RAMP;
        if share >= 1.0 {
            self.ramp_start = None;
        }
        share.min(1.0)
    }

    /// The device has failed and is closed.
    fn disconnect(&mut self, fault: DeviceError) {
        self.record(fault);
        self.state = LoopState::Idle;
        self.signals.gone.store(true, Ordering::Release);
    }

    /// The device is open again, without force.
    fn reconnect(&mut self) {
        self.ramp_start = Some(Instant::now());
        // What was sent while it was away is old.
        self.mailbox.update();
        self.confirm_stops(self.stops().0);
        self.signals.gone.store(false, Ordering::Release);
    }

    fn record(&self, fault: DeviceError) {
        let last = self.signals.fault.lock();
        *last.unwrap_or_else(PoisonError::into_inner) = Some(fault);
    }
}

/// Both mailboxes at the thread that exchanges with a device.
pub(crate) struct Link {
    input: Input<InputState>,
    outlet: Outlet,
}

impl Link {
    /// Whether the device is to be let go for good. An exchange after this was true has no force.
    pub(crate) fn must_quit(&self) -> bool {
        self.outlet.signals.must_quit()
    }

    /// One exchange: hands over the wrench to push with from now on, and publishes the answer. A
    /// stop counts as done when the device has taken a wrench of zero.
    pub(crate) fn exchange(
        &mut self,
        exchange: impl FnOnce(&Wrench) -> Result<Exchange, DeviceError>,
    ) -> Result<(), DeviceError> {
        let (asked, stop) = self.outlet.stops();
        let wrench = match self.outlet.next(stop || self.must_quit()) {
            Order::Push { wrench, .. } => wrench,
            Order::Stop | Order::Idle => Wrench::ZERO,
        };
        let answer = exchange(&wrench)?;
        if let Some(why) = answer.refused {
            self.outlet.ramp_start = Some(Instant::now());
            self.outlet.record(why);
        }
        self.input.write(InputState::new(answer.reading, true));
        self.outlet.confirm_stops(asked);
        Ok(())
    }

    fn disconnect(&mut self, fault: DeviceError) {
        self.input.write(InputState::new(None, false));
        self.outlet.disconnect(fault);
    }
}

/// Opens, serves, and opens again after a fault until the device is dropped. `connected` gets the
/// result of the first opening.
fn exchange_all<D: OpenDevice>(
    mut open: impl FnMut() -> Result<(D, DeviceSpec), DeviceError>,
    mut link: Link,
    connected: impl FnOnce(Result<DeviceSpec, DeviceError>),
) {
    let (mut device, spec) = match open() {
        Ok(opened) => opened,
        Err(why) => return connected(Err(why)),
    };
    connected(Ok(spec.clone()));
    while let Err(fault) = device.serve(&mut link) {
        link.disconnect(fault);
        let signals = Arc::clone(&link.outlet.signals);
        let mut opened = None;
        signals.retry(|| {
            match open() {
                Ok((device, found)) if found == spec => opened = Some(device),
                Ok((_, other)) => link.disconnect(DeviceError::Unsuitable {
                    name: spec.name.clone(),
                    expected: "the same device as before".into(),
                    found: other.name,
                }),
                // What somebody has to do now; else why it went says more than that it is away.
                Err(fault @ DeviceError::NotReady { .. }) => link.disconnect(fault),
                Err(_) => {}
            }
            opened.is_some()
        });
        let Some(again) = opened else {
            return;
        };
        device = again;
        link.outlet.reconnect();
    }
}

/// Reads until the device is dropped, and leaves the newest reading in `input`.
fn read_all(mut half: Box<dyn InputHalf>, mut input: Input<InputState>, signals: &Signals) {
    let mut reading = None;
    while !signals.must_quit() {
        let result = half.read(READ_TIMEOUT);
        reading = match &result {
            Ok(new) => new.or(reading),
            Err(_) => None,
        };
        input.write(InputState::new(reading, result.is_ok()));
        if result.is_err() {
            signals.retry(|| half.connect().is_ok());
        }
    }
}

/// Writes the newest wrench until the device is dropped, and stops the device when asked to or when
/// the loop falls silent.
fn write_all(mut half: Box<dyn OutputHalf>, mut outlet: Outlet) {
    let signals = Arc::clone(&outlet.signals);
    while !signals.must_quit() {
        let (asked, stop) = outlet.stops();
        let result = match outlet.next(stop) {
            Order::Stop => half.stop_all(),
            Order::Push { wrench, new: true } => half.write(&wrench),
            Order::Push { .. } | Order::Idle => {
                std::thread::sleep(REST);
                Ok(())
            }
        };
        if let Err(fault) = result {
            outlet.disconnect(fault);
            signals.retry(|| half.connect().is_ok());
            outlet.reconnect();
        }
        // After a failed stop the device has been opened afresh, which stops it too.
        outlet.confirm_stops(asked);
    }
    // An error here has no receiver: the device is closed next.
    let _ = half.stop_all();
}

/// How a cursor moves that is steered by rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    /// Metres per second per newton: the cursor gives way to the force, since the user cannot feel
    /// it.
    pub admittance: f64,
    /// Radians per second per newton metre.
    pub rotational_admittance: f64,
}

impl Default for Cursor {
    fn default() -> Self {
        Self {
            admittance: 0.03,
            rotational_admittance: 10.0,
        }
    }
}

/// A device on one or two threads of its own.
pub struct ThreadedDevice {
    spec: DeviceSpec,
    cursor: Cursor,
    input: Output<InputState>,
    mailbox: Option<Input<Wrench>>,
    signals: Arc<Signals>,
    threads: Vec<JoinHandle<()>>,
    pose: Pose,
    held: Wrench,
    last_poll: Option<f64>,
}

impl ThreadedDevice {
    /// Connects both halves and starts a thread for each.
    ///
    /// # Errors
    /// If a half cannot connect, or a thread cannot be started.
    pub fn spawn(
        spec: DeviceSpec,
        cursor: Cursor,
        mut input: Box<dyn InputHalf>,
        output: Option<Box<dyn OutputHalf>>,
    ) -> Result<Self, DeviceError> {
        input.connect()?;
        let name = spec.name.clone();
        let signals: Arc<Signals> = Arc::default();
        let (writer, state) = triple_buffer(&InputState::new(None, true));
        let mut device = Self::new(spec, cursor, state, Arc::clone(&signals));
        let reader = Arc::clone(&signals);
        let body = move || read_all(input, writer, &reader);
        device.threads.push(start_thread("haptic-in", &name, body)?);
        if let Some(mut output) = output {
            output.connect()?;
            let (mailbox, wrenches) = triple_buffer(&Wrench::ZERO);
            device.mailbox = Some(mailbox);
            let outlet = Outlet::new(wrenches, &signals, OUTPUT_WATCHDOG);
            let body = move || write_all(output, outlet);
            device
                .threads
                .push(start_thread("haptic-out", &name, body)?);
        }
        Ok(device)
    }

    /// Starts a thread that opens the device by `open`, now and after every fault, and waits until
    /// it has.
    pub(crate) fn exchanging<D: OpenDevice>(
        open: impl FnMut() -> Result<(D, DeviceSpec), DeviceError> + Send + 'static,
    ) -> Result<Self, DeviceError> {
        let (writer, input) = triple_buffer(&InputState::new(None, true));
        let (mailbox, reader) = triple_buffer(&Wrench::ZERO);
        let signals = Arc::default();
        let link = Link {
            input: writer,
            outlet: Outlet::new(reader, &signals, EXCHANGE_WATCHDOG),
        };
        let (first, connected) = sync_channel(1);
        let thread = start_thread("haptic-servo", "servo thread", move || {
            exchange_all(open, link, |spec| {
                // Nobody waits any more only if the process ends.
                let _ = first.send(spec);
            });
        })?;
        // A thread that says nothing has panicked.
        let spec = connected.recv().unwrap_or(Err(DeviceError::Disconnected))?;
        let mut device = Self::new(spec, Cursor::default(), input, signals);
        device.mailbox = Some(mailbox);
        device.threads.push(thread);
        Ok(device)
    }

    /// A device without threads and mailbox yet.
    fn new(
        spec: DeviceSpec,
        cursor: Cursor,
        input: Output<InputState>,
        signals: Arc<Signals>,
    ) -> Self {
        Self {
            spec,
            cursor,
            input,
            mailbox: None,
            signals,
            threads: Vec::new(),
            pose: Pose::IDENTITY,
            held: Wrench::ZERO,
            last_poll: None,
        }
    }

    /// Moves the cursor by the rate asked for and the force on it, within the workspace.
    fn steer(&mut self, rate: &Twist, now: f64) {
        let dt = self
            .last_poll
            .map_or(0.0, |last| (now - last).clamp(0.0, 0.1));
        let velocity = Twist {
            angular: rate.angular + self.held.torque * self.cursor.rotational_admittance,
            linear: rate.linear + self.held.force * self.cursor.admittance,
        };
        self.pose = self.pose.perturbed(&(velocity * dt));
        let edge = DVec3::splat(self.spec.workspace / 2.0);
        self.pose.translation = self.pose.translation.clamp(-edge, edge);
    }
}

fn start_thread(
    name: &str,
    device: &str,
    body: impl FnOnce() + Send + 'static,
) -> Result<JoinHandle<()>, DeviceError> {
    let builder = std::thread::Builder::new().name(name.into());
    builder.spawn(body).map_err(|e| DeviceError::System {
        name: device.into(),
        reason: e.to_string(),
    })
}

impl Device for ThreadedDevice {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let state = self.input.read();
        let (reading, connected) = (state.reading, state.connected);
        let age = state.alive.elapsed().as_secs_f64();
        let rate_at_rest = Reading {
            motion: Motion::Rate(Twist::default()),
            buttons: 0,
        };
        let reading = match reading {
            _ if !connected => Err(DeviceError::Disconnected),
            None if self.spec.rate_controlled => Ok(rate_at_rest),
            reading => reading.ok_or(DeviceError::NoInput),
        };
        let twist = match reading.as_ref().map(|r| r.motion) {
            Ok(Motion::Rate(rate)) => {
                self.steer(&rate, now);
                rate
            }
            Ok(Motion::Position { pose, twist }) => {
                self.pose = pose;
                twist
            }
            Err(_) => Twist::default(),
        };
        self.last_poll = Some(now);
        Ok(DeviceState {
            pose: self.pose,
            twist,
            buttons: reading?.buttons,
            timestamp: now - age,
        })
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.held = *wrench;
        if let Some(mailbox) = &mut self.mailbox {
            mailbox.write(*wrench);
        }
        match self.signals.gone.load(Ordering::Relaxed) {
            true => Err(DeviceError::Disconnected),
            false => Ok(()),
        }
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.held = Wrench::ZERO;
        let Some(mailbox) = &mut self.mailbox else {
            return Ok(());
        };
        mailbox.write(Wrench::ZERO);
        let asked = self.signals.stops_asked.fetch_add(1, Ordering::AcqRel) + 1;
        let begin = Instant::now();
        while self.signals.stops_done.load(Ordering::Acquire) != asked {
            if self.signals.gone.load(Ordering::Acquire) {
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
        let fault = self.signals.fault.lock();
        fault.unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for ThreadedDevice {
    fn drop(&mut self) {
        self.signals.quit.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            // A thread that panicked has closed its device while unwinding; the other is still
            // joined.
            let _ = thread.join();
        }
    }
}

#[cfg(test)]
#[path = "threaded_tests.rs"]
mod tests;
