//! The loop: ticks at absolute deadlines on a thread of its own, or as fast as it can in simulated
//! time.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fft_correlate::EnergySource;
use hdrhistogram::Histogram;
use serde::Serialize;

use crate::config::ConfigError;
use crate::coupling::Gains;
use crate::realtime::{self, Granted};
use crate::record::{self, RecordError, Recorder, Sink, Writer};
use crate::{
    Device, DeviceError, EnergyAccount, ForcePath, HapticConfig, Sample, Workspace, flags,
};

/// Longest time a histogram tells from longer ones, nanoseconds.
const LONGEST: u64 = 60_000_000_000;

/// Whose seconds count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Clock {
    /// The wall clock, one tick per period.
    Real,
    /// A count of periods, without waiting: the same inputs give the same forces on any machine.
    Simulated,
}

/// Why a session could not run or end well.
#[derive(Debug, thiserror::Error)]
pub enum HapticError {
    /// A setting is out of range.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The log could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The loop thread could not be started.
    #[error("the loop thread could not be started: {0}")]
    Thread(std::io::Error),
    /// Something in a tick panicked; the device was stopped.
    #[error("the loop panicked and the device was stopped: {0}")]
    Panicked(String),
    /// The device could not be told to stop.
    #[error("the device may still push: {0}")]
    NotStopped(DeviceError),
}

/// Microseconds at quantiles of a distribution.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Quantiles {
    /// Half are below.
    pub p50: f64,
    /// 99 of 100 are below.
    pub p99: f64,
    /// 999 of 1000 are below.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

impl Quantiles {
    fn of(nanoseconds: &Histogram<u64>) -> Self {
        let at = |q| nanoseconds.value_at_quantile(q) as f64 * 1e-3;
        Self {
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: at(1.0),
        }
    }
}

/// What a run was like.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoopReport {
    /// Which clock it ran on.
    pub clock: Clock,
    /// The device's name.
    pub device: String,
    /// Ticks done.
    pub ticks: u64,
    /// Seconds on the loop's clock.
    pub seconds: f64,
    /// Mean rate on the loop's clock, Hz.
    pub rate_hz: f64,
    /// Computing time per tick, microseconds, on the wall clock.
    pub latency_us: Quantiles,
    /// Start of each tick after its deadline, microseconds; zeros in simulated time.
    pub lateness_us: Quantiles,
    /// Ticks that ended after the next one's deadline.
    pub overruns: u64,
    /// Deadlines left out because of overruns.
    pub missed: u64,
    /// Ticks with no, bad, stale or jumping input.
    pub input_faults: u64,
    /// Ticks in which the passivity controller acted.
    pub damped: u64,
    /// Wrenches the device did not take.
    pub not_sent: u64,
    /// Samples the log has not got: zero unless the disk stood still for many seconds.
    pub dropped_samples: u64,
    /// Evaluations of the energy source.
    pub evaluations: u64,
    /// Greatest force sent, N.
    pub peak_force: f64,
    /// Greatest torque sent, N·m.
    pub peak_torque: f64,
    /// Coupling stiffness in use, N/m.
    pub stiffness: f64,
    /// Rotational coupling stiffness in use, N·m/rad.
    pub rotational_stiffness: f64,
    /// Energy bookkeeping, joules.
    pub energy: EnergyAccount,
    /// What the operating system granted.
    pub granted: Granted,
}

/// All that a run leaves.
#[derive(Debug)]
pub struct Outcome {
    /// Counts and quantiles.
    pub report: LoopReport,
    /// Every sample, if [`Session::keep_samples`] was asked for.
    pub samples: Vec<Sample>,
    /// The last sample.
    pub last: Sample,
    /// Computing time per tick, nanoseconds.
    pub latency: Histogram<u64>,
    /// Start after deadline, nanoseconds.
    pub lateness: Histogram<u64>,
}

/// Shows the newest sample to another thread; never holds the loop up.
#[derive(Debug)]
pub struct Viewer(triple_buffer::Output<Sample>);

impl Viewer {
    /// The newest sample; the default one before the first tick.
    pub fn newest(&mut self) -> &Sample {
        self.0.read()
    }
}

/// A loop to be run.
pub struct Session {
    config: HapticConfig,
    workspace: Workspace,
    sink: Option<Sink>,
    viewer: Option<triple_buffer::Input<Sample>>,
}

impl Session {
    /// A loop with these settings in this place.
    pub fn new(config: HapticConfig, workspace: Workspace) -> Self {
        Self {
            config,
            workspace,
            sink: None,
            viewer: None,
        }
    }

    /// Writes every tick to a CSV file ([`record::COLUMNS`]), which appears whole at the end.
    #[must_use]
    pub fn record_to(mut self, path: impl Into<PathBuf>) -> Self {
        self.sink = Some(Sink::File(path.into()));
        self
    }

