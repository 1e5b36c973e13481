//! Logs as CSV: one row per tick, in a file that can be read while it grows.

use std::io::Write;
use std::path::{Path, PathBuf};

use sdf_grid::growing::GrowingFile;

use crate::device::contract::DeviceSpec;
use crate::log::columns::{COLUMNS, faults, numbers};
use crate::log::error::RecordError;
use crate::log::recorded_device::{device_file, write_device};
use crate::log::writer::SampleWriter;
use crate::path::sample::Sample;

/// Bytes of rows that wait in memory at most.
const PIECE: usize = 1 << 18;

/// A CSV log that grows beside its place.
pub(crate) struct CsvLog {
    path: PathBuf,
    file: GrowingFile,
    waiting: Vec<u8>,
    /// In the file.
    ticks: u64,
}

impl CsvLog {
    /// Creates the file in which the log `path` grows.
    pub(crate) fn create(path: &Path) -> Result<Self, RecordError> {
        Self::create_in(path, path)
    }

    /// Creates the file `csv`, in which the log `path` grows that will be of another format.
    pub(crate) fn create_in(csv: &Path, path: &Path) -> Result<Self, RecordError> {
        let file = GrowingFile::create(csv).map_err(|e| RecordError::Io {
            path: path.to_owned(),
            source: e.into(),
        })?;
        Ok(Self {
            path: path.to_owned(),
            file,
            waiting: Vec::with_capacity(PIECE),
            ticks: 0,
        })
    }

    /// The file in which the log grows; `None` if it goes into a device or a pipe.
    pub(crate) fn part(&self) -> Option<&Path> {
        self.file.part()
    }

    /// What is known of a log that ends here.
    pub(crate) fn cut(&self, source: std::io::Error) -> RecordError {
        RecordError::Cut {
            path: self.path.clone(),
            ticks: self.ticks,
            part: self.part().map(Path::to_owned),
            source,
        }
    }

    /// Removes the log, which is somewhere else now.
    #[cfg(feature = "parquet")]
    pub(crate) fn discard(self) -> Result<(), RecordError> {
        self.file.discard().map_err(|e| RecordError::Io {
            path: e.path,
            source: e.source,
        })
    }
}

impl SampleWriter for CsvLog {
    fn begin(&mut self, device: &DeviceSpec) -> Result<(), RecordError> {
        if let Some(part) = self.part() {
            write_device(part, device)?;
        }
        let header = COLUMNS.join(",") + "\n";
        self.file
            .append(header.as_bytes())
            .map_err(|e| self.cut(e.source))
    }

    fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
        push_row(&mut self.waiting, sample);
        match self.waiting.len() < PIECE {
            true => Ok(()),
            false => self.flush(),
        }
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        let appended = self.file.append(&self.waiting);
        let all = self.waiting.len();
        let kept = appended.as_ref().map_or_else(|e| e.kept, |()| all);
        let lines = self.waiting.drain(..kept).filter(|byte| *byte == b'\n');
        self.ticks += lines.count() as u64;
        appended.map_err(|e| self.cut(e.source))
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordError> {
        self.flush()?;
        let Some(part) = self.part().map(Path::to_owned) else {
            return Ok(());
        };
        let Self { path, file, .. } = *self;
        file.finish().map_err(|e| RecordError::Io {
            path: e.path,
            source: e.source,
        })?;
        keep_device(&part, &path)
    }

    fn path(&self) -> PathBuf {
        self.part().unwrap_or(&self.path).to_owned()
    }
}

/// Creates a CSV log, which [`crate::Session::record_to`] does by itself: for who wants to know the
/// name under which it grows ([`SampleWriter::path`]).
///
/// # Errors
/// If the file cannot be created.
pub fn create_csv(path: &Path) -> Result<Box<dyn SampleWriter>, RecordError> {
    Ok(Box::new(CsvLog::create(path)?))
}

/// Puts the record of the device beside the log that has its name now.
pub(crate) fn keep_device(part: &Path, log: &Path) -> Result<(), RecordError> {
    let path = device_file(log);
    std::fs::rename(device_file(part), &path).map_err(|source| RecordError::Io { path, source })
}

/// Writes samples as the CSV that logs are, header first.
///
/// # Errors
/// If `out` refuses.
pub fn write_csv(samples: &[Sample], mut out: impl Write) -> std::io::Result<()> {
    let mut row = (COLUMNS.join(",") + "\n").into_bytes();
    for sample in samples {
        out.write_all(&row)?;
        row.clear();
        push_row(&mut row, sample);
    }
    out.write_all(&row)?;
    out.flush()
}

/// `{}` prints the shortest digits that read back as the same number. Neither these nor the names of
/// flags have anything that CSV would quote.
fn push_row(out: &mut Vec<u8>, sample: &Sample) {
    for number in numbers(sample) {
        if let Some(number) = number {
            // A vector takes all.
            let _ = write!(out, "{number}");
        }
        out.push(b',');
    }
    out.extend_from_slice(faults(sample).as_bytes());
    out.push(b'\n');
}
