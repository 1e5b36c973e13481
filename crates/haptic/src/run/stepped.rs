//! The loop without a thread: its owner calls every step, as a worker of a browser's page does.

use fft_correlate::EnergySource;

use crate::config::{ConfigError, HapticConfig};
use crate::device::contract::Device;
use crate::device::workspace::Workspace;
use crate::path::force_path::ForcePath;
use crate::path::joint_guide::GuidedJoint;
use crate::path::sample::Sample;
use crate::run::pace::{Pace, TickSource};
use crate::run::report::Tally;
use crate::run::session::{Ticker, Viewer};

/// A loop on the wall clock where there are no threads, as in a browser. Its owner asks again and
/// again whether a tick is due; what comes too late is left out and counted, as by
/// [`Session`](crate::Session). The owner stops the device, and keeps what it wants of the samples.
///
/// ```
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
/// let (mut stepped, mut viewer) = SteppedLoop::new(&config, workspace, &[], &hand, &source)?;
/// // The first tick is due at once, the next one a millisecond later.
/// let tick = stepped.step(&mut hand, &source).expect("due").tick;
/// assert_eq!((tick, viewer.newest().tick), (0, 0));
/// assert!(stepped.seconds_ahead() <= 0.001);
/// assert_eq!(viewer.view().timing.ticks, 0); // before it
/// # Ok::<(), ConfigError>(())
/// ```
pub struct SteppedLoop {
    ticker: Ticker,
    pace: Pace,
}

impl SteppedLoop {
    /// A loop whose first tick is due now, and a view of its newest sample. `joints` keep the part
    /// on their free motions ([`ForcePath::guided`]).
    ///
    /// # Errors
    /// If a setting is out of range.
    pub fn new(
        config: &HapticConfig,
        workspace: Workspace,
        joints: &[GuidedJoint],
        device: &dyn Device,
        source: &dyn EnergySource,
    ) -> Result<(Self, Viewer), ConfigError> {
        let path = ForcePath::new(device.spec(), config, workspace, source.scratch())?;
        let (input, viewer) = Viewer::pair();
        let ticker = Ticker {
            path: path.guided(joints),
            recorder: None,
            viewer: Some(input),
            tally: Tally::new(),
        };
        let pace = Pace::new(TickSource::Wall, config);
        Ok((Self { ticker, pace }, viewer))
    }

    /// Does the tick that is due; `None` if none is. It neither allocates nor waits.
    pub fn step(&mut self, device: &mut dyn Device, source: &dyn EnergySource) -> Option<&Sample> {
        if self.seconds_ahead() > 0.0 {
            return None;
        }
        let due = self.pace.begin_tick();
        self.ticker.tick(device, source, &due);
        self.ticker.tally.time(&self.pace.finish(&due));
        Some(&self.ticker.tally.last)
    }

    /// Seconds until the next tick is due.
    pub fn seconds_ahead(&self) -> f64 {
        self.pace.seconds_ahead()
    }
}
