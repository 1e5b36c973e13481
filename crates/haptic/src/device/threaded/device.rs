//! A device made of two halves, as the loop sees it.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use fft_correlate::{Pose, Twist, Wrench};
use glam::DVec3;
use triple_buffer::{Input, Output, triple_buffer};

use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::device::threaded::halves::{InputHalf, Motion, OutputHalf, Reading};
use crate::device::threaded::threads::{REST, Seen, Signals, read_all, write_all};

/// Longest wait for the output thread to confirm a stop.
const STOP_WAIT: Duration = Duration::from_millis(200);

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
