//! Output files, and results as JSON.

use std::borrow::Cow;
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
    say!("{}", json_escaped(&text));
    Ok(())
}

/// JSON whose strings hold no character that would act on a terminal; line breaks are between them.
fn json_escaped(text: &str) -> Cow<'_, str> {
    let acts = |c: char| c != '\n' && sdf_grid::text::acts(c);
    if !text.contains(acts) {
        return Cow::Borrowed(text);
    }
    let safe = |c: char| match acts(c) {
        true => format!("\\u{:04x}", u32::from(c)),
        false => c.to_string(),
    };
    Cow::Owned(text.chars().map(safe).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_stays_what_it_was_without_control_characters() {
        let name = "a\u{9b}31m\u{7f}\u{202e}ü\n";
        let text = serde_json::to_string_pretty(&[name]).expect("text");
        let safe = json_escaped(&text);
        assert!(!safe.contains(['\u{9b}', '\u{7f}', '\u{202e}']));
        let read: Vec<String> = serde_json::from_str(&safe).expect("JSON");
        assert_eq!(read, [name]);
    }
}
