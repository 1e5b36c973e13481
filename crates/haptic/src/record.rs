//! Logs: samples leave the loop through a ring and are written by a thread of their own.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use fft_correlate::Pose;
use rtrb::{Consumer, Producer, RingBuffer};
use tempfile::NamedTempFile;

use crate::Sample;

/// Samples the ring holds: 16 s at 1 kHz.
const RING: usize = 16_384;

/// Sleep of the writing thread while the ring is empty.
const REST: Duration = Duration::from_millis(2);

/// Columns of a log: SI units, device frame unless stated. `object_*` is the virtual object (the
/// moving part) in the scene's frame. Input columns are empty while there was no input.
pub const COLUMNS: [&str; 43] = [
    "tick",
    "time",
    "dt",
    "x",
    "y",
    "z",
    "qx",
    "qy",
    "qz",
    "qw",
    "wx",
    "wy",
    "wz",
    "vx",
    "vy",
    "vz",
    "buttons",
    "timestamp",
    "object_x",
    "object_y",
    "object_z",
    "object_qx",
    "object_qy",
    "object_qz",
    "object_qw",
    "energy",
    "coverage",
    "tx",
    "ty",
    "tz",
    "fx",
    "fy",
    "fz",
    "gain",
    "balance",
    "work_force",
    "work_torque",
    "made",
    "taken",
    "exchanged",
    "evaluations",
    "flags",
    "faults",
];

/// Why a log could not be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The log.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// The file is not such a log.
    #[error("{} line {line}: expected {expected}, found {found}", path.display())]
    Format {
        /// The log.
        path: PathBuf,
        /// Counted from 1.
        line: u64,
        /// What belongs there.
        expected: String,
        /// What is there.
        found: String,
    },
    /// The writing thread panicked.
    #[error("the log writer of {} failed: {reason}", path.display())]
    Writer {
        /// The log.
        path: PathBuf,
        /// The panic's message.
        reason: String,
    },
}

/// Where samples go.
pub(crate) enum Sink {
    /// A CSV file, there whole or not at all.
    File(PathBuf),
    /// Memory, given back at the end.
    Memory,
}

/// The loop's end of a recording: neither blocks nor allocates.
pub(crate) struct Recorder {
    ring: Producer<Sample>,
    /// Wait for room rather than drop: in simulated time nobody is kept waiting.
    patient: bool,
    pub(crate) dropped: u64,
}

impl Recorder {
    pub(crate) fn record(&mut self, sample: &Sample) {
        while self.patient && self.ring.is_full() && !self.ring.is_abandoned() {
            std::thread::yield_now();
        }
        if self.ring.push(*sample).is_err() {
            self.dropped += 1;
        }
    }
}

/// The writing thread.
pub(crate) struct Writer {
    thread: JoinHandle<Result<Vec<Sample>, RecordError>>,
    done: Arc<AtomicBool>,
    path: PathBuf,
}

/// Starts the writing thread. The file is created at once, so that a bad path is told before the
/// run.
pub(crate) fn start(sink: Sink, patient: bool) -> Result<(Recorder, Writer), RecordError> {
    let (ring, drain) = RingBuffer::new(RING);
    let done = Arc::new(AtomicBool::new(false));
    let (path, file) = match sink {
        Sink::File(path) => {
            let file = LogFile::create(&path)?;
            (path, Some(file))
        }
        Sink::Memory => (PathBuf::from("memory"), None),
    };
    let stop = Arc::clone(&done);
    let thread = std::thread::Builder::new()
        .name("haptic-log".into())
        .spawn(move || match file {
            Some(file) => write_all(drain, &stop, file).map(|()| Vec::new()),
            None => Ok(collect(drain, &stop)),
        })
        .map_err(|source| RecordError::Io {
            path: path.clone(),
            source,
        })?;
    let recorder = Recorder {
        ring,
        patient,
        dropped: 0,
    };
    Ok((recorder, Writer { thread, done, path }))
}

impl Writer {
    /// Waits until everything is written; gives the samples if they were kept in memory.
    pub(crate) fn finish(self) -> Result<Vec<Sample>, RecordError> {
        self.done.store(true, Ordering::Release);
        self.thread.join().unwrap_or_else(|panic| {
            Err(RecordError::Writer {
                path: self.path,
                reason: crate::servo::panic_message(panic.as_ref()),
            })
        })
    }
}

