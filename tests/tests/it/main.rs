//! What the crates promise together, on the paper's pairs.

mod felt;
mod fit;
mod invariance;
mod quiet;
mod spectrum;
mod tables;
