//! The `pegfit` command.
fn main() {}
