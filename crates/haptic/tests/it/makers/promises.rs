//! What is promised of every device, whoever makes it.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::device::conformance;
use haptic::{Clock, Device, DeviceError, HapticConfig, HapticError, Replay, Session, read_log};

use crate::common::{Well, workspace};

/// A stand-in with a device in it.
pub(super) trait Rig {
    /// Opens the device.
    fn open(&self) -> Box<dyn Device>;

    /// Newtons along each axis that its motors push with, our axes.
    fn force(&self) -> DVec3;

    /// Puts the handle here, metres, our axes.
    fn put(&self, at: DVec3);

    /// Pulls the device out, or puts it back.
    fn plug(&self, plugged: bool);
}

/// How often something that has to be fast may be tried: a busy machine stops a thread for longer
/// than that now and then.
const TRIES: u32 = 8;

/// Time within which a force has to end.
const SOON: Duration = Duration::from_millis(20);

/// Waits for something that happens on another thread.
pub(super) fn until(what: &str, mut done: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !done() {
        assert!(begin.elapsed() < Duration::from_secs(20), "never: {what}");
        std::thread::sleep(Duration::from_micros(200));
    }
}

pub(super) fn push(x: f64, y: f64, z: f64) -> Wrench {
    Wrench {
        force: DVec3::new(x, y, z),
        ..Wrench::ZERO
    }
}

/// Sends until the motors push so.
pub(super) fn pushing(rig: &dyn Rig, device: &mut dyn Device, force: DVec3) {
    until("the force", || {
        let _ = device.send(&push(force.x, force.y, force.z));
        (rig.force() - force).length() < 1e-12
    });
}

/// Pushes, does something, and looks how long the motors go on.
pub(super) fn soon_without_force(
    rig: &dyn Rig,
    what: &str,
    mut end: impl FnMut(&mut Option<Box<dyn Device>>),
) {
    let mut took = Vec::new();
    for _ in 0..TRIES {
        let mut device = Some(rig.open());
        pushing(
            rig,
            device.as_mut().unwrap().as_mut(),
            DVec3::new(0.5, -1.0, 0.75),
        );
        let begin = Instant::now();
        end(&mut device);
        until(what, || rig.force() == DVec3::ZERO);
        took.push(begin.elapsed());
        rig.plug(true);
        if took.last().is_some_and(|t| *t < SOON) {
            println!("{what}: no force after {took:?}");
            return;
        }
    }
    panic!("{what}: the force ended after {took:?}");
}

/// All that holds for every device; `rig` is at rest.
pub(super) fn keeps_all(rig: &dyn Rig) {
    conformance::check(rig.open().as_mut()).unwrap();
    ends_every_force(rig);
    comes_back_gently(rig);
    ends_sessions_without_force(rig);
    replays_bit_by_bit(rig);
}

fn ends_every_force(rig: &dyn Rig) {
    soon_without_force(rig, "a stop", |device| {
        device.as_mut().unwrap().stop_all().unwrap();
        assert_eq!(
            rig.force(),
            DVec3::ZERO,
            "confirmed before the force had ended"
        );
    });
    soon_without_force(rig, "a drop", |device| drop(device.take()));
    soon_without_force(rig, "a silent loop", |_| {});
    soon_without_force(rig, "a device pulled out", |device| {
        rig.plug(false);
        let device = device.as_mut().unwrap();
        until("its being noticed", || {
            let _ = device.send(&push(0.5, -1.0, 0.75));
            rig.force() == DVec3::ZERO
        });
    });
}

fn comes_back_gently(rig: &dyn Rig) {
    let mut device = rig.open();
    pushing(rig, device.as_mut(), DVec3::X);
    assert_eq!(device.last_fault(), None);
    rig.plug(false);
    until("its being gone", || {
        let sent = device.send(&push(1.0, 0.0, 0.0));
        device.poll(0.0) == Err(DeviceError::Disconnected) && sent == Err(DeviceError::Disconnected)
    });
    assert_eq!(device.stop_all(), Err(DeviceError::Disconnected));
    assert!(device.last_fault().is_some());
    rig.plug(true);
    let mut first = 0.0;
    until("its coming back", || {
        let _ = device.send(&push(1.0, 0.0, 0.0));
        first = rig.force().x;
        device.poll(0.0).is_ok() && first > 0.0
    });
    // The force rises over half a second; the machine may have lost half of that.
    assert!(first < 0.5, "{first}");
    pushing(rig, device.as_mut(), DVec3::X);
}

/// Panics after a while.
struct Breaks(AtomicU32);

impl EnergySource for Breaks {
    fn scratch(&self) -> Scratch {
        Well::default().scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let asked = self.0.fetch_add(1, Ordering::Relaxed);
        assert!(asked < 300, "the source breaks as it is to");
        Well::default().evaluate(pose, scratch)
    }
}

fn config() -> HapticConfig {
    HapticConfig {
        ramp_s: 0.05,
        ..HapticConfig::default()
    }
}

fn ends_sessions_without_force(rig: &dyn Rig) {
    let never = AtomicBool::new(false);
    rig.put(DVec3::new(0.004, 0.001, -0.002));
    let mut device = rig.open();
    let outcome = Session::new(config(), workspace())
        .run(device.as_mut(), &Well::default(), Clock::Real, 0.3, &never)
        .unwrap();
    assert!(
        outcome.report.peak_force > 0.5,
        "{}",
        outcome.report.peak_force
    );
    assert_eq!(rig.force(), DVec3::ZERO, "at the end");
    let broken = Session::new(config(), workspace()).run(
        device.as_mut(),
        &Breaks(AtomicU32::new(0)),
        Clock::Real,
        5.0,
        &never,
    );
    assert!(matches!(broken, Err(HapticError::Panicked(_))));
    assert_eq!(rig.force(), DVec3::ZERO, "after a panic");
}

fn replays_bit_by_bit(rig: &dyn Rig) {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    let well = Well::default();
    let mut device = rig.open();
    let stop = AtomicBool::new(false);
    let session = Session::new(config(), workspace())
        .record_to(&log)
        .keep_samples();
    let samples = std::thread::scope(|scope| {
        let (device, well, stop) = (device.as_mut(), &well, &stop);
        let run = scope.spawn(move || session.run(device, well, Clock::Real, 20.0, stop).unwrap());
        for step in 0..200 {
            let turn = f64::from(step) * 0.05;
            rig.put(DVec3::new(0.004 * turn.sin(), 0.003 * turn.cos(), -0.002));
            if step == 150 {
                rig.plug(false);
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        stop.store(true, Ordering::SeqCst);
        run.join().unwrap().samples
    });
    rig.plug(true);
    assert!(samples.iter().any(|s| s.wrench.force.length() > 0.1));
    let read = read_log(&log).unwrap().samples;
    assert_eq!(read, samples, "the log holds every bit");
    let spec = device.spec().clone();
    let mut replay = Replay::new(spec, read.clone(), &config()).unwrap();
    let again = Session::new(config(), workspace())
        .keep_samples()
        .replay(&mut replay, &well, f64::INFINITY, &AtomicBool::new(false))
        .unwrap();
    assert_eq!(again.samples, read);
}
