//! Tables that cannot be baked, opened or read.

use fft_correlate::table::TableSetupError;
use fft_correlate::tolerance::ToleranceError;
use fft_correlate::{BakeError, StoreError, TableError};

use super::raised::{Failure, Kind};

impl From<StoreError> for Failure {
    fn from(error: StoreError) -> Self {
        let said = Self::of(Kind::Table, &error);
        match error {
            StoreError::Missing { path } => {
                (said.about("table", "a table", "nothing")).in_file(path.display())
            }
            StoreError::Url { url, reason } => {
                (said.about("url", "a store", reason)).in_file(url.display())
            }
            StoreError::Io { path, source } => said
                .about("file", "a file that can be used", source)
                .in_file(path.display()),
            StoreError::Metadata { path, item, reason } => said
                .about(item, "that of an energy table", reason)
                .in_file(path.display()),
            StoreError::Version {
                path,
                expected,
                found,
            } => (said.about("table format", expected, found)).in_file(path.display()),
            StoreError::Different { path, difference } => said
                .about(&difference.key, &difference.stored, &difference.given)
                .in_file(path.display()),
            StoreError::Busy { path } => said
                .about("table", "one that nobody else bakes", "a bake under way")
                .in_file(path.display()),
            StoreError::Incomplete {
                path,
                missing,
                rotations,
                ..
            } => said
                .about(
                    "rotation nodes",
                    format!("{rotations}, all of them"),
                    format!("{missing} missing: it is being baked, or was interrupted"),
                )
                .in_file(path.display()),
            StoreError::Damaged { path, key, reason } => {
                (said.about(key, "an intact chunk", reason)).in_file(path.display())
            }
            StoreError::Table(inner) => inner.into(),
        }
    }
}

impl From<TableError> for Failure {
    fn from(error: TableError) -> Self {
        match error {
            TableError::Memory { needed, limit, .. } => {
                Self::memory(Kind::Table, "the table", needed, limit)
            }
            TableError::Rotations(inner) => inner.into(),
            other => Self::of(Kind::Table, &other),
        }
    }
}

impl From<BakeError> for Failure {
    fn from(error: BakeError) -> Self {
        let said = Self::of(Kind::Table, &error);
        match error {
            BakeError::Store(inner) => inner.into(),
            BakeError::Exists { path } => said
                .about(
                    "table",
                    "nothing, or resume=True to go on with it",
                    "a table",
                )
                .in_file(path.display()),
            _ => said,
        }
    }
}

impl From<TableSetupError> for Failure {
    fn from(error: TableSetupError) -> Self {
        match error {
            TableSetupError::Build(inner) => inner.into(),
            TableSetupError::Store(inner) => inner.into(),
        }
    }
}

impl From<ToleranceError> for Failure {
    fn from(error: ToleranceError) -> Self {
        let said = Self::of(Kind::Table, &error);
        match error {
            ToleranceError::Missed { asked, reached, .. } => {
                said.about("tolerance", format!("at least {reached}"), asked)
            }
            ToleranceError::Pair(inner) => inner.into(),
            ToleranceError::Plan(inner) => inner.into(),
            ToleranceError::Table(inner) => inner.into(),
            ToleranceError::Direct(inner) => inner.into(),
            ToleranceError::Cancelled => said,
        }
    }
}
