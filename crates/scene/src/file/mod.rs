//! Scene files: read as written, then checked as a whole.

mod check;
mod raw;
mod read;
#[cfg(test)]
mod tests;
pub(crate) mod values;
