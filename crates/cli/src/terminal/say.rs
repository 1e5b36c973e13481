//! Printing lines.

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
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
