//! The pegfit command line as a library.
