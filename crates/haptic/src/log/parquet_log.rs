//! Logs of the haptic loop as Parquet.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use sdf_grid::atomic::AtomicFile;

use crate::device::contract::DeviceSpec;
use crate::log::csv::rows;
use crate::log::csv::{COLUMNS, faults, numbers};
use crate::log::csv::{CsvLog, keep_device};
use crate::log::error::RecordError;
use crate::log::record::SampleWriter;
use crate::path::sample::Sample;

/// Ticks in a row group: 16 s at 1 kHz.
const GROUP: usize = 16_384;

/// Columns of numbers; the last one of all spells out `flags`.
const NUMBERS: usize = COLUMNS.len() - 1;

/// Columns of whole numbers.
const INTEGERS: [&str; 4] = ["tick", "buttons", "evaluations", "flags"];

/// A log that grows as CSV, which can be read whatever ends the run, and becomes Parquet at the
/// end: a Parquet file without its end is no file.
struct ParquetLog {
    path: PathBuf,
    growing: CsvLog,
}

/// Rows on their way into a Parquet file.
struct RowGroups {
    writer: SerializedFileWriter<AtomicFile>,
    columns: Vec<Vec<Option<f64>>>,
    faults: Vec<ByteArray>,
}

fn is_integer(column: usize) -> bool {
    INTEGERS.contains(&COLUMNS[column])
}

fn schema() -> Result<Type, ParquetError> {
    let field = |column: usize| {
        let physical = match is_integer(column) {
            true => Physical::INT64,
            false => Physical::DOUBLE,
        };
        Type::primitive_type_builder(COLUMNS[column], physical)
            .with_repetition(Repetition::OPTIONAL)
            .build()
            .map(Arc::new)
    };
    let text = Type::primitive_type_builder(COLUMNS[NUMBERS], Physical::BYTE_ARRAY)
        .with_logical_type(Some(LogicalType::String))
        .with_repetition(Repetition::REQUIRED)
        .build();
    let fields = (0..NUMBERS).map(field).chain([text.map(Arc::new)]);
    let fields = fields.collect::<Result<_, _>>()?;
    Type::group_type_builder("tick").with_fields(fields).build()
}

/// Creates a Parquet log, whose columns are those of the CSV. It grows as CSV beside its place, in
/// `NAME.csv.part`.
///
/// # Errors
/// If the file cannot be created.
pub fn create_parquet(path: &Path) -> Result<Box<dyn SampleWriter>, RecordError> {
    let growing = CsvLog::create_in(&path.with_added_extension("csv"), path)?;
    Ok(Box::new(ParquetLog {
        path: path.to_owned(),
        growing,
    }))
}

fn missing_column() -> ParquetError {
    ParquetError::General("the schema has fewer columns than the log".into())
}

impl RowGroups {
    fn create(path: &Path) -> io::Result<Self> {
        let file = AtomicFile::create(path)?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .build();
        let writer = schema()
            .and_then(|schema| {
                SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))
            })
            .map_err(io::Error::other)?;
        Ok(Self {
            writer,
            columns: vec![Vec::new(); NUMBERS],
            faults: Vec::new(),
        })
    }

    fn push(&mut self, sample: &Sample) -> Result<(), ParquetError> {
        for (column, value) in self.columns.iter_mut().zip(numbers(sample)) {
            column.push(value);
        }
        self.faults.push(faults(sample).as_str().into());
        match self.columns[0].len() < GROUP {
            true => Ok(()),
            false => self.flush(),
        }
    }

    fn commit(mut self) -> io::Result<()> {
        if !self.columns[0].is_empty() {
            self.flush().map_err(io::Error::other)?;
        }
        let file = self.writer.into_inner().map_err(io::Error::other)?;
        Ok(file.commit()?)
    }

    /// Writes the rows collected so far as one group.
    fn flush(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        for (index, rows) in self.columns.iter_mut().enumerate() {
            let mut out = group.next_column()?.ok_or_else(missing_column)?;
            let there: Vec<i16> = rows.iter().map(|v| i16::from(v.is_some())).collect();
            let values = rows.drain(..).flatten();
            if is_integer(index) {
                let values: Vec<i64> = values.map(|v| v as i64).collect();
                out.typed::<Int64Type>()
                    .write_batch(&values, Some(&there), None)?;
            } else {
                let values: Vec<f64> = values.collect();
                out.typed::<DoubleType>()
                    .write_batch(&values, Some(&there), None)?;
            }
            out.close()?;
        }
        let mut out = group.next_column()?.ok_or_else(missing_column)?;
        out.typed::<ByteArrayType>()
            .write_batch(&self.faults, None, None)?;
        out.close()?;
        self.faults.clear();
        group.close().map(|_| ())
    }
}

