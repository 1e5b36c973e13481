//! Logs as CSV: one row per tick, whole or not at all.

use std::io::Write;
use std::path::{Path, PathBuf};

use fft_correlate::Pose;
use tempfile::NamedTempFile;

use crate::Sample;
use crate::record::{RecordError, SampleWriter};

/// Columns that are empty while there is no input.
const INPUT_COLUMNS: usize = 15;

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

/// A CSV log under a temporary name beside its own.
pub(crate) struct CsvLog {
    path: PathBuf,
    csv: csv::Writer<NamedTempFile>,
    row: Vec<String>,
}

impl CsvLog {
    /// Creates the temporary file.
    pub(crate) fn create(path: &Path) -> Result<Self, RecordError> {
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
        let mut file = self.csv.into_inner().map_err(|e| io(e.into_error()))?;
        file.flush().map_err(io)?;
        file.as_file().sync_all().map_err(io)?;
        file.persist(&path).map_err(|e| io(e.error))?;
        Ok(())
    }

    fn path(&self) -> PathBuf {
        self.path.clone()
    }
}

/// The numbers of a sample in the order of [`COLUMNS`], but for the last, which is text; `None`
/// where there was no input.
pub fn numbers(s: &Sample) -> [Option<f64>; COLUMNS.len() - 1] {
    let input = s.input.as_ref().map(|input| {
        let mut row = [0.0; INPUT_COLUMNS];
        row[..7].copy_from_slice(&pose(&input.pose));
        row[7..10].copy_from_slice(&input.twist.angular.to_array());
        row[10..13].copy_from_slice(&input.twist.linear.to_array());
        row[13..].copy_from_slice(&[f64::from(input.buttons), input.timestamp]);
        row
    });
    let a = &s.account;
    let groups: [&[f64]; 6] = [
        &pose(&s.object),
        &[s.energy, s.coverage],
        &s.wrench.torque.to_array(),
        &s.wrench.force.to_array(),
        &[s.gain, a.balance, a.work_force, a.work_torque, a.made],
        &[
            a.taken,
            a.exchanged,
            f64::from(s.evaluations),
            f64::from(s.flags),
        ],
    ];
    let mut row = [None; COLUMNS.len() - 1];
    let first = [s.tick as f64, s.time, s.dt].map(Some);
    let middle = input.map_or([None; INPUT_COLUMNS], |row| row.map(Some));
    let rest = groups.into_iter().flatten().copied().map(Some);
    let all = first.into_iter().chain(middle).chain(rest);
    row.iter_mut()
        .zip(all)
        .for_each(|(cell, value)| *cell = value);
    row
}

fn pose(pose: &Pose) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.translation.to_array(), pose.rotation.to_array());
    [x, y, z, qx, qy, qz, qw]
}

/// `{}` prints the shortest digits that read back as the same number.
fn fill_row(row: &mut Vec<String>, s: &Sample) {
    let text = |v: Option<f64>| v.map_or_else(String::new, |v| v.to_string());
    row.extend(numbers(s).map(text));
    row.push(faults(s));
}

/// The last of [`COLUMNS`]: names of the flags that are set, with spaces between.
pub fn faults(s: &Sample) -> String {
    let names = crate::flags::NAMES;
    let set = (0..names.len()).filter(|bit| s.flags & (1 << bit) != 0);
    set.map(|bit| names[bit]).collect::<Vec<_>>().join(" ")
}
