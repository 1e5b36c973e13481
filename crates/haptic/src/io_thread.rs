//! Devices whose input and output block: each half on a thread of its own, the loop sees the
//! newest values only.
//!
//! A write to a HID device can take ten milliseconds; a loop that waited would miss as many ticks.
//! The loop leaves the newest wrench in a mailbox, and the output thread writes what it finds
//! there as fast as the device takes it. If the loop falls silent the output thread stops the
//! device by itself.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use crate::{Device, DeviceError, DeviceSpec, DeviceState};

/// Longest wait for input before the thread shows that it is alive.
const READ_TIMEOUT: Duration = Duration::from_millis(5);

/// Pause before trying to reach a device again that is gone.
const RETRY: Duration = Duration::from_millis(300);

/// Pause of the output thread while there is nothing new.
const REST: Duration = Duration::from_micros(500);

/// Silence of the loop after which the output thread stops the device.
const WATCHDOG: Duration = Duration::from_millis(50);

/// Longest wait for the output thread to confirm a stop.
const STOP_WAIT: Duration = Duration::from_millis(200);

/// What a handle tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Its place, device frame.
    Position(Pose),
    /// How fast the cursor should move, rad/s and m/s, device frame.
    Rate(Twist),
}

/// One input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Place or rate.
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
    /// If the device could not be told.
    fn stop_all(&mut self) -> Result<(), DeviceError>;
}

/// How a cursor moves that is steered by rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cursor {
    /// Metres per second per newton: the cursor gives way to the force, since the hand cannot feel
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

#[derive(Debug, Clone)]
struct Seen {
    reading: Option<Reading>,
    connected: bool,
    alive: Instant,
}

/// Shared by the loop and the output thread.
#[derive(Debug, Default)]
struct Signals {
    quit: AtomicBool,
    output_gone: AtomicBool,
    stops_asked: AtomicU32,
    stops_done: AtomicU32,
}

/// A device made of two halves.
pub struct Threaded {
    spec: DeviceSpec,
    cursor: Cursor,
    seen: Output<Seen>,
    mailbox: Option<Input<Wrench>>,
    signals: Arc<Signals>,
    threads: Vec<JoinHandle<()>>,
    pose: Pose,
    held: Wrench,
    last_poll: Option<f64>,
}

impl Threaded {
    /// Connects both halves and starts their threads.
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
        let signals = Arc::new(Signals::default());
        let (seen_in, seen) = triple_buffer(&Seen {
            reading: None,
            connected: true,
            alive: Instant::now(),
        });
        let mut device = Self {
            spec,
            cursor,
            seen,
            mailbox: None,
            signals,
            threads: Vec::new(),
            pose: Pose::IDENTITY,
            held: Wrench::ZERO,
            last_poll: None,
        };
        let quit = Arc::clone(&device.signals);
        device.start("haptic-in", move || read_all(input, seen_in, &quit))?;
        if let Some(mut output) = output {
            output.connect()?;
            let (mailbox, letters) = triple_buffer(&Wrench::ZERO);
            device.mailbox = Some(mailbox);
            let signals = Arc::clone(&device.signals);
            device.start("haptic-out", move || write_all(output, letters, &signals))?;
        }
        Ok(device)
    }

    fn start(
        &mut self,
        name: &str,
        body: impl FnOnce() + Send + 'static,
    ) -> Result<(), DeviceError> {
        let thread = std::thread::Builder::new()
            .name(name.into())
            .spawn(body)
            .map_err(|e| DeviceError::System {
                name: self.spec.name.clone(),
                reason: e.to_string(),
            })?;
        self.threads.push(thread);
        Ok(())
    }

    /// Moves the cursor by the rate asked for and the force on it, within the workspace.
    fn steer(&mut self, rate: &Twist, now: f64) {
        let dt = self
            .last_poll
            .map_or(0.0, |last| (now - last).clamp(0.0, 0.1));
        let way = Twist {
            angular: rate.angular + self.held.torque * self.cursor.rotational_admittance,
            linear: rate.linear + self.held.force * self.cursor.admittance,
        };
        self.pose = self.pose.perturbed(&(way * dt));
        let edge = DVec3::splat(self.spec.workspace / 2.0);
        self.pose.translation = self.pose.translation.clamp(-edge, edge);
    }
}

