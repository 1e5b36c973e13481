//! The loop: ticks at absolute deadlines on a thread of its own, or as fast as it can in simulated
//! time.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use fft_correlate::EnergySource;

use crate::config::{ConfigError, HapticConfig};
use crate::device::contract::{Device, DeviceError};
use crate::device::workspace::Workspace;
use crate::log::csv::CsvLog;
use crate::log::error::RecordError;
use crate::log::record;
use crate::log::record::{Recorder, SampleWriter, Writer};
use crate::log::replay::Replay;
use crate::panics::panic_message;
use crate::path::force_path::ForcePath;
use crate::path::joint_guide::GuidedJoint;
use crate::path::sample::{Sample, flags};
use crate::run::pace::{Clock, DueTick, Pace, TickSource};
use crate::run::realtime;
use crate::run::realtime::RealtimeGrant;
use crate::run::report::{Outcome, Tally, View};

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
    /// The device did not take the stop.
    #[error("the device may still push: {0}")]
    NotStopped(DeviceError),
}

/// Shows the newest sample to another thread; never holds the loop up.
///
/// See the example of [`SteppedLoop`](crate::SteppedLoop).
#[derive(Debug)]
pub struct Viewer(triple_buffer::Output<View>);

impl Viewer {
    /// A viewer and where samples for it go.
    pub(super) fn pair() -> (triple_buffer::Input<View>, Self) {
        let (input, output) = triple_buffer::triple_buffer(&View::default());
        (input, Self(output))
    }

    /// The newest sample; the default one before the first tick.
    pub fn newest(&mut self) -> &Sample {
        &self.view().sample
    }

    /// The newest sample with what was counted up to it.
    pub fn view(&mut self) -> &View {
        self.0.read()
    }
}

/// Where every tick is written.
enum Log {
    Csv(PathBuf),
    Other(Box<dyn SampleWriter>),
}

impl Log {
    /// Creates the file before the run, so that a bad path fails early.
    fn open(self) -> Result<Box<dyn SampleWriter>, RecordError> {
        match self {
            Self::Csv(path) => Ok(Box::new(CsvLog::create(&path)?)),
            Self::Other(writer) => Ok(writer),
        }
    }
}

/// A haptic loop with its settings, its place in the scene and its log, ready to run.
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::*;
///
/// let config = HapticConfig::default();
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let (seated, axis) = (Pose::IDENTITY, -DVec3::Z);
/// let geometry = Geometry { seated, axis, depth: 0.03, radius: 0.01, tilt: 0.08 };
/// let mut hand =
///     SimulatedOperator::new(OperatorConfig::default(), Script::Free, geometry, workspace);
/// let source = SumSource::new(DVec3::ZERO, vec![]); // free space
/// let session = Session::new(config, workspace).keep_samples();
/// // 0.2 s at 1000 Hz, without waiting for the wall clock.
/// let stop = AtomicBool::new(false);
/// let outcome = session.run(&mut hand, &source, Clock::Simulated, 0.2, &stop)?;
/// assert_eq!((outcome.report.ticks, outcome.samples.len()), (200, 200));
/// assert_eq!((outcome.report.input_faults, outcome.report.granted.fifo), (0, false));
/// assert_eq!(outcome.report.peak_force, 0.0);
/// # Ok::<(), HapticError>(())
/// ```
pub struct Session {
    config: HapticConfig,
    workspace: Workspace,
    log: Option<Log>,
    keep: bool,
    joints: Vec<GuidedJoint>,
    viewer: Option<triple_buffer::Input<View>>,
}

impl Session {
    /// A loop with these settings in this place.
    pub fn new(config: HapticConfig, workspace: Workspace) -> Self {
        Self {
            config,
            workspace,
            log: None,
            keep: false,
            joints: Vec::new(),
            viewer: None,
        }
    }

    /// Writes every tick to a CSV file ([`crate::log::COLUMNS`]), and what the device can do beside
    /// it ([`crate::log::device_file`]). The file grows as `NAME.part` and takes its name at the
    /// end; whatever ends the process before, the part is there and can be replayed.
    #[must_use]
    pub fn record_to(mut self, path: impl Into<PathBuf>) -> Self {
        self.log = Some(Log::Csv(path.into()));
        self
    }

    /// Writes every tick to a file of another format.
    #[must_use]
    pub fn record_with(mut self, writer: Box<dyn SampleWriter>) -> Self {
        self.log = Some(Log::Other(writer));
        self
    }

    /// Gives every tick back in the outcome.
    #[must_use]
    pub fn keep_samples(mut self) -> Self {
        self.keep = true;
        self
    }

    /// Keeps the part on the free motions of a joint, in places that are alike
    /// ([`ForcePath::guided`]).
    #[must_use]
    pub fn guided(mut self, joints: Vec<GuidedJoint>) -> Self {
        self.joints = joints;
        self
    }

    /// A view of the newest sample for another thread.
    pub fn viewer(&mut self) -> Viewer {
        let (input, viewer) = Viewer::pair();
        self.viewer = Some(input);
        viewer
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
        self.run_at(TickSource::from_clock(clock), device, source, seconds, stop)
    }

