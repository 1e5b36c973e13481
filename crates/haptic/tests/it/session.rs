//! The loop as a whole: stopping, panics, logs, replay, unplugging.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use crate::common::{Well, hand, workspace};
use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, HapticError, OperatorConfig,
    Replay, Script, Session, SteppedLoop, flags, read_log,
};

fn go() -> AtomicBool {
    AtomicBool::new(false)
}

/// Counts what the loop does to it; gone between two polls.
struct Probe {
    spec: DeviceSpec,
    polls: u32,
    gone: std::ops::Range<u32>,
    stops: Arc<AtomicU32>,
    stop_at: Option<(u32, Arc<AtomicBool>)>,
}

impl Probe {
    fn new() -> Self {
        Self {
            spec: OperatorConfig::default().spec(),
            polls: 0,
            gone: 0..0,
            stops: Arc::default(),
            stop_at: None,
        }
    }
}

impl Device for Probe {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        self.polls += 1;
        if let Some((at, flag)) = &self.stop_at
            && self.polls == *at
        {
            flag.store(true, Ordering::Relaxed);
        }
        if self.gone.contains(&self.polls) {
            return Err(DeviceError::Disconnected);
        }
        let pose = Pose::from_translation(glam::DVec3::new(0.003, 0.0, 0.0));
        Ok(DeviceState::at_rest(pose, now))
    }

    fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        self.stops.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }
}

struct Faulty {
    after: AtomicU32,
    panics: bool,
}

impl EnergySource for Faulty {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        if self.after.fetch_sub(1, Ordering::Relaxed) == 1 {
            assert!(!self.panics, "table is on fire");
            self.after.store(1, Ordering::Relaxed);
            return Response {
                energy: f64::NAN,
                ..Response::default()
            };
        }
        Well::default().evaluate(pose, scratch)
    }
}

#[test]
fn a_panic_stops_the_device_and_is_told() {
    let mut device = Probe::new();
    let stops = Arc::clone(&device.stops);
    let source = Faulty {
        after: AtomicU32::new(100),
        panics: true,
    };
    let error = Session::new(HapticConfig::default(), workspace())
        .run(&mut device, &source, Clock::Simulated, 10.0, &go())
        .unwrap_err();
    assert!(
        matches!(&error, HapticError::Panicked(m) if m.contains("on fire")),
        "{error}"
    );
    assert_eq!(stops.load(Ordering::Relaxed), 1);
}

#[test]
fn a_source_that_fails_lets_the_force_go() {
    let source = Faulty {
        after: AtomicU32::new(4000),
        panics: false,
    };
    let outcome = Session::new(HapticConfig::default(), workspace())
        .keep_samples()
        .run(&mut Probe::new(), &source, Clock::Simulated, 10.0, &go())
        .unwrap();
    assert!(outcome.report.peak_force > 1.0);
    assert!(outcome.last.flags & flags::BAD_SOURCE != 0);
    assert!(outcome.last.wrench.force.length() < 1e-3);
}

#[test]
fn the_stop_flag_ends_the_loop_and_stops_the_device() {
    for clock in [Clock::Simulated, Clock::Real] {
        let mut device = Probe::new();
        let stop = Arc::new(go());
        device.stop_at = Some((50, Arc::clone(&stop)));
        let outcome = Session::new(HapticConfig::default(), workspace())
            .run(&mut device, &Well::default(), clock, f64::INFINITY, &stop)
            .unwrap();
        assert_eq!(outcome.report.ticks, 50);
        assert_eq!(device.stops.load(Ordering::Relaxed), 1);
    }
}

#[test]
fn an_unplugged_device_feels_nothing_and_ramps_up_when_back() {
    let mut device = Probe::new();
    device.gone = 2000..3000;
    let outcome = Session::new(HapticConfig::default(), workspace())
        .keep_samples()
        .run(&mut device, &Well::default(), Clock::Simulated, 5.0, &go())
        .unwrap();
    let force = |tick: usize| outcome.samples[tick].wrench.force.length();
    assert!(force(1990) > 2.0);
    assert!(force(2100) < 1e-3);
    assert!(force(3010) < 0.1 && force(3250) < 0.75 * force(1990));
    assert!((force(4900) - force(1990)).abs() < 0.01);
    assert_eq!(outcome.report.input_faults, 1000);
}