impl Device for Threaded {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let seen = self.seen.read();
        let (reading, connected) = (seen.reading, seen.connected);
        let age = seen.alive.elapsed().as_secs_f64();
        let result = match reading {
            _ if !connected => Err(DeviceError::Disconnected),
            None if self.spec.rate_controlled => {
                self.steer(&Twist::default(), now);
                Ok((Twist::default(), 0))
            }
            None => Err(DeviceError::NoInput),
            Some(Reading {
                motion: Motion::Rate(rate),
                buttons,
            }) => {
                self.steer(&rate, now);
                Ok((rate, buttons))
            }
            Some(Reading {
                motion: Motion::Position(pose),
                buttons,
            }) => {
                self.pose = pose;
                Ok((Twist::default(), buttons))
            }
        };
        self.last_poll = Some(now);
        let (twist, buttons) = result?;
        Ok(DeviceState {
            pose: self.pose,
            twist,
            buttons,
            timestamp: now - age,
        })
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.held = *wrench;
        if let Some(mailbox) = &mut self.mailbox {
            mailbox.write(*wrench);
        }
        if self.signals.output_gone.load(Ordering::Relaxed) {
            return Err(DeviceError::Disconnected);
        }
        Ok(())
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
            if self.signals.output_gone.load(Ordering::Relaxed) {
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
}

impl Drop for Threaded {
    fn drop(&mut self) {
        self.signals.quit.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            // A half that panicked has nothing more to say; the other one is still joined.
            let _ = thread.join();
        }
    }
}

fn read_all(mut half: Box<dyn InputHalf>, mut seen: Input<Seen>, signals: &Signals) {
    let mut reading = None;
    while !signals.quit.load(Ordering::Acquire) {
        let connected = match half.read(READ_TIMEOUT) {
            Ok(new) => {
                reading = new.or(reading);
                true
            }
            Err(_) => {
                reading = None;
                false
            }
        };
        seen.write(Seen {
            reading,
            connected,
            alive: Instant::now(),
        });
        if !connected {
            reconnect(signals, || half.connect());
        }
    }
}

/// Tries until it works or the device is dropped.
fn reconnect(signals: &Signals, mut connect: impl FnMut() -> Result<(), DeviceError>) {
    while !signals.quit.load(Ordering::Acquire) {
        if connect().is_ok() {
            return;
        }
        let begin = Instant::now();
        while begin.elapsed() < RETRY && !signals.quit.load(Ordering::Acquire) {
            std::thread::sleep(READ_TIMEOUT);
        }
    }
}

