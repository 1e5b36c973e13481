//! Logs: samples leave the loop through a ring and are written by a thread of their own.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use crate::Sample;
pub use crate::csv_log::{COLUMNS, numbers};

/// Samples the ring holds: 16 s at 1 kHz.
const RING: usize = 16_384;

/// Sleep of the writing thread while the ring is empty.
const REST: Duration = Duration::from_millis(2);

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

/// A file format for logs, written by the log's own thread.
pub trait SampleWriter: Send {
    /// Takes the next sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError>;

    /// Puts the file, whole, in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    fn finish(self: Box<Self>) -> Result<(), RecordError>;

    /// The file, for messages.
    fn path(&self) -> PathBuf;
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

/// Starts the writing thread, which writes to `file` and keeps every sample if `keep` says so.
pub(crate) fn start(
    file: Option<Box<dyn SampleWriter>>,
    keep: bool,
    patient: bool,
) -> Result<(Recorder, Writer), RecordError> {
    let (ring, drain) = RingBuffer::new(RING);
    let done = Arc::new(AtomicBool::new(false));
    let path = file.as_ref().map_or_else(|| "memory".into(), |f| f.path());
    let stop = Arc::clone(&done);
    let thread = std::thread::Builder::new()
        .name("haptic-log".into())
        .spawn(move || write_all(drain, &stop, file, keep))
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

fn write_all(
    ring: Consumer<Sample>,
    done: &AtomicBool,
    mut file: Option<Box<dyn SampleWriter>>,
    keep: bool,
) -> Result<Vec<Sample>, RecordError> {
    let mut samples = Vec::new();
    drain(ring, done, |sample| {
        if keep {
            samples.push(*sample);
        }
        match &mut file {
            Some(file) => file.write(sample),
            None => Ok(()),
        }
    })?;
    if let Some(file) = file {
        file.finish()?;
    }
    Ok(samples)
}
