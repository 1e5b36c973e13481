//! Report descriptors of devices, and reports read and written by them.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| pegfit_fuzz::hid(bytes));
