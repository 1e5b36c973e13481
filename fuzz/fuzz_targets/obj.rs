//! OBJ files: parsed and cleaned, any bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sdf_grid::mesh_io::MeshFormat;

fuzz_target!(|bytes: &[u8]| pegfit_fuzz::mesh(MeshFormat::Obj, bytes));
