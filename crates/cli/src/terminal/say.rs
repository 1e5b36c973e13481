//! Printing lines that give a terminal nothing to obey: names come from files, scenes and devices.

use std::fmt::Arguments;
use std::io::Write;

use sdf_grid::text::shown_lines;

/// Prints a line to standard error; does nothing if it is closed, as nobody is left to read it.
pub fn remark_line(text: Arguments<'_>) {
    let _ = writeln!(std::io::stderr(), "{}", shown_lines(&text.to_string()));
}

/// Prints a line to standard output ([`crate::terminal::output`]).
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {
        $crate::terminal::output::print_line(format_args!($($text)*))
    };
}

/// Prints a line to standard error; does nothing if it is closed, as nobody is left to be told.
#[macro_export]
macro_rules! remark {
    ($($text:tt)*) => {
        $crate::terminal::say::remark_line(format_args!($($text)*))
    };
}
