//! Printing that does not fail when nobody reads any more, as in `pegfit check *.obj | head`, and
//! that gives a terminal nothing to obey: names come from files, scenes and devices.

use std::fmt::Arguments;
use std::io::Write;

use haptic::device::shown::escape;

/// Writes a line; does nothing if the other end is closed.
pub fn line(out: &mut impl Write, text: Arguments<'_>) {
    let _ = writeln!(out, "{}", escape(&text.to_string()));
}

/// Prints a line to standard output; does nothing if it is closed.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        $crate::terminal::say::line(&mut std::io::stdout(), format_args!($($text)*))
    };
}

/// Prints a line to standard error; does nothing if it is closed.
#[macro_export]
macro_rules! remark {
    ($($text:tt)*) => {
        $crate::terminal::say::line(&mut std::io::stderr(), format_args!($($text)*))
    };
}
