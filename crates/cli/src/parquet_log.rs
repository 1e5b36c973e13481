//! Logs of the haptic loop as Parquet, if built with the feature `parquet`.

use std::path::Path;

#[cfg(not(feature = "parquet"))]
use haptic::record::SampleWriter;

use crate::error::CommandError;

/// True if the file's name asks for Parquet.
pub(crate) fn is_parquet(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "parquet")
}

/// Refuses a log that this build cannot write.
///
/// # Errors
/// Names the feature.
pub(crate) fn require(path: &Path) -> Result<(), CommandError> {
    match is_parquet(path) && !cfg!(feature = "parquet") {
        true => Err(unsupported(path)),
        false => Ok(()),
    }
}

fn unsupported(path: &Path) -> CommandError {
    CommandError::option(
        "--log",
        "a .csv file, or a pegfit built with `--features parquet`",
        path.display(),
    )
}

/// Creates the log under a temporary name.
///
/// # Errors
/// If the file cannot be created, or this build writes no Parquet.
#[cfg(not(feature = "parquet"))]
pub(crate) fn create(path: &Path) -> Result<Box<dyn SampleWriter>, CommandError> {
    Err(unsupported(path))
}

#[cfg(feature = "parquet")]
pub(crate) use with_feature::create;

#[cfg(feature = "parquet")]
mod with_feature {
    use std::io::{self, BufWriter};
    use std::path::{Path, PathBuf};
    use std::sync::Arc;

    use haptic::Sample;
    use haptic::record::numbers;
    use haptic::record::{COLUMNS, RecordError, SampleWriter};
    use parquet::basic::{Compression, Repetition, Type as Physical};
    use parquet::data_type::{DoubleType, Int64Type};
    use parquet::errors::ParquetError;
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;
    use tempfile::NamedTempFile;

    use crate::error::CommandError;

    /// Ticks in a row group: 16 s at 1 kHz.
    const GROUP: usize = 16_384;

    /// Columns of numbers; the CSV's last one spells out `flags`.
    const NUMBERS: usize = COLUMNS.len() - 1;

    /// Columns of whole numbers.
    const WHOLE: [&str; 4] = ["tick", "buttons", "evaluations", "flags"];

    /// A Parquet log under a temporary name beside its own.
    struct ParquetLog {
        path: PathBuf,
        writer: SerializedFileWriter<BufWriter<NamedTempFile>>,
        columns: Vec<Vec<Option<f64>>>,
    }

    fn whole(column: usize) -> bool {
        WHOLE.contains(&COLUMNS[column])
    }

    fn schema() -> Result<Type, ParquetError> {
        let field = |column: usize| {
            let physical = match whole(column) {
                true => Physical::INT64,
                false => Physical::DOUBLE,
            };
            Type::primitive_type_builder(COLUMNS[column], physical)
                .with_repetition(Repetition::OPTIONAL)
                .build()
                .map(Arc::new)
        };
        let fields = (0..NUMBERS).map(field).collect::<Result<_, _>>()?;
        Type::group_type_builder("tick").with_fields(fields).build()
    }

    pub(crate) fn create(path: &Path) -> Result<Box<dyn SampleWriter>, CommandError> {
        let failed = |e| CommandError::Io {
            action: "write",
            path: path.to_owned(),
            source: e,
        };
        let folder = match path.parent() {
            Some(p) if !p.as_os_str().is_empty() => p,
            _ => Path::new("."),
        };
        let file = NamedTempFile::new_in(folder).map_err(failed)?;
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .build();
        let writer = schema()
            .and_then(|schema| {
                SerializedFileWriter::new(
                    BufWriter::new(file),
                    Arc::new(schema),
                    Arc::new(properties),
                )
            })
            .map_err(|e| failed(io::Error::other(e)))?;
        Ok(Box::new(ParquetLog {
            path: path.to_owned(),
            writer,
            columns: vec![Vec::with_capacity(GROUP); NUMBERS],
        }))
    }

    impl ParquetLog {
        /// Writes the rows collected so far as one group.
        fn flush(&mut self) -> Result<(), ParquetError> {
            let mut group = self.writer.next_row_group()?;
            let mut columns = self.columns.iter_mut().enumerate();
            while let (Some(mut out), Some((index, rows))) = (group.next_column()?, columns.next())
            {
                let there: Vec<i16> = rows.iter().map(|v| i16::from(v.is_some())).collect();
                let values = rows.drain(..).flatten();
                if whole(index) {
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
            group.close().map(|_| ())
        }

        fn failed(
            &self,
            source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
        ) -> RecordError {
            RecordError::Io {
                path: self.path.clone(),
                source: io::Error::other(source),
            }
        }
    }

    impl SampleWriter for ParquetLog {
        fn write(&mut self, sample: &Sample) -> Result<(), RecordError> {
            for (column, value) in self.columns.iter_mut().zip(numbers(sample)) {
                column.push(value);
            }
            match self.columns[0].len() < GROUP {
                true => Ok(()),
                false => self.flush().map_err(|e| self.failed(e)),
            }
        }

        fn finish(mut self: Box<Self>) -> Result<(), RecordError> {
            if !self.columns[0].is_empty() {
                self.flush().map_err(|e| self.failed(e))?;
            }
            let path = self.path.clone();
            let failed = |source| RecordError::Io {
                path: path.clone(),
                source,
            };
            let buffer = self
                .writer
                .into_inner()
                .map_err(|e| failed(io::Error::other(e)))?;
            let file = buffer.into_inner().map_err(|e| failed(e.into_error()))?;
            file.as_file().sync_all().map_err(failed)?;
            file.persist(&path).map_err(|e| failed(e.error))?;
            Ok(())
        }

        fn path(&self) -> PathBuf {
            self.path.clone()
        }
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use haptic::DeviceState;
        use parquet::file::reader::{FileReader, SerializedFileReader};
        use parquet::record::RowAccessor;

        #[test]
        fn what_is_written_is_read_back_by_another_reader() {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("log.parquet");
            let mut log = create(&path).unwrap();
            let ticks = GROUP as u64 + 10;
            for tick in 0..ticks {
                let mut sample = Sample {
                    tick,
                    time: tick as f64 * 1e-3,
                    ..Sample::default()
                };
                if tick % 2 == 0 {
                    sample.input = Some(DeviceState::at(Default::default(), sample.time));
                }
                sample.wrench.force.y = 0.1 * tick as f64;
                log.write(&sample).unwrap();
            }
            assert!(!path.exists(), "not before it is whole");
            log.finish().unwrap();
            let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
            assert_eq!(reader.metadata().num_row_groups(), 2);
            let at = |name: &str| COLUMNS.iter().position(|c| *c == name).unwrap();
            let mut count = 0;
            for (tick, row) in reader.get_row_iter(None).unwrap().enumerate() {
                let row = row.unwrap();
                assert_eq!(row.get_long(at("tick")).unwrap(), tick as i64);
                assert_eq!(row.get_double(at("fy")).unwrap(), 0.1 * tick as f64);
                assert_eq!(row.get_double(at("qw")).is_ok(), tick % 2 == 0);
                count += 1;
            }
            assert_eq!(count, ticks);
        }
    }
}
