//! The models inside 3MF files, which the fuzzer cannot reach through the checksums around them.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sdf_grid::mesh_io::MeshFormat;

fuzz_target!(|bytes: &[u8]| {
    pegfit_fuzz::mesh(MeshFormat::ThreeMf, &pegfit_fuzz::stored_3mf(bytes));
});