impl ParquetLog {
    /// Writes as Parquet what has grown in `part`.
    fn convert(&self, part: &Path) -> Result<(), RecordError> {
        let failed = |source| self.growing.cut(source);
        let file = File::open(part).map_err(failed)?;
        let mut groups = RowGroups::create(&self.path).map_err(failed)?;
        for sample in rows(part, BufReader::new(file))? {
            groups
                .push(&sample?)
                .map_err(|e| failed(io::Error::other(e)))?;
        }
        groups.commit().map_err(failed)
    }
}

impl SampleWriter for ParquetLog {
    fn begin(&mut self, device: &DeviceSpec) -> Result<(), RecordError> {
        self.growing.begin(device)
    }

    fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
        self.growing.write(sample)
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        self.growing.flush()
    }

    fn finish(mut self: Box<Self>) -> Result<(), RecordError> {
        self.growing.flush()?;
        let Some(part) = self.growing.part().map(Path::to_owned) else {
            // It went as CSV into a device or a pipe.
            return Ok(());
        };
        self.convert(&part)?;
        let Self { path, growing } = *self;
        keep_device(&part, &path)?;
        growing.discard()
    }

    fn path(&self) -> PathBuf {
        self.growing.path()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::HapticConfig;
    use crate::device::contract::{Device, DeviceError, DeviceSpec, DeviceState};
    use crate::device::simulated::OperatorConfig;
    use crate::run::pace::Clock;
    use crate::run::session::Session;
    use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;
    use std::sync::atomic::AtomicBool;

    /// A hand that swings, and is gone for one tick in seven.
    struct Swinging(DeviceSpec);

    impl Device for Swinging {
        fn spec(&self) -> &DeviceSpec {
            &self.0
        }

        fn poll(&mut self, now: f64) -> Result<DeviceState, DeviceError> {
            if (now * 1e3).round() % 7.0 == 3.0 {
                return Err(DeviceError::NoInput);
            }
            let x = 0.01 * (6.0 * now).sin();
            Ok(DeviceState::at_rest(
                Pose::from_translation([x, 0.0, 0.0].into()),
                now,
            ))
        }

        fn send(&mut self, _: &Wrench) -> Result<(), DeviceError> {
            Ok(())
        }

        fn stop_all(&mut self) -> Result<(), DeviceError> {
            Ok(())
        }
    }

    /// `E = 100 r²`.
    struct Bowl;

    impl EnergySource for Bowl {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let at = pose.translation;
            Response {
                energy: 100.0 * at.length_squared(),
                wrench: Wrench {
                    force: at * -200.0,
                    ..Wrench::ZERO
                },
                coverage: 1.0,
            }
        }
    }

    /// The same run, whose ticks are the same to the bit, into whatever `record` says.
    fn run(ticks: usize, record: impl FnOnce(Session) -> Session) {
        let config = HapticConfig::default();
        let place = config.workspace(Pose::IDENTITY, Default::default());
        let mut device = Swinging(OperatorConfig::default().spec());
        let seconds = (ticks as f64 - 0.5) * config.period();
        let outcome = record(Session::new(config, place))
            .run(
                &mut device,
                &Bowl,
                Clock::Simulated,
                seconds,
                &AtomicBool::new(false),
            )
            .unwrap();
        assert_eq!(outcome.report.ticks, ticks as u64);
        assert_eq!(outcome.report.dropped_samples, 0);
    }

    #[test]
    fn every_cell_is_that_of_the_csv() {
        let folder = tempfile::tempdir().unwrap();
        let (text, binary) = (folder.path().join("a.csv"), folder.path().join("a.parquet"));
        let ticks = GROUP + 10;
        run(ticks, |session| session.record_to(&text));
        let log = create_parquet(&binary).unwrap();
        assert!(!binary.exists(), "not before it is whole");
        assert!(folder.path().join("a.parquet.csv.part").exists());
        run(ticks, |session| session.record_with(log));
        assert!(!folder.path().join("a.parquet.csv.part").exists());
        assert!(crate::log::read_device(&binary).unwrap().is_some());
        let reader = SerializedFileReader::new(std::fs::File::open(&binary).unwrap()).unwrap();
        assert_eq!(reader.metadata().num_row_groups(), 2);
        let mut rows = csv::Reader::from_path(&text).unwrap();
        assert!(rows.headers().unwrap().iter().eq(COLUMNS));
        let (mut count, mut empty) = (0, 0);
        for (row, found) in rows.records().zip(reader.get_row_iter(None).unwrap()) {
            let (row, found) = (row.unwrap(), found.unwrap());
            for ((name, cell), wanted) in found.get_column_iter().zip(&row) {
                let same = match cell {
                    Field::Null => wanted.is_empty(),
                    Field::Long(v) => wanted.parse() == Ok(*v),
                    Field::Double(v) => wanted.parse() == Ok(*v),
                    Field::Str(v) => wanted == v,
                    _ => false,
                };
                assert!(same, "row {count}, {name}: {cell:?}, CSV {wanted}");
                empty += usize::from(*cell == Field::Null);
            }
            count += 1;
        }
        assert_eq!(count, ticks);
        assert!(rows.records().next().is_none());
        assert!(empty > ticks, "ticks without input are there too");
    }
}
