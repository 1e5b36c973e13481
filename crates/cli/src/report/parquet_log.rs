//! Logs of the haptic loop as Parquet, if built with the feature `parquet`.

use std::path::Path;

use haptic::log::SampleWriter;

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

/// Creates the log, which grows as CSV.
///
/// # Errors
/// If the file cannot be created, or this build writes no Parquet.
#[cfg(not(feature = "parquet"))]
pub(crate) fn create(path: &Path) -> Result<Box<dyn SampleWriter>, CommandError> {
    Err(unsupported(path))
}

/// Creates the log, which grows as CSV.
///
/// # Errors
/// If the file cannot be created.
#[cfg(feature = "parquet")]
pub(crate) fn create(path: &Path) -> Result<Box<dyn SampleWriter>, CommandError> {
    haptic::log::create_parquet(path).map_err(|e| match e {
        haptic::RecordError::Io { path, source } => CommandError::write(&path, source),
        other => CommandError::failure(path.display().to_string(), other),
    })
}
