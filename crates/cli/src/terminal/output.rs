//! Standard output and error. Commands print through this module, which reports lost output and escapes
//! characters that a terminal would obey.

use std::fmt::Arguments;
use std::io;
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::{Mutex, PoisonError};

use sdf_grid::text::shown_lines;

/// The first refused write; nothing is written after it.
static REFUSED: Mutex<Option<io::Error>> = Mutex::new(None);

/// Standard output as a writer that remembers a refusal, for [`finish`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct StandardOutput;

impl Write for StandardOutput {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        heeded(|| io::stdout().write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        heeded(|| io::stdout().flush())
    }
}

/// Does `work` unless something was refused already, and remembers if this is.
///
/// # Errors
/// As `work`, or what was refused before.
pub(crate) fn heeded<T>(work: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
    let mut refused = REFUSED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(error) = &*refused {
        return Err(copy(error));
    }
    let done = work();
    if let Err(error) = &done
        && error.kind() != ErrorKind::Interrupted
    {
        *refused = Some(copy(error));
    }
    done
}

/// Errors of the system cannot be cloned.
fn copy(error: &io::Error) -> io::Error {
    match error.raw_os_error() {
        Some(code) => io::Error::from_raw_os_error(code),
        None => error.kind().into(),
    }
}

/// Prints a line; [`finish`] reports failures.
pub(crate) fn print_line(text: Arguments<'_>) {
    let mut line = shown_lines(&text.to_string()).into_owned();
    line.push('\n');
    let _ = StandardOutput.write_all(line.as_bytes());
}

/// Moves a terminal's cursor up to the beginning of the last lines, and clears from there.
pub(crate) fn rewind(lines: usize) {
    if lines > 0 {
        let _ = write!(StandardOutput, "\x1b[{lines}A\x1b[J");
    }
}

/// Whether all that was printed so far has left, and more is wanted.
pub(crate) fn is_wanted() -> bool {
    StandardOutput.flush().is_ok()
}

/// Whether somebody looks at it in a terminal.
pub(crate) fn is_terminal() -> bool {
    io::stdout().is_terminal()
}

/// Sends off all that was printed. A reader that went away, as in `pegfit check *.obj | head`, wants no
/// more and is no error.
///
/// # Errors
/// If anything that was printed is lost: a full disk, say.
pub(crate) fn finish() -> io::Result<()> {
    match StandardOutput.flush() {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other,
    }
}

/// Prints a line to standard error; does nothing if it is closed, as nobody is left to read it.
pub(crate) fn remark_line(text: Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", shown_lines(&text.to_string()));
}

/// Prints a line to standard output ([`crate::terminal::output`]).
macro_rules! say {
    ($($text:tt)*) => {
        $crate::terminal::output::print_line(format_args!($($text)*))
    };
}

/// Prints a line to standard error; does nothing if it is closed.
macro_rules! remark {
    ($($text:tt)*) => {
        $crate::terminal::output::remark_line(format_args!($($text)*))
    };
}
