//! Scene files: read as written, then checked as a whole.

mod check;
mod check_parts;
mod raw;
mod read;
mod source;
#[cfg(test)]
mod tests;
pub(crate) mod values;
