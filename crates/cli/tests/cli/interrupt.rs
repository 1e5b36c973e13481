//! Ctrl-C: a clean stop that keeps what was finished.
#![cfg(unix)]

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, OperatorConfig, Session,
};
use pegfit::terminal::progress;
use pegfit::terminal::progress::Hold;

use crate::common::{scene_folder, succeed, words};
use crate::screen::library_folder;

/// Sends the interrupt signal that Ctrl-C sends.
fn interrupt(child: &Child) {
    let status = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn an_interrupted_bake_keeps_its_rotations_and_resumes() {
    // Some 4000 rotations: many seconds of work.
    let folder = scene_folder("[rotations]\nkind = \"ball\"\nangle_deg = 20.0\nstep_deg = 2.0\n");
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder.path())
        .args(["bake", "scene.toml", "-o", "t.zarr", "-q"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let finished = || {
        std::fs::read_dir(folder.path().join("t.zarr/coefficients"))
            .map_or(0, |entries| entries.count())
    };
    let began = Instant::now();
    while finished() < 20 {
        assert!(
            began.elapsed() < Duration::from_secs(120),
            "no rotation was finished"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupt(&child);
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    for words in [
        "interrupted: the finished chunks are in t.zarr",
        "`pegfit bake scene.toml -o t.zarr -q --resume` goes on",
    ] {
        assert!(said.contains(words), "{said}");
    }
    let args = ["bake", "scene.toml", "-o", "t.zarr", "--status", "--json"];
    let status: serde_json::Value = serde_json::from_str(&succeed(folder.path(), &args)).unwrap();
    assert!(status["finished"].as_u64().unwrap() >= 18, "{status}");
    assert!(status["missing"].as_u64().unwrap() > 0, "{status}");
    assert_eq!(status["damaged"], 0);
}

#[test]
fn an_interrupted_screen_keeps_its_rows_and_resumes() {
    let folder = library_folder();
    // Many seconds of work.
    for i in 0..40 {
        let library = folder.path().join("library");
        std::fs::copy(
            library.join("pegs/peg.obj"),
            library.join(format!("peg-{i}.obj")),
        )
        .unwrap();
    }
    let line = "screen hole.obj --library library --unit m -o t.csv";
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder.path())
        .args(words(line))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let rows = folder.path().join("t.csv.rows");
    let kept = || std::fs::read_dir(&rows).map_or(0, |entries| entries.count());
    let began = Instant::now();
    while kept() < 3 {
        assert!(
            began.elapsed() < Duration::from_secs(600),
            "no part was screened"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupt(&child);
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stdout.take().unwrap(), &mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(
        said.contains("t.csv.rows; the same command with --resume goes on"),
        "{said}"
    );
    assert!(!folder.path().join("t.csv").exists());
    let status = format!("{line} --status --json");
    let status: serde_json::Value =
        serde_json::from_str(&succeed(folder.path(), &words(&status))).unwrap();
    let finished = status["finished"].as_u64().unwrap();
    assert!((3..43).contains(&finished), "{status}");
    // Two more of the library, then an end: the others go.
    for i in 2..40 {
        std::fs::remove_file(folder.path().join(format!("library/peg-{i}.obj"))).unwrap();
    }
    let line = format!("{line} --resume --json -q");
    let summary: serde_json::Value =
        serde_json::from_str(&succeed(folder.path(), &words(&line))).unwrap();
    assert_eq!(
        (&summary["complete"], &summary["files"]),
        (&true.into(), &5.into())
    );
    assert!(summary["screened"].as_u64().unwrap() <= 2, "{summary}");
}

/// A loop of ten minutes that logs to `log.csv`, once it runs.
fn feeling(folder: &Path) -> Child {
    let mut child = Command::new(env!("CARGO_BIN_EXE_pegfit"))
        .current_dir(folder)
        .args(["feel", "scene.toml", "--seconds", "600", "--log", "log.csv"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let said = BufReader::new(child.stderr.take().unwrap()).lines();
    let started = |line: std::io::Result<String>| line.unwrap().contains("simulated hand holds");
    assert!(said.into_iter().any(started));
    child
}

#[test]
fn an_interrupted_loop_still_reports() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let log = folder.path().join("log.csv");
    let mut child = feeling(folder.path());
    interrupt(&child);
    let code = child.wait().unwrap().code();
    assert_eq!(code, Some(130));
    assert!(log.exists());
}

/// Sends both signals that end a process, microseconds apart.
fn interrupt_twice(child: &Child) {
    let pid = child.id();
    let status = Command::new("sh")
        .args(["-c", &format!("kill -INT {pid}; kill -TERM {pid}")])
        .status()
        .unwrap();
    assert!(status.success());
}

#[test]
fn a_loop_interrupted_twice_still_ends_well() {
    let folder = scene_folder("[device]\nrealtime = false\n");
    let log = folder.path().join("log.csv");
    let mut child = feeling(folder.path());
    std::thread::sleep(Duration::from_millis(200));
    interrupt_twice(&child);
    assert_eq!(child.wait().unwrap().code(), Some(130));
    // The log appears after the device was stopped.
    assert!(log.exists());
}

/// Where the child of [`a_slow_device_is_stopped_whatever_is_pressed`] leaves its files.
const FOLDER: &str = "PEGFIT_TEST_FOLDER";

/// Takes long to stop, and leaves a file when it runs and one when it has stopped.
struct Slow {
    spec: DeviceSpec,
    folder: PathBuf,
}

impl Device for Slow {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        std::fs::write(self.folder.join("running"), "").unwrap();
        Ok(DeviceState::at_rest(Pose::IDENTITY, now))
    }

    fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        std::thread::sleep(Duration::from_millis(400));
        std::fs::write(self.folder.join("stopped"), "").unwrap();
        Ok(())
    }
}

/// No field at all.
struct Nothing;

impl EnergySource for Nothing {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, _: &Pose, _: &mut Scratch) -> Response {
        Response::default()
    }
}

/// What runs in the child process.
#[test]
#[ignore = "run by another test of this file in a process of its own"]
fn holds_a_slow_device() {
    let Some(folder) = std::env::var_os(FOLDER) else {
        return;
    };
    progress::watch_for_interrupts();
    let _held = Hold::begin();
    let mut device = Slow {
        spec: OperatorConfig::default().spec(),
        folder: folder.into(),
    };
    let config = HapticConfig::default();
    let place = config.workspace(Pose::IDENTITY, Default::default());
    Session::new(config, place)
        .run(
            &mut device,
            &Nothing,
            Clock::Real,
            60.0,
            progress::cancel_flag(),
        )
        .unwrap();
}

#[test]
fn a_slow_device_is_stopped_whatever_is_pressed() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "interrupt::holds_a_slow_device", "--ignored"])
        .env(FOLDER, folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let began = Instant::now();
    while !folder.path().join("running").exists() {
        assert!(began.elapsed() < Duration::from_secs(60), "never ran");
        std::thread::sleep(Duration::from_millis(10));
    }
    interrupt_twice(&child);
    std::thread::sleep(Duration::from_millis(50));
    interrupt_twice(&child);
    child.wait().unwrap();
    assert!(folder.path().join("stopped").exists());
}
