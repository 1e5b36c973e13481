//! Opening and loading a table folder: its metadata, then a chunk, from the bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| pegfit_fuzz::table(bytes));
