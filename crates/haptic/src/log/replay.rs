//! Recorded logs as devices: the same inputs again, and with them the same forces.

use fft_correlate::Wrench;

use crate::config::HapticConfig;
use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
use crate::log::check::{ReplayError, check};
use crate::path::sample::{Sample, flags};

/// When a recorded tick was.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tick {
    /// Seconds on the clock of the recording.
    pub(crate) time: f64,
    /// Seconds since the tick before.
    pub(crate) dt: f64,
    /// Whether deadlines were left out before it; how many, nobody wrote down.
    pub(crate) overrun: bool,
}

/// Gives the inputs of a log one after the other, one per poll, whatever the clock says.
///
/// [`crate::Session::replay`] runs it at the recorded times: with the same device record, settings
/// and source, the forces are the recorded ones to the last bit.
#[derive(Debug)]
pub struct Replay {
    spec: DeviceSpec,
    samples: Vec<Sample>,
    next: usize,
    last: Wrench,
}

impl Replay {
    /// Replays `samples` as the device that `spec` describes, in a loop with the settings `config`.
    ///
    /// # Errors
    /// If `spec` describes no device, or a tick cannot have been recorded: its time goes backwards,
    /// or the loop would find a fault in its input that the recording does not know of.
    pub fn new(
        spec: DeviceSpec,
        samples: Vec<Sample>,
        config: &HapticConfig,
    ) -> Result<Self, ReplayError> {
        spec.validate()?;
        check(&samples, spec.input_dof >= 6, config)?;
        Ok(Self {
            spec,
            samples,
            next: 0,
            last: Wrench::ZERO,
        })
    }

    /// What was recorded.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// When its ticks were.
    pub(crate) fn ticks(&self) -> Vec<Tick> {
        let tick = |s: &Sample| Tick {
            time: s.time,
            dt: s.dt,
            overrun: s.flags & flags::OVERRUN != 0,
        };
        self.samples.iter().map(tick).collect()
    }

    /// Seconds the log lasts.
    pub fn duration(&self) -> f64 {
        self.samples.iter().map(|s| s.dt).sum()
    }

    /// The wrench sent last.
    pub fn wrench(&self) -> Wrench {
        self.last
    }
}

impl Device for Replay {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let sample = self.samples.get(self.next);
        self.next += 1;
        match sample.map(|s| (s.time, s.input)) {
            // The age of the input counts, not the time of day of the recording.
            Some((time, Some(input))) if time == now => Ok(input),
            Some((time, Some(input))) => Ok(DeviceState {
                timestamp: input.timestamp + (now - time),
                ..input
            }),
            _ => Err(DeviceError::Disconnected),
        }
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        // What the device did not take then is not taken now.
        let sample = self.next.checked_sub(1).and_then(|i| self.samples.get(i));
        if sample.is_some_and(|s| s.flags & flags::NOT_SENT != 0) {
            return Err(DeviceError::Disconnected);
        }
        self.last = *wrench;
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.last = Wrench::ZERO;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use fft_correlate::Pose;

    use super::*;

    #[test]
    fn passes_the_conformance_suite_and_is_gone_after_its_end() {
        let sample = |tick: u32| Sample {
            time: f64::from(tick) * 1e-3,
            dt: 1e-3,
            input: Some(DeviceState::at(Pose::IDENTITY, f64::from(tick) * 1e-3)),
            ..Sample::default()
        };
        let spec = crate::device::hand_body::HandConfig::default().spec();
        let samples = (0..201).map(sample).collect();
        let mut replay = Replay::new(spec, samples, &HapticConfig::default()).unwrap();
        assert!((replay.duration() - 0.201).abs() < 1e-12);
        crate::device::conformance::check(&mut replay).unwrap();
        assert_eq!(replay.poll(1.0), Err(DeviceError::Disconnected));
    }
}
