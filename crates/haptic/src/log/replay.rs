//! Recorded logs as devices: the same inputs again, and with them the same forces.

use fft_correlate::Wrench;

use crate::config::HapticConfig;
use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState, SpecError};
use crate::path::gate::Gate;
use crate::path::sample::{Sample, flags};

/// A recording cannot be replayed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ReplayError {
    /// There is nothing in it.
    #[error("expected ticks, found none: the recording ended before its first")]
    Empty,
    /// Its device cannot be.
    #[error("the recording's device: {0}")]
    Device(#[from] SpecError),
    /// A tick cannot have been recorded.
    #[error("line {line}: {item}: expected {expected}, found {found}")]
    Tick {
        /// In the log, counted from 1; the header is the first.
        line: u64,
        /// The columns.
        item: &'static str,
        /// What a device, or a clock, would have given.
        expected: String,
        /// What is there.
        found: String,
    },
}

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
///
/// ```
/// use std::sync::atomic::AtomicBool;
///
/// use fft_correlate::Pose;
/// use glam::DVec3;
/// use haptic::*;
///
/// let (config, stop) = (HapticConfig::default(), AtomicBool::new(false));
/// let workspace = config.workspace(Pose::IDENTITY, DVec3::ZERO);
/// let (seated, axis) = (Pose::IDENTITY, -DVec3::Z);
/// let geometry = Geometry { seated, axis, depth: 0.03, radius: 0.01, tilt: 0.08 };
/// let mut hand =
///     SimulatedOperator::new(OperatorConfig::default(), Script::Free, geometry, workspace);
/// let source = SumSource::new(DVec3::ZERO, vec![]); // free space
/// let session = || Session::new(config.clone(), workspace).keep_samples();
/// let first = session().run(&mut hand, &source, Clock::Simulated, 0.1, &stop)?;
/// let mut replay = Replay::new(hand.spec().clone(), first.samples.clone(), &config)?;
/// let again = session().replay(&mut replay, &source, f64::INFINITY, &stop)?;
/// assert_eq!(again.samples.len(), 100);
/// assert_eq!(again.last.object, first.last.object);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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

/// Faults of an input, which a recording that has them says.
const INPUT_FAULTS: u16 = flags::BAD_INPUT | flags::STALE | flags::JUMP;

/// Seconds by which the time since the last tick may differ from the times of both: rounding.
const ROUNDING: f64 = 1e-6;

/// Seconds between two ticks that every loop finds late unless its settings are unusual: twenty
/// periods at the slowest rate.
const ALWAYS_LATE: f64 = 0.4;

/// Checks the times of `samples`, and that they say every fault of an input which a loop with the
/// settings `config`, or the ordinary ones, finds.
pub(crate) fn check(
    samples: &[Sample],
    senses_rotation: bool,
    config: &HapticConfig,
) -> Result<(), ReplayError> {
    if samples.is_empty() {
        return Err(ReplayError::Empty);
    }
    let settings = lenient(config);
    let late = (f64::from(config.missed_ticks) * config.period()).max(ALWAYS_LATE);
    // None until a tick whose judgement depends on no tick that is not there.
    let mut gate = None;
    let mut last: Option<&Sample> = None;
    for (index, sample) in samples.iter().enumerate() {
        let mismatch_at = |item, expected: String, found: String| ReplayError::Tick {
            line: index as u64 + 2,
            item,
            expected,
            found,
        };
        let next = last.is_none_or(|last| last.tick.checked_add(1) == Some(sample.tick));
        check_time(last.filter(|_| next), last, sample, late)
            .map_err(|(item, expected, found)| mismatch_at(item, expected, found))?;
        if !next {
            gate = None;
        }
        if gate.is_none() && sample.flags & INPUT_FAULTS == 0 {
            gate = Some(Gate::new(&settings, senses_rotation));
        }
        if let Some(gate) = &mut gate {
            let found = gate.admit(sample.input.as_ref(), sample.time, sample.dt);
            let unflagged = found.flags & INPUT_FAULTS & !sample.flags;
            if let (Some(input), true) = (&sample.input, unflagged != 0) {
                let (item, expected, found) =
                    describe_fault(unflagged, input, sample.time, &settings);
                return Err(mismatch_at(item, expected, found));
            }
        }
        last = Some(sample);
    }
    Ok(())
}

