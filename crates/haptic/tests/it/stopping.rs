//! Whatever ends the process, the device is told to stop first: a child process per way to end.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::common::{Well, workspace};
use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, OperatorConfig, Session,
};
use rustix::process::{Pid, Signal, kill_process};

/// How the child is to end, and where it leaves its files.
const WAY: &str = "PEGFIT_TEST_WAY_TO_END";
const FOLDER: &str = "PEGFIT_TEST_FOLDER";

/// Leaves a file when it runs and one when it is stopped, with the wrench it was left with.
struct Witness {
    spec: DeviceSpec,
    folder: PathBuf,
    polls: u32,
    wrench: Wrench,
}

impl Device for Witness {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        self.polls += 1;
        if self.polls == 100 {
            std::fs::write(self.folder.join("running"), "").unwrap();
        }
        let pose = Pose::from_translation(DVec3::new(0.004, 0.0, 0.0));
        Ok(DeviceState::at_rest(pose, now))
    }

    fn send(&mut self, wrench: &Wrench) -> Result<(), DeviceError> {
        self.wrench = *wrench;
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        let pushed = self.wrench.force.length();
        std::fs::write(self.folder.join("stopped"), pushed.to_string()).unwrap();
        Ok(())
    }
}

/// Panics once the loop has run for a while, if it is to.
struct Source {
    panics: bool,
    asked: std::sync::atomic::AtomicU32,
}

impl EnergySource for Source {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let asked = self.asked.fetch_add(1, Ordering::Relaxed);
        assert!(!(self.panics && asked > 400), "the child panics as asked");
        Well::default().evaluate(pose, scratch)
    }
}

/// What runs in the child process.
#[test]
#[ignore = "run by the other tests of this file in a process of its own"]
fn child() {
    let Ok(way) = std::env::var(WAY) else { return };
    static STOP: AtomicBool = AtomicBool::new(false);
    ctrlc::set_handler(|| STOP.store(true, Ordering::SeqCst)).unwrap();
    let mut device = Witness {
        spec: OperatorConfig::default().spec(),
        folder: PathBuf::from(std::env::var_os(FOLDER).unwrap()),
        polls: 0,
        wrench: Wrench::ZERO,
    };
    let source = Source {
        panics: way == "panic",
        asked: Default::default(),
    };
    let config = HapticConfig {
        ramp_s: 0.05,
        ..HapticConfig::default()
    };
    let seconds = if way == "end" { 0.5 } else { 60.0 };
    Session::new(config, workspace())
        .run(&mut device, &source, Clock::Real, seconds, &STOP)
        .unwrap();
}

fn start(way: &str, folder: &Path) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "stopping::child", "--ignored"])
        .env(WAY, way)
        .env(FOLDER, folder)
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::null())
        .spawn()
        .unwrap()
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(50);
    while !done() {
        assert!(Instant::now() < deadline, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Runs a child that ends in this way; gives its status and the newtons it pushed with before it
/// was told to stop.
fn end(way: &str, signal: Option<Signal>) -> (ExitStatus, f64) {
    let folder = tempfile::tempdir().unwrap();
    let mut child = start(way, folder.path());
    until("running", || folder.path().join("running").exists());
    if let Some(signal) = signal {
        // Far enough into the ramp to push.
        std::thread::sleep(Duration::from_millis(150));
        let pid = Pid::from_raw(child.id().cast_signed()).unwrap();
        kill_process(pid, signal).unwrap();
    }
    let mut status = None;
    until("the end", || {
        status = child.try_wait().unwrap();
        status.is_some()
    });
    let pushed = std::fs::read_to_string(folder.path().join("stopped"))
        .expect("the device was told to stop");
    (status.unwrap(), pushed.parse().unwrap())
}

#[test]
fn the_device_is_stopped_by_sigint() {
    let (status, pushed) = end("signal", Some(Signal::INT));
    assert!(status.success() && pushed > 1.0, "{status} {pushed}");
}

#[test]
fn the_device_is_stopped_by_sigterm() {
    let (status, pushed) = end("signal", Some(Signal::TERM));
    assert!(status.success() && pushed > 1.0, "{status} {pushed}");
}

#[test]
fn the_device_is_stopped_by_a_panic() {
    let (status, pushed) = end("panic", None);
    assert!(!status.success() && pushed > 1.0, "{status} {pushed}");
}

#[test]
fn the_device_is_stopped_at_the_end() {
    let (status, pushed) = end("end", None);
    assert!(status.success() && pushed > 1.0, "{status} {pushed}");
}
