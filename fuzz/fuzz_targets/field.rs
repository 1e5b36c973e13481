//! Density fields of small meshes with many coplanar triangles.
#![no_main]

use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| pegfit_fuzz::field(bytes));
