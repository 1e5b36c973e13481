//! Poses and scores as comma-separated rows.
//!
//! Input columns are `x, y, z` (metres) and `qx, qy, qz, qw`, found by the header in any order;
//! other columns are passed over. Output rows repeat the pose and add what was evaluated.

use std::io::Read;

use fft_correlate::{Pose, Response};
use glam::{DQuat, DVec3};

use crate::file::values::quaternion;

/// Columns of a pose, in the order they are written.
pub const POSE_COLUMNS: [&str; 7] = ["x", "y", "z", "qx", "qy", "qz", "qw"];

/// Columns that scoring adds: score (cubic metres, its imaginary part empty where the source is a
/// table), energy (joules), torque (newton metres), force (newtons), coverage (0 to 1).
pub const SCORE_COLUMNS: [&str; 10] = [
    "score_re", "score_im", "energy", "tx", "ty", "tz", "fx", "fy", "fz", "coverage",
];

/// Column that is added when the condition number of the score is asked for (1 and above).
pub const CONDITION_COLUMN: &str = "condition";

/// Why rows of poses cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// A column is missing, or a value is not acceptable.
    #[error("{file}: {item}: expected {expected}, found {found}")]
    Value {
        /// What the file is called.
        file: String,
        /// `header`, or the row, counted from 1, and the column.
        item: String,
        /// What would have been accepted.
        expected: String,
        /// What was there.
        found: String,
    },
    /// The text is not that of a table, or cannot be read.
    #[error("{place}")]
    Rows {
        /// The file, and the row if it is known.
        place: String,
        /// Why.
        source: csv::Error,
    },
}

/// Reads poses row by row.
pub struct PoseReader<R: Read> {
    name: String,
    columns: [usize; 7],
    rows: csv::Reader<R>,
    record: csv::StringRecord,
    row: u64,
}

impl<R: Read> PoseReader<R> {
    /// Reads the header; `name` is what errors call the file.
    ///
    /// # Errors
    /// If the header cannot be read or a pose column is missing.
    pub fn new(name: &str, input: R) -> Result<Self, PoseError> {
        let mut rows = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(input);
        let header = rows
            .headers()
            .map_err(|source| PoseError::Rows {
                place: name.to_owned(),
                source,
            })?
            .clone();
        let mut columns = [0; 7];
        for (column, wanted) in columns.iter_mut().zip(POSE_COLUMNS) {
            *column = header
                .iter()
                .position(|h| h == wanted)
                .ok_or_else(|| PoseError::Value {
                    file: name.to_owned(),
                    item: "header".to_owned(),
                    expected: format!("a column `{wanted}`"),
                    found: header.iter().collect::<Vec<_>>().join(","),
                })?;
        }
        Ok(Self {
            name: name.to_owned(),
            columns,
            rows,
            record: csv::StringRecord::new(),
            row: 0,
        })
    }

    fn next_pose(&mut self) -> Result<Option<Pose>, PoseError> {
        self.row += 1;
        let more = self
            .rows
            .read_record(&mut self.record)
            .map_err(|source| PoseError::Rows {
                place: format!("{}: row {}", self.name, self.row),
                source,
            })?;
        if !more {
            return Ok(None);
        }
        let mut values = [0.0; 7];
        for ((value, &column), label) in values.iter_mut().zip(&self.columns).zip(POSE_COLUMNS) {
            let text = self.record.get(column).unwrap_or("");
            *value = match text.parse::<f64>() {
                Ok(v) if v.is_finite() => v,
                _ => return Err(self.bad(label, "a finite number", format!("`{text}`"))),
            };
        }
        let [x, y, z, qx, qy, qz, qw] = values;
        let rotation = quaternion([qx, qy, qz, qw]).map_err(|length| {
            let found = format!("length {length}");
            self.bad("qx,qy,qz,qw", "a unit quaternion (within 1e-3)", found)
        })?;
        Ok(Some(Pose {
            rotation,
            translation: DVec3::new(x, y, z),
        }))
    }

    fn bad(&self, column: &str, expected: &str, found: String) -> PoseError {
        PoseError::Value {
            file: self.name.clone(),
            item: format!("row {}, column {column}", self.row),
            expected: expected.to_owned(),
            found,
        }
    }
}

