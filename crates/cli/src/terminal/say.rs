//! Printing that does not fail when nobody reads any more, as in `pegfit check *.obj | head`.
//!
//! Names come from files: control characters in them are shown as such.

/// Prints a line to standard output; does nothing if it is closed.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stdout(), "{}", sdf_grid::text::shown_lines(&text));
    }};
}

/// Prints a line to standard error; does nothing if it is closed.
#[macro_export]
macro_rules! remark {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($text)*);
        let _ = writeln!(std::io::stderr(), "{}", sdf_grid::text::shown_lines(&text));
    }};
}