    /// Runs at the recorded times of `replay` instead of a clock's, without waiting, until it ends
    /// or `seconds` of it are over. With the recorded device's record, the same settings, place and
    /// source, all samples are the recorded ones to the last bit.
    ///
    /// # Errors
    /// As of [`Session::run`].
    pub fn replay(
        self,
        replay: &mut Replay,
        source: &dyn EnergySource,
        seconds: f64,
        stop: &AtomicBool,
    ) -> Result<Outcome, HapticError> {
        let ticks = TickSource::Recorded(replay.ticks());
        self.run_at(ticks, replay, source, seconds, stop)
    }

    fn run_at(
        self,
        ticks: TickSource,
        device: &mut dyn Device,
        source: &dyn EnergySource,
        seconds: f64,
        stop: &AtomicBool,
    ) -> Result<Outcome, HapticError> {
        let clock = ticks.clock();
        let path = ForcePath::new(
            device.spec(),
            &self.config,
            self.workspace,
            source.scratch(),
        )?
        .guided(&self.joints);
        let file = self.log.map(Log::open).transpose()?;
        let (wanted, patient) = (file.is_some() || self.keep, clock == Clock::Simulated);
        let started = wanted.then(|| record::start(file, device.spec(), self.keep, patient));
        let (recorder, writer) = started.transpose()?.unzip();
        let mut ticker = Ticker {
            path,
            recorder,
            viewer: self.viewer,
            tally: Tally::new(),
        };
        let mut granted = RealtimeGrant::default();
        let realtime = self.config.realtime && clock == Clock::Real;
        let lock = realtime.then(|| realtime::lock_memory(&mut granted));
        let spec = device.spec().clone();
        let began = on_own_thread(|| {
            if realtime {
                realtime::raise_priority(&mut granted);
            }
            let mut device = StopGuard {
                device,
                stopped: false,
            };
            let mut pace = Pace::new(ticks, &self.config);
            ticker.run(&mut pace, &mut device, source, seconds, stop);
            device.stop().map(|()| pace.begin())
        });
        drop(lock);
        let samples = writer.map(Writer::finish).transpose();
        let began = began?;
        let samples = samples?.unwrap_or_default();
        let dropped = ticker.recorder.map_or(0, |r| r.dropped);
        let (tally, gains) = (ticker.tally, ticker.path.gains());
        Ok(Outcome {
            report: tally.report(clock, &spec, &gains, dropped, granted),
            samples,
            last: tally.last,
            latency: tally.latency,
            lateness: tally.lateness,
            began,
        })
    }
}

/// Runs `body` on a thread of its own while this one waits.
fn on_own_thread<T: Send>(
    body: impl FnOnce() -> Result<T, DeviceError> + Send,
) -> Result<T, HapticError> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().name("haptic-loop".into());
        thread
            .spawn_scoped(scope, body)
            .map_err(HapticError::Thread)?
            .join()
            .map_err(|panic| HapticError::Panicked(panic_message(panic.as_ref())))?
            .map_err(HapticError::NotStopped)
    })
}

/// Stops the device when dropped, in a panic too.
struct StopGuard<'a> {
    device: &'a mut dyn Device,
    stopped: bool,
}

impl StopGuard<'_> {
    fn stop(&mut self) -> Result<(), DeviceError> {
        self.stopped = true;
        match self.device.stop_all() {
            // A device that is gone cannot push.
            Err(DeviceError::Disconnected) => Ok(()),
            other => other,
        }
    }
}

impl Drop for StopGuard<'_> {
    fn drop(&mut self) {
        if !self.stopped {
            // Already unwinding: nobody can take the error.
            let _ = self.stop();
        }
    }
}

/// Everything the loop thread touches, allocated before it starts.
pub(super) struct Ticker {
    pub(super) path: ForcePath,
    pub(super) recorder: Option<Recorder>,
    pub(super) viewer: Option<triple_buffer::Input<View>>,
    pub(super) tally: Tally,
}

impl Ticker {
    fn run(
        &mut self,
        pace: &mut Pace,
        guard: &mut StopGuard<'_>,
        source: &dyn EnergySource,
        seconds: f64,
        stop: &AtomicBool,
    ) {
        while !stop.load(Ordering::Relaxed) {
            let Some(due) = pace.wait().filter(|due| due.elapsed < seconds) else {
                break;
            };
            self.tick(guard.device, source, &due);
            self.tally.time(&pace.finish(&due));
        }
    }

    /// One tick; neither allocates nor blocks.
    pub(super) fn tick(
        &mut self,
        device: &mut dyn Device,
        source: &dyn EnergySource,
        due: &DueTick,
    ) {
        let input = device.poll(due.now).ok();
        let mut sample = self.path.step(source, input.as_ref(), due.now, due.dt);
        if device.send(&sample.wrench).is_err() {
            sample.flags |= flags::NOT_SENT;
        }
        if due.skipped > 0 {
            sample.flags |= flags::OVERRUN;
        }
        self.tally.count(&sample);
        if let Some(recorder) = &mut self.recorder {
            recorder.record(&sample);
        }
        if let Some(viewer) = &mut self.viewer {
            viewer.write(self.tally.view(&sample, due.start));
        }
    }
}
