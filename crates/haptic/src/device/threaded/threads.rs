//! The two threads of a device.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fft_correlate::Wrench;
use triple_buffer::{Input, Output};

use crate::device::contract::DeviceError;
use crate::device::threaded::halves::{InputHalf, OutputHalf, Reading};

/// Longest wait for input before the thread shows that it is alive.
const READ_TIMEOUT: Duration = Duration::from_millis(5);

/// Pause before trying to reach a device again that is gone.
const RETRY: Duration = Duration::from_millis(300);

/// Pause of the output thread while there is nothing new.
pub(super) const REST: Duration = Duration::from_micros(500);

/// Silence of the loop after which the output thread stops the device.
const WATCHDOG: Duration = Duration::from_millis(50);

/// Seconds in which the force rises to full strength on a device that was plugged in again.
const RAMP: f64 = 0.5;

#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) reading: Option<Reading>,
    pub(super) connected: bool,
    pub(super) alive: Instant,
}

/// Shared by the loop and the output thread.
#[derive(Debug, Default)]
pub(super) struct Signals {
    pub(super) quit: AtomicBool,
    pub(super) output_gone: AtomicBool,
    pub(super) stops_asked: AtomicU32,
    pub(super) stops_done: AtomicU32,
}

/// Reads until told to quit, and leaves the newest reading in `seen`.
pub(super) fn read_all(mut half: Box<dyn InputHalf>, mut seen: Input<Seen>, signals: &Signals) {
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

/// Writes the newest wrench until told to quit, and stops the device when asked to or when the loop
/// falls silent.
pub(super) fn write_all(
    mut half: Box<dyn OutputHalf>,
    mut letters: Output<Wrench>,
    signals: &Signals,
) {
    let mut heard = Instant::now();
    let mut pushing = false;
    let mut plugged_again = None;
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
            half.write(&(*letters.output_buffer() * ramp(plugged_again)))
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
            plugged_again = Some(Instant::now());
        }
        // After a failed stop the device has been opened afresh, which stops it too.
        signals.stops_done.store(asked, Ordering::Release);
    }
    // Nobody is left to be told; the device is closed next.
    let _ = half.stop_all();
}

/// Share of the force shown so long after the device came back; all of it if it never was away.
fn ramp(plugged_again: Option<Instant>) -> f64 {
    plugged_again.map_or(1.0, |then| (then.elapsed().as_secs_f64() / RAMP).min(1.0))
}
