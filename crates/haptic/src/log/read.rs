//! Reading a log back.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use fft_correlate::{Pose, Twist, Wrench};
use glam::{DQuat, DVec3};

use crate::device::contract::DeviceState;
use crate::log::columns::{COLUMNS, faults};
use crate::log::error::RecordError;
use crate::path::passivity::EnergyAccount;
use crate::path::sample::Sample;

/// Bytes in a line at most; a line of a log has some 700.
const LONGEST_LINE: u64 = 1 << 16;

/// A log that was read back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Every tick that is whole.
    pub samples: Vec<Sample>,
    /// The line, counted from 1, that was left out: the last one, which ends in the middle, as where
    /// a run was killed.
    pub torn_line: Option<u64>,
}

/// Reads a log written by [`crate::Session`], also one of a run that did not end (`NAME.part`). A last
/// line that ends in the middle is left out, which the recording says.
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
        match whole_row(tail) {
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
    let headers = csv.headers().map_err(|e| broken(path, e))?;
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
        let record = record.map_err(|e| broken(path, e))?;
        parse(&record).map_err(|(expected, found)| RecordError::Format {
            path: path.to_owned(),
            line: index as u64 + 2,
            expected,
            found,
        })
    }))
}

/// A row without its end of line that is whole nevertheless: its last column says what its last number
/// does.
fn whole_row(text: &[u8]) -> Option<Sample> {
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

fn broken(path: &Path, error: csv::Error) -> RecordError {
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
            found: format!("{kind:?}"),
        },
    }
}

/// What belongs there and what is there instead.
type Unfit = (String, String);

fn parse(record: &csv::StringRecord) -> Result<Sample, Unfit> {
    let number = |column: usize| -> Result<f64, Unfit> {
        let text = &record[column];
        text.parse()
            .map_err(|_| (format!("a number in {}", COLUMNS[column]), text.to_owned()))
    };
    let vector = |first: usize| -> Result<DVec3, Unfit> {
        Ok(DVec3::new(
            number(first)?,
            number(first + 1)?,
            number(first + 2)?,
        ))
    };
    let pose = |first: usize| -> Result<Pose, Unfit> {
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
            buttons: whole(record, 16)?,
            timestamp: number(17)?,
        })
    };
    Ok(Sample {
        tick: whole(record, 0)?,
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
        evaluations: whole(record, 40)?,
        flags: whole(record, 41)?,
    })
}

fn whole<T: std::str::FromStr>(record: &csv::StringRecord, column: usize) -> Result<T, Unfit> {
    let text = &record[column];
    let unfit = |_| (format!("a count in {}", COLUMNS[column]), text.to_owned());
    text.parse().map_err(unfit)
}
