//! Printing that does not fail when nobody reads any more, as in `pegfit check *.obj | head`.

/// Prints a line to standard output; does nothing if it is closed.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line to standard error; does nothing if it is closed.
#[macro_export]
macro_rules! remark {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
