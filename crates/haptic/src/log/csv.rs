//! Logs as CSV: one row per tick, whole or not at all.

use std::path::{Path, PathBuf};

use sdf_grid::atomic::AtomicFile;

use crate::log::columns::{COLUMNS, faults, numbers};
use crate::log::error::RecordError;
use crate::log::writer::SampleWriter;
use crate::path::sample::Sample;

/// A CSV log under a temporary name beside its own.
pub(crate) struct CsvLog {
    path: PathBuf,
    csv: csv::Writer<AtomicFile>,
    row: Vec<String>,
}

impl CsvLog {
    /// Creates the temporary file.
    pub(crate) fn create(path: &Path) -> Result<Self, RecordError> {
        let io = |source| RecordError::Io {
            path: path.to_owned(),
            source,
        };
        let file = AtomicFile::create(path).map_err(|e| io(e.into()))?;
        let mut csv = csv::Writer::from_writer(file);
        csv.write_record(COLUMNS).map_err(|e| io(e.into()))?;
        Ok(Self {
            path: path.to_owned(),
            csv,
            row: Vec::with_capacity(COLUMNS.len()),
        })
    }

    fn io(&self, source: std::io::Error) -> RecordError {
        RecordError::Io {
            path: self.path.clone(),
            source,
        }
    }
}

impl SampleWriter for CsvLog {
    fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.row.clear();
        fill_row(&mut self.row, sample);
        self.csv
            .write_record(&self.row)
            .map_err(|e| self.io(e.into()))
    }

    fn finish(self: Box<Self>) -> Result<(), RecordError> {
        let path = self.path.clone();
        let io = |source| RecordError::Io {
            path: path.clone(),
            source,
        };
        let file = self.csv.into_inner().map_err(|e| io(e.into_error()))?;
        file.commit().map_err(|e| io(e.into()))
    }

    fn path(&self) -> PathBuf {
        self.path.clone()
    }
}

/// Writes samples as the CSV that logs are, header first.
///
/// # Errors
/// If `out` refuses.
pub fn write_csv(samples: &[Sample], out: impl std::io::Write) -> std::io::Result<()> {
    let mut csv = csv::Writer::from_writer(out);
    csv.write_record(COLUMNS)?;
    let mut row = Vec::with_capacity(COLUMNS.len());
    for sample in samples {
        row.clear();
        fill_row(&mut row, sample);
        csv.write_record(&row)?;
    }
    csv.flush()
}

/// `{}` prints the shortest digits that read back as the same number.
fn fill_row(row: &mut Vec<String>, s: &Sample) {
    let text = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    row.extend(numbers(s).map(text));
    row.push(faults(s));
}