/// The given settings where they allow more than the ordinary ones do: a replay with others than
/// the recording's is no broken file.
fn lenient(config: &HapticConfig) -> HapticConfig {
    let ordinary = HapticConfig::default();
    let mut settings = config.clone();
    settings.stale_s = config.stale_s.max(ordinary.stale_s);
    settings.rate_hz = config.rate_hz.min(ordinary.rate_hz);
    let (given, usual) = (&mut settings.limits, &ordinary.limits);
    given.device_speed = given.device_speed.max(usual.device_speed);
    given.device_angular_speed = given.device_angular_speed.max(usual.device_angular_speed);
    settings
}

type Mismatch = (&'static str, String, String);

/// Checks the time of `sample`, after `last`; `before` is the tick directly before it.
fn check_time(
    before: Option<&Sample>,
    last: Option<&Sample>,
    sample: &Sample,
    late: f64,
) -> Result<(), Mismatch> {
    let (time, dt) = (sample.time, sample.dt);
    let mismatch = |item, expected: String, found: f64| Err((item, expected, found.to_string()));
    if !time.is_finite() {
        return mismatch("time", "seconds".into(), time);
    }
    if let Some(last) = last.filter(|last| time < last.time) {
        let expected = format!("a time of at least the last one's, {}", last.time);
        return mismatch("time", expected, time);
    }
    if !(dt.is_finite() && dt >= 0.0) {
        return mismatch("dt", "seconds since the last tick".into(), dt);
    }
    if dt > late && sample.flags & flags::LATE == 0 {
        return mismatch("dt", format!("at most {late} s, or the flag late"), dt);
    }
    if let Some(before) = before {
        let passed = time - before.time;
        if (passed - dt).abs() > ROUNDING + 1e-9 * time.abs() {
            let expected = format!("the {passed} s since the time of the last tick");
            return mismatch("dt", expected, dt);
        }
    }
    Ok(())
}

/// What is wrong with an input.
fn describe_fault(
    unflagged: u16,
    input: &DeviceState,
    time: f64,
    settings: &HapticConfig,
) -> Mismatch {
    let pose = format!(
        "{:?} and {:?}",
        input.pose.translation.to_array(),
        input.pose.rotation.to_array()
    );
    if unflagged & flags::BAD_INPUT != 0 {
        let expected = "metres and a quaternion of length 1, or the flag bad_input";
        return ("x to qw", expected.into(), pose);
    }
    if unflagged & flags::STALE != 0 {
        let expected = format!(
            "within {} s of the time {time}, or the flag stale",
            settings.stale_s
        );
        return ("timestamp", expected, input.timestamp.to_string());
    }
    let limits = &settings.limits;
    let expected = format!(
        "a hand no faster than {} m/s and {} rad/s, or the flag jump",
        limits.device_speed, limits.device_angular_speed
    );
    ("x to qw", expected, format!("a jump to {pose}"))
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
            input: Some(DeviceState::at_rest(Pose::IDENTITY, f64::from(tick) * 1e-3)),
            ..Sample::default()
        };
        let spec = crate::device::simulated::OperatorConfig::default().spec();
        let samples = (0..201).map(sample).collect();
        let mut replay = Replay::new(spec, samples, &HapticConfig::default()).unwrap();
        assert!((replay.duration() - 0.201).abs() < 1e-12);
        crate::device::conformance::check(&mut replay).unwrap();
        assert_eq!(replay.poll(1.0), Err(DeviceError::Disconnected));
    }
}