#[test]
fn a_log_holds_every_tick_and_replays_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    let mut device = hand(OperatorConfig::default(), Script::Snap);
    let config = HapticConfig::default();
    let outcome = Session::new(config.clone(), workspace())
        .record_to(&log)
        .run(&mut device, &Well::default(), Clock::Simulated, 4.0, &go())
        .unwrap();
    let samples = read_log(&log).unwrap().samples;
    assert_eq!(samples.len() as u64, outcome.report.ticks);
    assert_eq!(outcome.report.dropped_samples, 0);
    assert_eq!(samples.last(), Some(&outcome.last));
    assert!(outcome.report.peak_force > 1.0);

    let spec = device.spec().clone();
    let mut replay = Replay::new(spec, samples.clone(), &config).unwrap();
    let again = Session::new(config, workspace())
        .keep_samples()
        .run(&mut replay, &Well::default(), Clock::Simulated, 4.0, &go())
        .unwrap();
    assert_eq!(again.samples, samples);
}

#[test]
fn a_log_made_in_real_time_is_complete_and_repeats_with_its_own_times() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    let mut device = hand(OperatorConfig::default(), Script::Collision);
    let config = HapticConfig {
        ramp_s: 0.05,
        ..HapticConfig::default()
    };
    let outcome = Session::new(config.clone(), workspace())
        .record_to(&log)
        .run(&mut device, &Well::default(), Clock::Real, 0.5, &go())
        .unwrap();
    let samples = read_log(&log).unwrap().samples;
    assert_eq!(samples.len() as u64, outcome.report.ticks);
    assert_eq!(outcome.report.dropped_samples, 0);
    let spec = device.spec().clone();
    let mut replay = Replay::new(spec, samples.clone(), &config).unwrap();
    let again = Session::new(config, workspace())
        .keep_samples()
        .replay(&mut replay, &Well::default(), f64::INFINITY, &go())
        .unwrap();
    assert_eq!(again.samples, samples);
    assert_eq!(again.report.clock, Clock::Simulated);
}

#[test]
fn a_bad_log_is_refused_by_line_and_a_bad_path_before_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    Session::new(HapticConfig::default(), workspace())
        .record_to(&log)
        .run(
            &mut Probe::new(),
            &Well::default(),
            Clock::Simulated,
            0.01,
            &go(),
        )
        .unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let broken = text.replacen("0.003", "here", 1);
    std::fs::write(&log, broken).unwrap();
    let error = read_log(&log).unwrap_err().to_string();
    assert!(
        error.contains("line 2") && error.contains("here"),
        "{error}"
    );

    let mut device = Probe::new();
    let error = Session::new(HapticConfig::default(), workspace())
        .record_to(folder.path().join("no/such/folder.csv"))
        .run(&mut device, &Well::default(), Clock::Simulated, 1.0, &go())
        .unwrap_err();
    assert!(matches!(error, HapticError::Record(_)), "{error}");
    assert_eq!(device.polls, 0);
}

#[test]
fn settings_out_of_range_are_refused_before_the_device_is_touched() {
    let mut config = HapticConfig::default();
    config.limits.force = f64::NAN;
    let mut device = Probe::new();
    let error = Session::new(config, workspace())
        .run(&mut device, &Well::default(), Clock::Simulated, 1.0, &go())
        .unwrap_err();
    assert!(error.to_string().contains("limits.force"), "{error}");
    assert_eq!(device.polls, 0);
}

/// A loop without a thread does no tick before its time, and leaves out what it was too late for.
#[test]
fn a_stepped_loop_keeps_to_its_deadlines() {
    let mut probe = Probe::new();
    let well = Well::default();
    let config = HapticConfig::default();
    let (mut ticks, mut viewer) =
        SteppedLoop::new(&config, workspace(), &[], &probe, &well).unwrap();
    let began = std::time::Instant::now();
    let mut done = 0;
    while done < 50 {
        match ticks.step(&mut probe, &well) {
            Some(sample) => {
                assert_eq!(sample.tick, done);
                done += 1;
            }
            None => assert!(ticks.seconds_ahead() <= config.period()),
        }
    }
    // The first is due at once.
    assert!(began.elapsed().as_secs_f64() >= 49.0 * config.period());
    assert_eq!(probe.polls, 50);
    assert!(viewer.newest().energy < 0.0);
    let missed = viewer.view().timing.missed;
    std::thread::sleep(std::time::Duration::from_millis(20));
    while ticks.step(&mut probe, &well).is_none() {}
    while ticks.step(&mut probe, &well).is_none() {}
    assert!(viewer.view().timing.missed >= missed + 19);
    let bad = HapticConfig {
        rate_hz: f64::NAN,
        ..config
    };
    assert!(SteppedLoop::new(&bad, workspace(), &[], &probe, &well).is_err());
}