/// Hands every sample to `take` until the loop is done and the ring empty.
fn drain(
    mut ring: Consumer<Sample>,
    done: &AtomicBool,
    mut take: impl FnMut(&Sample) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    loop {
        // Read before draining: what was pushed before `done` was set is then seen.
        let last = done.load(Ordering::Acquire) || ring.is_abandoned();
        while let Ok(sample) = ring.pop() {
            take(&sample)?;
        }
        if last {
            return Ok(());
        }
        std::thread::sleep(REST);
    }
}

fn collect(ring: Consumer<Sample>, done: &AtomicBool) -> Vec<Sample> {
    let mut samples = Vec::new();
    // The closure never fails.
    let _ = drain(ring, done, |sample| {
        samples.push(*sample);
        Ok(())
    });
    samples
}

fn write_all(
    ring: Consumer<Sample>,
    done: &AtomicBool,
    mut file: LogFile,
) -> Result<(), RecordError> {
    drain(ring, done, |sample| file.write(sample))?;
    file.finish()
}

/// A CSV log under a temporary name beside its own.
struct LogFile {
    path: PathBuf,
    csv: csv::Writer<NamedTempFile>,
    row: Vec<String>,
}

impl LogFile {
    fn create(path: &Path) -> Result<Self, RecordError> {
        let io = |source| RecordError::Io {
            path: path.to_owned(),
            source,
        };
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let file = NamedTempFile::new_in(folder).map_err(io)?;
        // Temporary files are made for their owner only; a log is an ordinary file.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = std::fs::Permissions::from_mode(0o644);
            file.as_file().set_permissions(mode).map_err(io)?;
        }
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record(COLUMNS).map_err(|e| io(e.into()))?;
        Ok(Self {
            path: path.to_owned(),
            csv,
            row: Vec::with_capacity(COLUMNS.len()),
        })
    }

    fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.row.clear();
        fill_row(&mut self.row, sample);
        self.csv
            .write_record(&self.row)
            .map_err(|e| self.io(e.into()))
    }

    fn finish(self) -> Result<(), RecordError> {
        let path = self.path.clone();
        let io = |source| RecordError::Io {
            path: path.clone(),
            source,
        };
        let mut file = self.csv.into_inner().map_err(|e| io(e.into_error()))?;
        file.flush().map_err(io)?;
        file.as_file().sync_all().map_err(io)?;
        file.persist(&path).map_err(|e| io(e.error))?;
        Ok(())
    }

    fn io(&self, source: std::io::Error) -> RecordError {
        RecordError::Io {
            path: self.path.clone(),
            source,
        }
    }
}

fn fill_row(row: &mut Vec<String>, s: &Sample) {
    put(row, &[s.tick as f64, s.time, s.dt]);
    match &s.input {
        Some(input) => {
            put_pose(row, &input.pose);
            put(row, &input.twist.angular.to_array());
            put(row, &input.twist.linear.to_array());
            put(row, &[f64::from(input.buttons), input.timestamp]);
        }
        None => row.extend(std::iter::repeat_n(String::new(), 15)),
    }
    put_pose(row, &s.object);
    put(row, &[s.energy, s.coverage]);
    put(row, &s.wrench.torque.to_array());
    put(row, &s.wrench.force.to_array());
    let a = &s.account;
    put(row, &[s.gain, a.balance, a.work_force, a.work_torque]);
    put(row, &[a.made, a.taken, a.exchanged]);
    put(row, &[f64::from(s.evaluations), f64::from(s.flags)]);
    let names = crate::flags::NAMES;
    let set = (0..names.len()).filter(|bit| s.flags & (1 << bit) != 0);
    row.push(set.map(|bit| names[bit]).collect::<Vec<_>>().join(" "));
}

fn put_pose(row: &mut Vec<String>, pose: &Pose) {
    put(row, &pose.translation.to_array());
    put(row, &pose.rotation.to_array());
}

/// `{}` prints the shortest digits that read back as the same number.
fn put(row: &mut Vec<String>, values: &[f64]) {
    row.extend(values.iter().map(ToString::to_string));
}
