//! Logs: samples leave the loop through a ring, wait in memory while the disk is busy, and are
//! written by a thread of their own. A disk that stands still for ten minutes loses nothing and
//! holds nobody up.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use crate::device::contract::DeviceSpec;
use crate::log::error::RecordError;
use crate::panics::panic_message;
use crate::path::sample::Sample;

/// Samples the ring holds: 16 s at 1 kHz, for the time that the collecting thread gets no
/// processor.
const RING: usize = 16_384;

/// Samples that may wait in memory for the disk: ten minutes at 1 kHz, some 250 MB.
const WAITING: usize = 600_000;

/// As many in simulated time, where the loop waits instead.
const WAITING_SIMULATED: usize = 65_536;

/// Sleep of the collecting thread while the ring is empty.
const REST: Duration = Duration::from_millis(2);

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

/// The threads that collect and write.
pub(crate) struct Writer {
    collecting: JoinHandle<Vec<Sample>>,
    writing: Option<WriterThread>,
    done: Arc<AtomicBool>,
    path: PathBuf,
}

/// Starts the threads, which write to `file` what `device` does, and keep every sample if `keep`
/// says so.
pub(crate) fn start(
    file: Option<Box<dyn SampleWriter>>,
    device: &DeviceSpec,
    keep: bool,
    patient: bool,
) -> Result<(Recorder, Writer), RecordError> {
    let (ring, drain) = RingBuffer::new(RING);
    let done = Arc::new(AtomicBool::new(false));
    let path = file.as_ref().map_or_else(|| "memory".into(), |f| f.path());
    let failed = |source| RecordError::Io {
        path: path.clone(),
        source,
    };
    let (mut batches, mut writing) = (None, None);
    if let Some(file) = file {
        // Room for one batch beside the one being written; the rest waits with the collector.
        let (sender, receiver) = sync_channel(1);
        let thread = begin(file, receiver, device).map_err(failed)??;
        (batches, writing) = (Some(sender), Some(thread));
    }
    let collector = Collector {
        ring: drain,
        batches,
        waiting: Vec::new(),
        room: if patient { WAITING_SIMULATED } else { WAITING },
        kept: keep.then(Vec::new),
    };
    let stop = Arc::clone(&done);
    let collecting = std::thread::Builder::new()
        .name("haptic-collect".into())
        .spawn(move || collector.run(&stop))
        .map_err(failed)?;
    let recorder = Recorder {
        ring,
        patient,
        dropped: 0,
    };
    let writer = Writer {
        collecting,
        writing,
        done,
        path,
    };
    Ok((recorder, writer))
}

impl Writer {
    /// Waits until everything is written; gives the samples if they were kept in memory.
    pub(crate) fn finish(self) -> Result<Vec<Sample>, RecordError> {
        self.done.store(true, Ordering::Release);
        let panicked = |panic: Box<dyn std::any::Any + Send>| RecordError::Writer {
            path: self.path.clone(),
            reason: panic_message(panic.as_ref()),
        };
        let kept = self.collecting.join().map_err(panicked)?;
        if let Some(writing) = self.writing {
            writing.join().map_err(panicked)??;
        }
        Ok(kept)
    }
}

/// Empties the ring, whatever the disk does.
struct Collector {
    ring: Consumer<Sample>,
    batches: Option<SyncSender<Vec<Sample>>>,
    waiting: Vec<Sample>,
    room: usize,
    kept: Option<Vec<Sample>>,
}

impl Collector {
    /// Until the loop is done and the ring empty.
    fn run(mut self, done: &AtomicBool) -> Vec<Sample> {
        loop {
            // Read before collecting: what was pushed before `done` was set is then seen.
            let last = done.load(Ordering::Acquire) || self.ring.is_abandoned();
            self.collect();
            self.hand_on();
            if last && self.ring.is_empty() {
                break;
            }
            std::thread::sleep(REST);
        }
        if let Some(batches) = self.batches {
            // Refused by a writer that has failed, which says so itself.
            let _ = batches.send(self.waiting);
        }
        self.kept.unwrap_or_default()
    }

    fn collect(&mut self) {
        while self.waiting.len() < self.room {
            let Ok(sample) = self.ring.pop() else {
                return;
            };
            if let Some(kept) = &mut self.kept {
                kept.push(sample);
            }
            if self.batches.is_some() {
                self.waiting.push(sample);
            }
        }
    }

    /// Gives what waits to the writer if it has room; after it failed, to nobody.
    fn hand_on(&mut self) {
        let Some(batches) = &self.batches else {
            return;
        };
        if self.waiting.is_empty() {
            return;
        }
        match batches.try_send(std::mem::take(&mut self.waiting)) {
            Ok(()) => {}
            Err(TrySendError::Full(batch)) => self.waiting = batch,
            Err(TrySendError::Disconnected(_)) => self.batches = None,
        }
    }
}

type WriterThread = JoinHandle<Result<(), RecordError>>;