impl<R: Read> Iterator for PoseReader<R> {
    type Item = Result<Pose, PoseError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_pose().transpose()
    }
}

/// The seven fields of a pose.
pub fn pose_fields(pose: &Pose) -> [f64; 7] {
    let DVec3 { x, y, z } = pose.translation;
    let DQuat {
        x: qx,
        y: qy,
        z: qz,
        w: qw,
    } = pose.rotation;
    [x, y, z, qx, qy, qz, qw]
}

/// A pose and what was evaluated there.
#[derive(Debug, Clone, Copy)]
pub struct ScoredPose {
    /// Where.
    pub pose: Pose,
    /// Real part of the score, cubic metres.
    pub score_re: f64,
    /// Imaginary part, where the source knows it.
    pub score_im: Option<f64>,
    /// Energy, wrench, coverage.
    pub response: Response,
    /// Condition number of the score, if asked for.
    pub condition: Option<f64>,
}

/// The header of scored poses, with its line end.
pub fn score_header(condition: bool) -> String {
    let names = POSE_COLUMNS.into_iter().chain(SCORE_COLUMNS);
    let names: Vec<&str> = names.chain(condition.then_some(CONDITION_COLUMN)).collect();
    names.join(",") + "\n"
}

/// Appends one scored pose as a row.
pub fn append_score(text: &mut String, scored: &ScoredPose) {
    let Response {
        energy,
        wrench,
        coverage,
    } = scored.response;
    let mut digits = ryu::Buffer::new();
    let mut field = |value: Option<f64>, end: char| {
        if let Some(value) = value {
            text.push_str(digits.format(value));
        }
        text.push(end);
    };
    for value in pose_fields(&scored.pose) {
        field(Some(value), ',');
    }
    field(Some(scored.score_re), ',');
    field(scored.score_im, ',');
    field(Some(energy), ',');
    for value in wrench.torque.to_array() {
        field(Some(value), ',');
    }
    for value in wrench.force.to_array() {
        field(Some(value), ',');
    }
    match scored.condition {
        None => field(Some(coverage), '\n'),
        Some(condition) => {
            field(Some(coverage), ',');
            field(Some(condition), '\n');
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Pose>, PoseError> {
        PoseReader::new("poses.csv", text.as_bytes())?.collect()
    }

    #[test]
    fn columns_come_in_any_order() {
        let poses = read("qw,name,x,y,z,qx,qy,qz\n1,first,0.1,0.2,0.3,0,0,0\n").unwrap();
        assert_eq!(poses.len(), 1);
        assert_eq!(poses[0].translation, DVec3::new(0.1, 0.2, 0.3));
        assert_eq!(poses[0].rotation, DQuat::IDENTITY);
    }

    #[test]
    fn nearly_unit_quaternions_are_normalized_and_others_refused() {
        let header = "x,y,z,qx,qy,qz,qw\n";
        let poses = read(&format!("{header}0,0,0,0,0,0,1.0009\n")).unwrap();
        assert_eq!(poses[0].rotation, DQuat::IDENTITY);
        let error = read(&format!("{header}0,0,0,0,0,0,1\n0,0,0,0,0,0,1.002\n"))
            .unwrap_err()
            .to_string();
        assert!(error.contains("poses.csv: row 2"), "{error}");
        assert!(error.contains("1.002"), "{error}");
    }

    #[test]
    fn bad_cells_name_row_and_column() {
        let header = "x,y,z,qx,qy,qz,qw\n";
        for (row, column) in [("0,zero,0,0,0,0,1", "y"), ("0,0,inf,0,0,0,1", "z")] {
            let error = read(&format!("{header}0,0,0,0,0,0,1\n{row}\n"))
                .unwrap_err()
                .to_string();
            assert!(
                error.contains(&format!("row 2, column {column}")),
                "{error}"
            );
        }
        assert!(read(&format!("{header}0,0,0\n")).is_err());
        let error = read("x,y,z,qx,qy,qz\n").unwrap_err().to_string();
        assert!(error.contains("a column `qw`"), "{error}");
    }
}
