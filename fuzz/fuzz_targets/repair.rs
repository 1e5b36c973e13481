//! Repair of arbitrary vertices and triangles, NaN and absurd ones among them.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| pegfit_fuzz::repair(bytes));
