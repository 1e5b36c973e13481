//! Logs as CSV: one row per tick, in a file that can be read while it grows, and read back.

use std::fs::File;
use std::io;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use fft_correlate::{Pose, Twist, Wrench};
use glam::{DQuat, DVec3};
use sdf_grid::growing::GrowingFile;

use crate::device::contract::{DeviceSpec, DeviceState};
use crate::log::device_record::{device_file, write_device};
use crate::log::error::RecordError;
use crate::log::record::SampleWriter;
use crate::path::passivity::EnergyAccount;
use crate::path::sample::{Sample, flags};

/// Columns that are empty while there is no input.
const INPUT_COLUMNS: usize = 15;

/// Columns of a log: SI units, device frame unless stated. `object_*` is the virtual object (the
/// moving part) in the scene's frame. Input columns are empty while there was no input.
#[rustfmt::skip]
pub const COLUMNS: [&str; 43] = [
    "tick", "time", "dt",
    "x", "y", "z", "qx", "qy", "qz", "qw", "wx", "wy", "wz", "vx", "vy", "vz",
    "buttons", "timestamp",
    "object_x", "object_y", "object_z", "object_qx", "object_qy", "object_qz", "object_qw",
    "energy", "coverage", "tx", "ty", "tz", "fx", "fy", "fz", "gain",
    "balance", "work_force", "work_torque", "made", "taken", "exchanged",
    "evaluations", "flags", "faults",
];

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

/// The last of [`COLUMNS`]: names of the flags that are set, with spaces between.
pub fn faults(s: &Sample) -> String {
    let names = flags::NAMES;
    let set = (0..names.len()).filter(|bit| s.flags & (1 << bit) != 0);
    set.map(|bit| names[bit]).collect::<Vec<_>>().join(" ")
}

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

/// Bytes in a line at most; a line of a log has some 700.
const LONGEST_LINE: u64 = 1 << 16;

/// A log that was read back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Every tick that is whole.
    pub samples: Vec<Sample>,
    /// The line, counted from 1, that was left out: the last one, which ends in the middle, as
    /// where a run was killed.
    pub torn_line: Option<u64>,
}

/// Reads a log written by [`crate::Session`], also one of a run that did not end (`NAME.part`). A
/// last line that ends in the middle is left out, which the recording says.
///
/// # Errors
/// If the file cannot be read, lacks a column, or holds something that is not a number.
pub fn read_log(path: &Path) -> Result<Recording, RecordError> {
    let file = File::open(path).map_err(|source| RecordError::Io {
        path: path.to_owned(),
        source,
    })?;
    let mut lines = WholeLines::new(file);
    let samples = rows(path, &mut lines)?.collect::<Result<Vec<_>, _>>()?;
    let mut recording = Recording {
        samples,
        torn_line: None,
    };
    if let Some(tail) = lines.tail() {
        match complete_row(tail) {
            Some(sample) => recording.samples.push(sample),
            None => recording.torn_line = Some(recording.samples.len() as u64 + 2),
        }
    }
    Ok(recording)
}

/// The ticks of a log without errors.
pub(crate) fn rows<R: Read>(
    path: &Path,
    from: R,
) -> Result<impl Iterator<Item = Result<Sample, RecordError>>, RecordError> {
    let mut csv = csv::Reader::from_reader(from);
    let headers = csv.headers().map_err(|e| csv_error(path, e))?;
    if headers != COLUMNS.as_slice() {
        return Err(RecordError::Format {
            path: path.to_owned(),
            line: 1,
            expected: COLUMNS.join(","),
            found: headers.iter().collect::<Vec<_>>().join(","),
        });
    }
    let rows = csv.into_records().enumerate();
    Ok(rows.map(move |(index, record)| {
        let record = record.map_err(|e| csv_error(path, e))?;
        parse(&record).map_err(|(expected, found)| RecordError::Format {
            path: path.to_owned(),
            line: index as u64 + 2,
            expected,
            found,
        })
    }))
}

/// A row without its end of line that is whole nevertheless: its last column says what its last
/// number does.
fn complete_row(text: &[u8]) -> Option<Sample> {
    let mut csv = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(text);
    let record = csv.records().next()?.ok()?;
    if record.len() != COLUMNS.len() {
        return None;
    }
    let sample = parse(&record).ok()?;
    (record.get(COLUMNS.len() - 1)? == faults(&sample)).then_some(sample)
}

