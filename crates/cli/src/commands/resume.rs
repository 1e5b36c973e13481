//! Files with the state of a search, from which the next one continues.

use std::path::Path;

use pegfit_path::PathError;
use sdf_grid::{atomic, regular};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::CommandError;

/// Bytes of such a file at most: a million places.
const LONGEST: u64 = 1 << 28;

/// What a file holds; nothing if none is asked for or it is not there yet.
pub(super) fn read<T: Default + DeserializeOwned>(file: Option<&Path>) -> Result<T, CommandError> {
    let Some(file) = file else {
        return Ok(T::default());
    };
    let text = regular::read(file, LONGEST).map_err(|e| CommandError::read(file, e.into()))?;
    let Some(text) = text else {
        return Ok(T::default());
    };
    serde_json::from_slice(&text).map_err(|e| refused(file, "what a search has tried", e))
}

/// Writes what was tried if a search was stopped or is not decided, and removes the file if it is; what
/// the search has found.
pub(super) fn after<T: Serialize, A>(
    file: Option<&Path>,
    found: Result<A, PathError>,
    decided: impl Fn(&A) -> bool,
    tried: &T,
) -> Result<A, CommandError> {
    let Some(file) = file else {
        return Ok(found?);
    };
    match &found {
        Err(PathError::Visited { item }) => {
            let expected = "what was tried for the same question";
            return Err(refused(file, expected, format!("{item} differs")));
        }
        Err(PathError::Cancelled | PathError::Energies) => write(file, tried)?,
        Ok(answer) if !decided(answer) => write(file, tried)?,
        Ok(_) if file.exists() => {
            std::fs::remove_file(file).map_err(|e| CommandError::io("remove", file, e))?;
        }
        _ => {}
    }
    Ok(found?)
}

fn write<T: Serialize>(file: &Path, tried: &T) -> Result<(), CommandError> {
    let text =
        serde_json::to_string(tried).map_err(|e| CommandError::failure("writing JSON", e))?;
    atomic::write(file, text.as_bytes())?;
    remark!("not decided: --resume {} goes on", file.display());
    Ok(())
}

fn refused(file: &Path, expected: &str, found: impl std::fmt::Display) -> CommandError {
    CommandError::input(file.display().to_string(), "--resume", expected, found)
}