fn write_all(mut half: Box<dyn OutputHalf>, mut letters: Output<Wrench>, signals: &Signals) {
    let mut heard = Instant::now();
    let mut pushing = false;
    while !signals.quit.load(Ordering::Acquire) {
        let asked = signals.stops_asked.load(Ordering::Acquire);
        let stop = asked != signals.stops_done.load(Ordering::Acquire);
        let result = if stop {
            letters.update();
            pushing = false;
            half.stop_all()
        } else if letters.update() {
            heard = Instant::now();
            pushing = true;
            half.write(letters.output_buffer())
        } else if pushing && heard.elapsed() > WATCHDOG {
            pushing = false;
            half.stop_all()
        } else {
            std::thread::sleep(REST);
            Ok(())
        };
        if result.is_err() {
            signals.output_gone.store(true, Ordering::Release);
            reconnect(signals, || half.connect());
            signals.output_gone.store(false, Ordering::Release);
        }
        // After a failed stop the device has been opened afresh, which stops it too.
        signals.stops_done.store(asked, Ordering::Release);
    }
    // Nobody is left to be told; the device is closed next.
    let _ = half.stop_all();
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[derive(Default)]
    struct World {
        plugged: AtomicBool,
        wrote: Mutex<Vec<Wrench>>,
        stops: AtomicU32,
        connects: AtomicU32,
    }

    struct Half(Arc<World>, Motion);

    impl Half {
        fn check(&self) -> Result<(), DeviceError> {
            if self.0.plugged.load(Ordering::SeqCst) {
                Ok(())
            } else {
                Err(DeviceError::Disconnected)
            }
        }
    }

    impl InputHalf for Half {
        fn connect(&mut self) -> Result<(), DeviceError> {
            self.0.connects.fetch_add(1, Ordering::SeqCst);
            self.check()
        }
        fn read(&mut self, _: Duration) -> Result<Option<Reading>, DeviceError> {
            self.check()?;
            std::thread::sleep(Duration::from_millis(1));
            Ok(Some(Reading {
                motion: self.1,
                buttons: 5,
            }))
        }
    }

    impl OutputHalf for Half {
        fn connect(&mut self) -> Result<(), DeviceError> {
            self.check()
        }
        fn write(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
            self.check()?;
            std::thread::sleep(Duration::from_millis(10));
            self.0.wrote.lock().unwrap().push(*wrench);
            Ok(())
        }
        fn stop_all(&mut self) -> Result<(), DeviceError> {
            self.check()?;
            self.0.stops.fetch_add(1, Ordering::SeqCst);
            Ok(())
        }
    }

    fn device(motion: Motion) -> (Arc<World>, Threaded) {
        let world = Arc::new(World::default());
        world.plugged.store(true, Ordering::SeqCst);
        let spec = DeviceSpec {
            rate_controlled: matches!(motion, Motion::Rate(_)),
            ..crate::HandConfig::default().spec()
        };
        let device = Threaded::spawn(
            spec,
            Cursor::default(),
            Box::new(Half(Arc::clone(&world), motion)),
            Some(Box::new(Half(Arc::clone(&world), motion))),
        )
        .unwrap();
        (world, device)
    }

    /// Polls until `done`; a slow machine only makes the test slower.
    fn until(mut done: impl FnMut() -> bool) {
        let begin = Instant::now();
        while !done() {
            assert!(begin.elapsed() < Duration::from_secs(20), "never happened");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn push(x: f64) -> Wrench {
        Wrench {
            force: DVec3::new(x, 0.0, 0.0),
            ..Wrench::ZERO
        }
    }

    #[test]
    fn a_slow_device_gets_the_newest_force_and_the_loop_does_not_wait() {
        let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
        for k in 1..=300 {
            device.send(&push(k as f64)).unwrap();
            std::thread::sleep(Duration::from_micros(200));
        }
        until(|| world.wrote.lock().unwrap().last() == Some(&push(300.0)));
        let wrote = world.wrote.lock().unwrap().clone();
        assert!(wrote.len() < 300, "values were overtaken");
        assert!(wrote.windows(2).all(|w| w[0].force.x < w[1].force.x));
    }

    #[test]
    fn stops_when_told_when_the_loop_falls_silent_and_when_dropped() {
        let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
        let stops = || world.stops.load(Ordering::SeqCst);
        device.stop_all().unwrap();
        assert_eq!(stops(), 1);
        device.send(&push(1.0)).unwrap();
        until(|| stops() == 2);
        drop(device);
        assert_eq!(stops(), 3);
    }

    #[test]
    fn comes_back_after_being_unplugged() {
        let (world, mut device) = device(Motion::Position(Pose::IDENTITY));
        until(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
        world.plugged.store(false, Ordering::SeqCst);
        until(|| device.poll(0.0) == Err(DeviceError::Disconnected));
        until(|| device.send(&push(1.0)) == Err(DeviceError::Disconnected));
        world.plugged.store(true, Ordering::SeqCst);
        until(|| device.poll(0.0).is_ok() && device.send(&push(1.0)).is_ok());
        assert!(world.connects.load(Ordering::SeqCst) >= 2);
    }

    #[test]
    fn rates_move_a_cursor_that_gives_way_and_stays_in_the_workspace() {
        let rate = Twist {
            linear: DVec3::new(0.0, 0.1, 0.0),
            ..Twist::default()
        };
        let (_, mut device) = device(Motion::Rate(rate));
        until(|| device.poll(0.0).is_ok_and(|s| s.buttons == 5));
        let start = device.poll(0.0).unwrap().pose.translation;
        let end = device.poll(0.1).unwrap().pose.translation;
        assert!((end.y - start.y - 0.01).abs() < 1e-12);
        device.send(&push(2.0)).unwrap();
        let gave = device.poll(0.2).unwrap().pose.translation;
        assert!((gave.x - 2.0 * 0.03 * 0.1).abs() < 1e-12);
        for k in 3..200 {
            device.poll(k as f64 * 0.1).unwrap();
        }
        let edge = device.poll(20.0).unwrap().pose.translation.y;
        assert_eq!(edge, device.spec().workspace / 2.0);
    }

    #[test]
    fn passes_the_conformance_suite() {
        let (_, mut device) = device(Motion::Position(Pose::IDENTITY));
        crate::conformance::check(&mut device).unwrap();
    }
}
