//! Where results go.

use std::path::Path;

use crate::error::CommandError;

/// Refuses an output whose folder does not exist, or where another user has put a link, before
/// anything is computed.
pub(crate) fn require_folder(output: &Path) -> Result<(), CommandError> {
    sdf_grid::require_unplanted(output).map_err(|e| CommandError::write(output, e))?;
    match output.parent() {
        Some(folder) if !folder.as_os_str().is_empty() && !folder.is_dir() => {
            Err(CommandError::input(
                output.display().to_string(),
                "folder",
                "an existing folder",
                folder.display(),
            ))
        }
        _ => Ok(()),
    }
}

/// Prints a result for programs.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), CommandError> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| CommandError::failure("writing JSON", e))?;
    crate::say!("{text}");
    Ok(())
}
