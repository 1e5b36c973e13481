//! Reading a log back.

use std::path::Path;

use fft_correlate::{Pose, Twist, Wrench};
use glam::{DQuat, DVec3};

use crate::device::contract::DeviceState;
use crate::log::columns::COLUMNS;
use crate::log::error::RecordError;
use crate::path::passivity::EnergyAccount;
use crate::path::sample::Sample;

/// Reads every sample of a log written by [`crate::Session`].
///
/// # Errors
/// If the file cannot be read, lacks a column, or holds something that is not a number.
pub fn read_log(path: &Path) -> Result<Vec<Sample>, RecordError> {
    let mut csv = csv::Reader::from_path(path).map_err(|e| broken(path, e))?;
    let headers = csv.headers().map_err(|e| broken(path, e))?;
    if headers != COLUMNS.as_slice() {
        return Err(RecordError::Format {
            path: path.to_owned(),
            line: 1,
            expected: COLUMNS.join(","),
            found: headers.iter().collect::<Vec<_>>().join(","),
        });
    }
    csv.records()
        .enumerate()
        .map(|(index, record)| {
            let record = record.map_err(|e| broken(path, e))?;
            parse(&record).map_err(|(expected, found)| RecordError::Format {
                path: path.to_owned(),
                line: index as u64 + 2,
                expected,
                found,
            })
        })
        .collect()
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

fn parse(record: &csv::StringRecord) -> Result<Sample, (String, String)> {
    let number = |column: usize| -> Result<f64, (String, String)> {
        let text = &record[column];
        text.parse()
            .map_err(|_| (format!("a number in {}", COLUMNS[column]), text.to_owned()))
    };
    let vector = |first: usize| -> Result<DVec3, (String, String)> {
        Ok(DVec3::new(
            number(first)?,
            number(first + 1)?,
            number(first + 2)?,
        ))
    };
    let pose = |first: usize| -> Result<Pose, (String, String)> {
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
            buttons: number(16)? as u32,
            timestamp: number(17)?,
        })
    };
    Ok(Sample {
        tick: number(0)? as u64,
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
        evaluations: number(40)? as u32,
        flags: number(41)? as u16,
    })
}