    /// Gives every tick back in the outcome instead.
    #[must_use]
    pub fn keep_samples(mut self) -> Self {
        self.sink = Some(Sink::Memory);
        self
    }

    /// A view of the newest sample for another thread.
    pub fn viewer(&mut self) -> Viewer {
        let (input, output) = triple_buffer::triple_buffer(&Sample::default());
        self.viewer = Some(input);
        Viewer(output)
    }

    /// Runs for `seconds` on `clock` (infinity: until stopped) or until `stop` is set, on a thread
    /// of its own while this one waits. The device is stopped at the end, whatever ends it.
    ///
    /// # Errors
    /// If a setting is out of range, the log cannot be written, a tick panics, or the device
    /// cannot be stopped. A device that is unplugged is no error: its force is let go, and taken up
    /// again when it is back.
    pub fn run(
        self,
        device: &mut dyn Device,
        source: &dyn EnergySource,
        clock: Clock,
        seconds: f64,
        stop: &AtomicBool,
    ) -> Result<Outcome, HapticError> {
        let path = ForcePath::new(
            device.spec(),
            &self.config,
            self.workspace,
            source.scratch(),
        )?;
        let (recorder, writer) = match self.sink {
            Some(sink) => {
                let (r, w) = record::start(sink, clock == Clock::Simulated)?;
                (Some(r), Some(w))
            }
            None => (None, None),
        };
        let mut state = State::new(path, recorder, self.viewer);
        let mut granted = Granted::default();
        let realtime = self.config.realtime && clock == Clock::Real;
        let lock = realtime.then(|| realtime::lock_memory(&mut granted));
        let config = &self.config;
        let name = device.spec().name.clone();
        let ended = std::thread::scope(|scope| {
            let state = &mut state;
            let granted = &mut granted;
            std::thread::Builder::new()
                .name("haptic-loop".into())
                .spawn_scoped(scope, move || {
                    if realtime {
                        realtime::raise_priority(granted);
                    }
                    let mut device = Guard {
                        device,
                        stopped: false,
                    };
                    match clock {
                        Clock::Real => run_real(state, &mut device, source, config, seconds, stop),
                        Clock::Simulated => {
                            run_simulated(state, &mut device, source, config, seconds, stop);
                        }
                    }
                    device.stop()
                })
                .map_err(HapticError::Thread)?
                .join()
                .map_err(|panic| HapticError::Panicked(panic_message(panic.as_ref())))?
                .map_err(HapticError::NotStopped)
        });
        drop(lock);
        let samples = writer.map(Writer::finish).transpose();
        ended?;
        let samples = samples?.unwrap_or_default();
        Ok(state.outcome(clock, name, granted, samples))
    }
}

/// The message of a panic.
pub(crate) fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a message".into())
}

/// Stops the device when dropped, in a panic too.
struct Guard<'a> {
    device: &'a mut dyn Device,
    stopped: bool,
}

impl Guard<'_> {
    fn stop(&mut self) -> Result<(), DeviceError> {
        self.stopped = true;
        match self.device.stop_all() {
            // A device that is gone cannot push.
            Err(DeviceError::Disconnected) => Ok(()),
            other => other,
        }
    }
}

impl Drop for Guard<'_> {
    fn drop(&mut self) {
        if !self.stopped {
            // Unwinding already: there is nobody left to tell.
            let _ = self.stop();
        }
    }
}

/// Everything the loop thread touches, allocated before it starts.
struct State {
    path: ForcePath,
    recorder: Option<Recorder>,
    viewer: Option<triple_buffer::Input<Sample>>,
    latency: Histogram<u64>,
    lateness: Histogram<u64>,
    last: Sample,
    ticks: u64,
    seconds: f64,
    overruns: u64,
    missed: u64,
    input_faults: u64,
    damped: u64,
    not_sent: u64,
    evaluations: u64,
    peak_force: f64,
    peak_torque: f64,
}

fn histogram() -> Histogram<u64> {
    // Bounds and digits are constants in range.
    Histogram::new_with_bounds(1, LONGEST, 3).expect("constant bounds")
}

impl State {
    fn new(
        path: ForcePath,
        recorder: Option<Recorder>,
        viewer: Option<triple_buffer::Input<Sample>>,
    ) -> Self {
        Self {
            path,
            recorder,
            viewer,
            latency: histogram(),
            lateness: histogram(),
            last: Sample::default(),
            ticks: 0,
            seconds: 0.0,
            overruns: 0,
            missed: 0,
            input_faults: 0,
            damped: 0,
            not_sent: 0,
            evaluations: 0,
            peak_force: 0.0,
            peak_torque: 0.0,
        }
    }

