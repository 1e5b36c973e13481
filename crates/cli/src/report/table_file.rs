//! Tables of text and numbers as CSV, or as Parquet if built with the feature `parquet`.

use std::io::Write;
use std::path::Path;

use sdf_grid::atomic;

use crate::error::CommandError;
use crate::report::parquet_log::is_parquet;

/// What a column holds; any cell may be empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum ColumnKind {
    Text,
    Number,
    Count,
}

/// A column: its name, and what it holds.
pub(crate) type Column = (&'static str, ColumnKind);

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Cell {
    Empty,
    Text(String),
    Number(f64),
    Count(u64),
}

impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value
            .filter(|v| v.is_finite())
            .map_or(Self::Empty, Self::Number)
    }
}

impl Cell {
    fn text(&self) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Text(text) => text.clone(),
            Self::Number(value) => value.to_string(),
            Self::Count(value) => value.to_string(),
        }
    }
}

/// Refuses a table that this build cannot write.
///
/// # Errors
/// Names the feature.
pub(crate) fn require(option: &str, path: &Path) -> Result<(), CommandError> {
    match is_parquet(path) && !cfg!(feature = "parquet") {
        true => Err(CommandError::option(
            option,
            "a .csv file, or a pegfit built with `--features parquet`",
            path.display(),
        )),
        false => Ok(()),
    }
}

/// Writes a table: Parquet if its name ends so, else CSV. Rows have a cell for each column.
///
/// # Errors
/// If the file cannot be written, or this build writes no Parquet.
pub(crate) fn write(
    path: &Path,
    columns: &[Column],
    rows: &[Vec<Cell>],
) -> Result<(), CommandError> {
    require("--output", path)?;
    atomic::write_with(path, |out| {
        match is_parquet(path) {
            true => write_parquet(columns, rows, out),
            false => write_csv(columns, rows, out),
        }
        .map_err(|e| CommandError::failure(path.display().to_string(), e))
    })
}

type Failed = Box<dyn std::error::Error + Send + Sync>;

fn write_csv(columns: &[Column], rows: &[Vec<Cell>], out: &mut dyn Write) -> Result<(), Failed> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(columns.iter().map(|c| c.0))?;
    for row in rows {
        table.write_record(row.iter().map(Cell::text))?;
    }
    Ok(table.flush()?)
}

#[cfg(not(feature = "parquet"))]
fn write_parquet(_: &[Column], _: &[Vec<Cell>], _: &mut dyn Write) -> Result<(), Failed> {
    // Refused before.
    Err("this pegfit was built without Parquet".into())
}

#[cfg(feature = "parquet")]
fn write_parquet(
    columns: &[Column],
    rows: &[Vec<Cell>],
    out: &mut dyn Write,
) -> Result<(), Failed> {
    use std::sync::Arc;

    use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
    use parquet::data_type::{ByteArrayType, DoubleType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::types::Type;

    let field = |(name, kind): &Column| {
        let (physical, logical) = match kind {
            ColumnKind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            ColumnKind::Number => (Physical::DOUBLE, None),
            ColumnKind::Count => (Physical::INT64, None),
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_logical_type(logical)
            .with_repetition(Repetition::OPTIONAL);
        field.build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("row")
        .with_fields(fields)
        .build()?;
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .build();
    // The writer wants to own where it sends: tables of screens are small.
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
    let mut group = writer.next_row_group()?;
    for (i, (_, kind)) in columns.iter().enumerate() {
        let cells = || rows.iter().map(|row| &row[i]);
        let there: Vec<i16> = cells().map(|c| i16::from(*c != Cell::Empty)).collect();
        let mut column = group.next_column()?.ok_or("a column is missing")?;
        match kind {
            ColumnKind::Text => {
                let texts = cells().filter(|c| **c != Cell::Empty).map(Cell::text);
                let texts: Vec<_> = texts.map(|t| t.into_bytes().into()).collect();
                (column.typed::<ByteArrayType>()).write_batch(&texts, Some(&there), None)?;
            }
            ColumnKind::Number => {
                let numbers = cells().filter_map(|c| match c {
                    Cell::Number(v) => Some(*v),
                    _ => None,
                });
                let numbers: Vec<f64> = numbers.collect();
                (column.typed::<DoubleType>()).write_batch(&numbers, Some(&there), None)?;
            }
            ColumnKind::Count => {
                let counts = cells().filter_map(|c| match c {
                    Cell::Count(v) => i64::try_from(*v).ok(),
                    _ => None,
                });
                let counts: Vec<i64> = counts.collect();
                (column.typed::<Int64Type>()).write_batch(&counts, Some(&there), None)?;
            }
        }
        column.close()?;
    }
    group.close()?;
    Ok(out.write_all(&writer.into_inner()?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMNS: [Column; 3] = [
        ("name", ColumnKind::Text),
        ("value", ColumnKind::Number),
        ("count", ColumnKind::Count),
    ];

    fn rows() -> Vec<Vec<Cell>> {
        vec![
            vec![
                Cell::Text("a, \"b\"".into()),
                Cell::Number(0.1),
                Cell::Count(3),
            ],
            vec![Cell::Empty, Some(f64::NAN).into(), Cell::Empty],
        ]
    }

    #[test]
    fn cells_of_csv_are_quoted_where_they_must_be_and_empty_where_nothing_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.csv");
        write(&file, &COLUMNS, &rows()).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        assert_eq!(text, "name,value,count\n\"a, \"\"b\"\"\",0.1,3\n,,\n");
    }

    #[cfg(not(feature = "parquet"))]
    #[test]
    fn parquet_names_its_feature() {
        let error = write(Path::new("t.parquet"), &COLUMNS, &rows()).unwrap_err();
        assert!(error.to_string().contains("--features parquet"), "{error}");
    }

    #[cfg(feature = "parquet")]
    #[test]
    fn parquet_has_the_cells_of_the_csv() {
        use parquet::file::reader::{FileReader, SerializedFileReader};
        use parquet::record::Field;

        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("t.parquet");
        write(&file, &COLUMNS, &rows()).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(file).unwrap()).unwrap();
        let found = reader.get_row_iter(None).unwrap().map(|row| {
            let row = row.unwrap();
            let cells = row.get_column_iter().map(|(_, cell)| match cell {
                Field::Null => Cell::Empty,
                Field::Str(text) => Cell::Text(text.clone()),
                Field::Double(value) => Cell::Number(*value),
                Field::Long(value) => Cell::Count(*value as u64),
                other => panic!("{other:?}"),
            });
            cells.collect::<Vec<_>>()
        });
        assert_eq!(found.collect::<Vec<_>>(), rows());
    }
}
