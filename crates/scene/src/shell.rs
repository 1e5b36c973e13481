//! Words of commands that people copy from what is printed.

use std::path::Path;

/// A file's name as one word of a command line, in quotes where it needs them.
///
/// ```
/// use pegfit_scene::shell_word;
///
/// assert_eq!(shell_word("peg.stl".as_ref()), "peg.stl");
/// assert_eq!(shell_word("my peg.stl".as_ref()), "'my peg.stl'");
/// ```
pub fn shell_word(file: &Path) -> String {
    let text = file.display().to_string();
    match shlex::try_quote(&text) {
        Ok(word) => word.into_owned(),
        // A name with a NUL is no file's.
        Err(_) => text,
    }
}
