//! Logs of runs that do not end well: what was recorded is kept, and can be replayed.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use fft_correlate::{Pose, Wrench};
use haptic::log::{device_file, read_device};
use haptic::{
    Clock, Device, DeviceError, DeviceSpec, DeviceState, HapticConfig, HapticError, OperatorConfig,
    RecordError, Replay, Session, read_log,
};

use crate::common::{Well, workspace};

/// Where a child leaves its files.
const FOLDER: &str = "HAPTIC_TEST_FOLDER";

/// Seconds of simulated time that a child runs.
const SECONDS: &str = "HAPTIC_TEST_SECONDS";

/// A hand that swings, and leaves a file when it was told to stop.
struct Swinging {
    spec: DeviceSpec,
    folder: PathBuf,
}

impl Device for Swinging {
    fn spec(&self) -> &DeviceSpec {
        &self.spec
    }

    fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
        let x = 0.01 * (6.0 * now).sin();
        Ok(DeviceState::at_rest(
            Pose::from_translation([x, 0.0, 0.0].into()),
            now,
        ))
    }

    fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
        Ok(())
    }

    fn stop_all(&mut self) -> Result<(), DeviceError> {
        std::fs::write(self.folder.join("stopped"), "").unwrap();
        Ok(())
    }
}

fn record(folder: &Path, log: &Path, seconds: f64, clock: Clock) -> Result<u64, HapticError> {
    let mut device = Swinging {
        spec: OperatorConfig::default().spec(),
        folder: folder.to_owned(),
    };
    let stop = AtomicBool::new(false);
    Session::new(HapticConfig::default(), workspace())
        .record_to(log)
        .run(&mut device, &Well::default(), clock, seconds, &stop)
        .map(|outcome| outcome.report.ticks)
}

/// What runs in a child process.
#[test]
#[ignore = "run by other tests of this file in a process of its own"]
fn records_in_a_process_of_its_own() {
    let Some(folder) = std::env::var_os(FOLDER).map(PathBuf::from) else {
        return;
    };
    let seconds = std::env::var(SECONDS).unwrap().parse().unwrap();
    let clock = match seconds < 100.0 {
        true => Clock::Simulated,
        false => Clock::Real,
    };
    let ended = record(&folder, &folder.join("run.csv"), seconds, clock);
    let said = ended.map_or_else(|e| e.to_string(), |ticks| format!("{ticks} ticks"));
    std::fs::write(folder.join("said"), said).unwrap();
}

/// The child, started by a shell that does `first` before.
fn child(folder: &Path, seconds: &str, first: &str) -> Command {
    let mut command = Command::new("sh");
    command
        .args(["-c", &format!("{first} exec \"$0\" \"$@\"")])
        .arg(std::env::current_exe().unwrap())
        .args(["--exact", "logs::records_in_a_process_of_its_own"])
        .args(["--ignored", "--test-threads=1"])
        .env(FOLDER, folder)
        .env(SECONDS, seconds)
        .stdout(Stdio::null());
    command
}

/// Replays what is left in `part`; gives how many ticks.
fn replays(part: &Path) -> u64 {
    let samples = read_log(part).unwrap().samples;
    let spec = read_device(part).unwrap().expect("the device's record");
    let config = HapticConfig::default();
    let mut replay = Replay::new(spec, samples.clone(), &config).unwrap();
    let stop = AtomicBool::new(false);
    let again = Session::new(config, workspace())
        .keep_samples()
        .replay(&mut replay, &Well::default(), f64::INFINITY, &stop)
        .unwrap();
    assert_eq!(again.samples, samples);
    samples.len() as u64
}

#[test]
fn a_limit_on_the_size_of_files_cuts_the_log_and_stops_the_device() {
    // Blocks of 512 bytes: a row and a half, and many.
    for blocks in [2, 100] {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let (log, part) = (root.join("run.csv"), root.join("run.csv.part"));
        std::fs::write(&log, "old").unwrap();
        let limit = format!("ulimit -f {blocks};");
        let status: ExitStatus = child(root, "20", &limit).status().unwrap();
        assert!(status.success(), "{blocks}: {status}");
        assert!(root.join("stopped").exists());
        let said = std::fs::read_to_string(root.join("said")).unwrap();
        let cut = format!("{} was cut short: File too large", log.display());
        assert!(said.contains(&cut), "{said}");
        assert!(said.contains(&part.display().to_string()), "{said}");
        assert!(std::fs::read_to_string(&part).unwrap().ends_with('\n'));
        let ticks = replays(&part);
        assert!(said.contains(&format!("first {ticks} ticks")), "{said}");
        assert!(ticks >= blocks / 2, "{ticks}");
        assert_eq!(std::fs::read_to_string(&log).unwrap(), "old");
    }
}

#[test]
fn a_killed_run_leaves_its_log_up_to_the_last_moments() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let mut run = child(root, "1000", "").spawn().unwrap();
    let part = root.join("run.csv.part");
    let lines = || std::fs::read_to_string(&part).map_or(0, |text| text.lines().count());
    let began = Instant::now();
    while lines() < 300 {
        assert!(began.elapsed() < Duration::from_secs(100), "no log grows");
        std::thread::sleep(Duration::from_millis(10));
    }
    // SIGKILL.
    run.kill().unwrap();
    run.wait().unwrap();
    assert!(replays(&part) >= 299);
    assert!(!root.join("run.csv").exists());
    // The next run leaves it alone.
    let kept = std::fs::read(&part).unwrap();
    let log = root.join("run.csv");
    record(root, &log, 0.01, Clock::Simulated).unwrap();
    assert_eq!(std::fs::read(&part).unwrap(), kept);
    assert_eq!(read_log(&log).unwrap().samples.len(), 10);
    assert!(device_file(&log).exists() && !root.join("run.csv.1.part").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_device_is_told_after_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let ended = record(folder.path(), Path::new("/dev/full"), 0.1, Clock::Simulated);
    let said = ended.unwrap_err();
    assert!(
        matches!(
            &said,
            HapticError::Record(RecordError::Cut { part: None, .. })
        ),
        "{said}"
    );
    assert!(!Path::new("/dev/full.device.json").exists());
}

#[test]
fn a_last_line_that_ends_in_the_middle_is_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("run.csv");
    record(folder.path(), &log, 0.02, Clock::Simulated).unwrap();
    let text = std::fs::read_to_string(&log).unwrap();
    let whole = read_log(&log).unwrap();
    assert_eq!((whole.samples.len(), whole.torn_line), (20, None));
    let last = text.trim_end().rfind('\n').unwrap() + 1;
    for end in last..=text.len() {
        std::fs::write(&log, &text[..end]).unwrap();
        let read = read_log(&log).unwrap();
        // Whole lines, and a last one that lacks its end only.
        let (ticks, torn) = match end {
            end if end == last => (19, None),
            end if end + 1 >= text.len() => (20, None),
            _ => (19, Some(21)),
        };
        assert_eq!((read.samples.len(), read.torn_line), (ticks, torn), "{end}");
        assert_eq!(read.samples[..], whole.samples[..ticks]);
    }
    // Torn where it begins, there is no log.
    for end in [0, 5, 100] {
        std::fs::write(&log, &text[..end]).unwrap();
        assert!(matches!(
            read_log(&log),
            Err(RecordError::Format { line: 1, .. })
        ));
    }
    // A broken line in the middle is no torn one.
    let broken = text.replacen(",0.001,", ",", 1);
    std::fs::write(&log, broken).unwrap();
    assert!(matches!(
        read_log(&log),
        Err(RecordError::Format { line: 2, .. })
    ));
}
