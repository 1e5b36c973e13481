//! Truths against closed forms, against each other, and against sums over samples.

mod common;
mod frames;
mod overlap;
mod samples;