/// Gives lines that end, and keeps back what follows the last of them.
struct WholeLines<R> {
    inner: BufReader<R>,
    line: Vec<u8>,
    given: usize,
    ended: bool,
}

impl<R: Read> WholeLines<R> {
    fn new(inner: R) -> Self {
        Self {
            inner: BufReader::new(inner),
            line: Vec::new(),
            given: 0,
            ended: false,
        }
    }

    /// What follows the last end of line, once all lines were read.
    fn tail(&self) -> Option<&[u8]> {
        (self.ended && !self.line.is_empty()).then_some(&self.line)
    }

    fn next_line(&mut self) -> io::Result<()> {
        self.line.clear();
        self.given = 0;
        let mut some = self.inner.by_ref().take(LONGEST_LINE);
        some.read_until(b'\n', &mut self.line)?;
        if !self.line.ends_with(b"\n") {
            if self.line.len() as u64 == LONGEST_LINE {
                let text = format!("expected lines of a log, found one of {LONGEST_LINE} bytes");
                return Err(io::Error::new(io::ErrorKind::InvalidData, text));
            }
            self.ended = true;
        }
        Ok(())
    }
}

impl<R: Read> Read for WholeLines<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if !self.ended && self.given == self.line.len() {
            self.next_line()?;
        }
        if self.ended {
            return Ok(0);
        }
        let count = (&self.line[self.given..]).read(out)?;
        self.given += count;
        Ok(count)
    }
}

fn csv_error(path: &Path, error: csv::Error) -> RecordError {
    let line = error.position().map_or(0, csv::Position::line);
    match error.into_kind() {
        csv::ErrorKind::Io(source) => RecordError::Io {
            path: path.to_owned(),
            source,
        },
        kind => RecordError::Format {
            path: path.to_owned(),
            line,
            expected: format!("{} fields of UTF-8 text", COLUMNS.len()),
            found: match kind {
                csv::ErrorKind::UnequalLengths { len, .. } => format!("{len} fields"),
                csv::ErrorKind::Utf8 { .. } => "text that is not UTF-8".to_owned(),
                _ => "none".to_owned(),
            },
        },
    }
}

/// What belongs there and what is there instead.
type Mismatch = (String, String);

fn parse(record: &csv::StringRecord) -> Result<Sample, Mismatch> {
    let number = |column: usize| -> Result<f64, Mismatch> {
        let text = &record[column];
        text.parse()
            .map_err(|_| (format!("a number in {}", COLUMNS[column]), text.to_owned()))
    };
    let vector = |first: usize| -> Result<DVec3, Mismatch> {
        Ok(DVec3::new(
            number(first)?,
            number(first + 1)?,
            number(first + 2)?,
        ))
    };
    let pose = |first: usize| -> Result<Pose, Mismatch> {
        let (q, w) = (vector(first + 3)?, number(first + 6)?);
        Ok(Pose {
            rotation: DQuat::from_xyzw(q.x, q.y, q.z, w),
            translation: vector(first)?,
        })
    };
    let input = if record[3].is_empty() {
        None
    } else {
        Some(DeviceState {
            pose: pose(3)?,
            twist: Twist {
                angular: vector(10)?,
                linear: vector(13)?,
            },
            buttons: count(record, 16)?,
            timestamp: number(17)?,
        })
    };
    Ok(Sample {
        tick: count(record, 0)?,
        time: number(1)?,
        dt: number(2)?,
        input,
        object: pose(18)?,
        energy: number(25)?,
        coverage: number(26)?,
        wrench: Wrench {
            torque: vector(27)?,
            force: vector(30)?,
        },
        gain: number(33)?,
        account: EnergyAccount {
            balance: number(34)?,
            work_force: number(35)?,
            work_torque: number(36)?,
            made: number(37)?,
            taken: number(38)?,
            exchanged: number(39)?,
        },
        evaluations: count(record, 40)?,
        flags: count(record, 41)?,
    })
}

fn count<T: std::str::FromStr>(record: &csv::StringRecord, column: usize) -> Result<T, Mismatch> {
    let text = &record[column];
    let mismatch = |_| (format!("a count in {}", COLUMNS[column]), text.to_owned());
    text.parse().map_err(mismatch)
}