/// Starts the thread that writes; its first words are written when this returns.
fn begin(
    mut file: Box<dyn SampleWriter>,
    batches: Receiver<Vec<Sample>>,
    device: &DeviceSpec,
) -> std::io::Result<Result<WriterThread, RecordError>> {
    let device = device.clone();
    let (sender, begun) = sync_channel(1);
    let thread = std::thread::Builder::new().name("haptic-log".into());
    let writing = thread.spawn(move || {
        report_size_limit_as_error();
        let first = file.begin(&device);
        let failed = first.is_err();
        // Refused by nobody: who started this waits for it.
        let _ = sender.send(first);
        match failed {
            true => Ok(()),
            false => write_all(&batches, file),
        }
    })?;
    Ok(match begun.recv() {
        Ok(Err(error)) => Err(error),
        // The thread reports a panic itself when it is joined.
        Ok(Ok(())) | Err(_) => Ok(writing),
    })
}

fn write_all(
    batches: &Receiver<Vec<Sample>>,
    mut file: Box<dyn SampleWriter>,
) -> Result<(), RecordError> {
    for batch in batches {
        batch.iter().try_for_each(|sample| file.write(sample))?;
        file.flush()?;
    }
    file.finish()
}

/// A file format for logs, written by the log's own thread.
pub trait SampleWriter: Send {
    /// Takes what the device of the run can do, before the first sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn begin(&mut self, device: &DeviceSpec) -> Result<(), RecordError> {
        let _ = device;
        Ok(())
    }

    /// Takes the next sample.
    ///
    /// # Errors
    /// If it cannot be written.
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError>;

    /// Hands all that was taken to the system, so that it is there whatever ends this process.
    /// Called many times a second.
    ///
    /// # Errors
    /// If it cannot be written.
    fn flush(&mut self) -> Result<(), RecordError> {
        Ok(())
    }

    /// Puts the file, whole, in its place.
    ///
    /// # Errors
    /// If it cannot be written.
    fn finish(self: Box<Self>) -> Result<(), RecordError>;

    /// The file that is written to while the loop runs, for messages.
    fn path(&self) -> PathBuf;
}

/// From now on a file that this thread writes beyond the limit is an error of the write.
///
/// The signal is meant for the thread that writes; kept back, it goes with the thread. What the
/// process as a whole does with the signal is not a library's to decide.
#[cfg(unix)]
fn report_size_limit_as_error() {
    // SAFETY: both calls get a set that lives through them; the second changes nothing but which
    // signals this thread keeps back.
    unsafe {
        let mut kept_back = std::mem::zeroed();
        libc::sigemptyset(&raw mut kept_back);
        libc::sigaddset(&raw mut kept_back, libc::SIGXFSZ);
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const kept_back, std::ptr::null_mut());
    }
}

#[cfg(not(unix))]
fn report_size_limit_as_error() {}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    use crate::device::simulated::OperatorConfig;

    fn device() -> DeviceSpec {
        OperatorConfig::default().spec()
    }

    /// Does not take the second sample before it may; then keeps the numbers of all it gets.
    struct StandsStill {
        ticks: Arc<Mutex<Vec<u64>>>,
        may: Receiver<()>,
    }

    impl SampleWriter for StandsStill {
        fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
            let mut ticks = self.ticks.lock().unwrap();
            if ticks.len() == 1 {
                self.may.recv().unwrap();
            }
            ticks.push(sample.tick);
            Ok(())
        }

        fn finish(self: Box<Self>) -> Result<(), RecordError> {
            Ok(())
        }

        fn path(&self) -> PathBuf {
            "nowhere".into()
        }
    }

    #[test]
    fn a_disk_that_stands_still_loses_nothing_and_holds_nobody_up() {
        let ticks = Arc::default();
        let (go, may) = sync_channel(1);
        let file = StandsStill {
            ticks: Arc::clone(&ticks),
            may,
        };
        let (mut recorder, writer) = start(Some(Box::new(file)), &device(), true, false).unwrap();
        // Three times what the ring holds, in pieces that the collector has time to fetch.
        let count = 3 * RING as u64;
        for tick in 0..count {
            recorder.record(&Sample {
                tick,
                ..Sample::default()
            });
            while tick % 1024 == 0 && recorder.ring.slots() < RING / 2 {
                std::thread::sleep(REST);
            }
        }
        assert_eq!(recorder.dropped, 0);
        // Everything was recorded while the disk stood still.
        assert!(ticks.try_lock().is_err() || ticks.lock().unwrap().len() <= 1);
        go.send(()).unwrap();
        let kept = writer.finish().unwrap();
        let all: Vec<u64> = (0..count).collect();
        assert_eq!(*ticks.lock().unwrap(), all);
        assert!(kept.iter().map(|s| s.tick).eq(all));
    }

    /// Fails at the first sample.
    struct Full;

    impl SampleWriter for Full {
        fn write(&mut self, _: &Sample) -> Result<(), RecordError> {
            Err(RecordError::Io {
                path: self.path(),
                source: std::io::ErrorKind::StorageFull.into(),
            })
        }

        fn finish(self: Box<Self>) -> Result<(), RecordError> {
            panic!("finished a log that failed")
        }

        fn path(&self) -> PathBuf {
            "nowhere".into()
        }
    }

    #[test]
    fn a_full_disk_is_told_at_the_end_and_keeps_nobody_waiting() {
        for patient in [false, true] {
            let (mut recorder, writer) =
                start(Some(Box::new(Full)), &device(), true, patient).unwrap();
            for tick in 0..2 * WAITING_SIMULATED as u64 {
                recorder.record(&Sample {
                    tick,
                    ..Sample::default()
                });
            }
            let told = writer.finish().unwrap_err().to_string();
            assert!(told.starts_with("nowhere: "), "{told}");
        }
    }
}