    /// One tick; neither allocates nor blocks.
    fn tick(&mut self, device: &mut dyn Device, source: &dyn EnergySource, now: f64, dt: f64) {
        let input = device.poll(now).ok();
        let mut sample = self.path.step(source, input.as_ref(), now, dt);
        if device.send(&sample.wrench).is_err() {
            sample.flags |= flags::NOT_SENT;
        }
        self.count(&sample);
        if let Some(recorder) = &mut self.recorder {
            recorder.record(&sample);
        }
        if let Some(viewer) = &mut self.viewer {
            viewer.write(sample);
        }
        self.last = sample;
    }

    fn count(&mut self, sample: &Sample) {
        let has = |bits: u16| u64::from(sample.flags & bits != 0);
        self.ticks += 1;
        self.seconds = sample.time + sample.dt.min(1.0);
        self.input_faults += has(flags::NO_INPUT | flags::BAD_INPUT | flags::STALE | flags::JUMP);
        self.damped += has(flags::DAMPED);
        self.not_sent += has(flags::NOT_SENT);
        self.evaluations += u64::from(sample.evaluations);
        self.peak_force = self.peak_force.max(sample.wrench.force.length());
        self.peak_torque = self.peak_torque.max(sample.wrench.torque.length());
    }

    fn outcome(
        self,
        clock: Clock,
        device: String,
        granted: Granted,
        samples: Vec<Sample>,
    ) -> Outcome {
        let Gains {
            stiffness,
            rotational_stiffness,
            ..
        } = self.path.gains();
        let report = LoopReport {
            clock,
            device,
            ticks: self.ticks,
            seconds: self.seconds,
            rate_hz: if self.seconds > 0.0 {
                self.ticks as f64 / self.seconds
            } else {
                0.0
            },
            latency_us: Quantiles::of(&self.latency),
            lateness_us: Quantiles::of(&self.lateness),
            overruns: self.overruns,
            missed: self.missed,
            input_faults: self.input_faults,
            damped: self.damped,
            not_sent: self.not_sent,
            dropped_samples: self.recorder.map_or(0, |r| r.dropped),
            evaluations: self.evaluations,
            peak_force: self.peak_force,
            peak_torque: self.peak_torque,
            stiffness,
            rotational_stiffness,
            energy: self.path.account(),
            granted,
        };
        Outcome {
            report,
            samples,
            last: self.last,
            latency: self.latency,
            lateness: self.lateness,
        }
    }
}

fn run_simulated(
    state: &mut State,
    guard: &mut Guard<'_>,
    source: &dyn EnergySource,
    config: &HapticConfig,
    seconds: f64,
    stop: &AtomicBool,
) {
    let period = config.period();
    let mut tick = 0u64;
    while (tick as f64) * period < seconds && !stop.load(Ordering::Relaxed) {
        let start = Instant::now();
        state.tick(guard.device, source, tick as f64 * period, period);
        state
            .latency
            .saturating_record(nanoseconds(start.elapsed()));
        state.lateness.saturating_record(0);
        tick += 1;
    }
}

fn run_real(
    state: &mut State,
    guard: &mut Guard<'_>,
    source: &dyn EnergySource,
    config: &HapticConfig,
    seconds: f64,
    stop: &AtomicBool,
) {
    let period = Duration::from_secs_f64(config.period());
    let spin = Duration::from_micros(config.spin_us.into());
    let begin = Instant::now();
    let mut deadline = begin;
    let mut last = begin.checked_sub(period).unwrap_or(begin);
    while !stop.load(Ordering::Relaxed) {
        realtime::sleep_until(deadline, spin);
        let start = Instant::now();
        let now = (start - begin).as_secs_f64();
        if now >= seconds {
            break;
        }
        state.tick(guard.device, source, now, (start - last).as_secs_f64());
        last = start;
        let end = Instant::now();
        state.latency.saturating_record(nanoseconds(end - start));
        state
            .lateness
            .saturating_record(nanoseconds(start - deadline));
        let skipped = ticks_skipped(deadline, end, period);
        state.overruns += u64::from(skipped > 0);
        state.missed += u64::from(skipped);
        deadline += period * (skipped + 1);
    }
}

/// Deadlines after `deadline` that passed before `end`. They are left out: catching up in a burst
/// would show the device several forces at once.
fn ticks_skipped(deadline: Instant, end: Instant, period: Duration) -> u32 {
    let past = end.saturating_duration_since(deadline).as_nanos() / period.as_nanos().max(1);
    u32::try_from(past).unwrap_or(u32::MAX - 1)
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn deadlines_that_passed_are_left_out_not_caught_up() {
        let period = Duration::from_millis(1);
        let deadline = Instant::now();
        let end = |micros| deadline + Duration::from_micros(micros);
        assert_eq!(ticks_skipped(deadline, end(300), period), 0);
        assert_eq!(ticks_skipped(deadline, end(999), period), 0);
        assert_eq!(ticks_skipped(deadline, end(1001), period), 1);
        assert_eq!(ticks_skipped(deadline, end(10_500), period), 10);
    }
}
