//! The compiled half of the Python package `pegfit`: arrays in, arrays out, and no numerics.
//!
//! The other half is `python/pegfit`, typed and documented; nobody imports this one directly.

mod assembly;
mod failure;
mod loops;
mod pair_class;
mod parts;
mod poses;
mod search;
mod source;
mod tables;
mod work;

use pegfit::memory_budget;
use pyo3::prelude::*;

/// The compiled half of `pegfit`.
#[pymodule(gil_used = false)]
mod _core {
    use std::ffi::OsString;

    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::assembly::assemble;
    #[pymodule_export]
    use crate::loops::{Felt, PyBodyForce, PyForcePath, feel, tick_columns, write_text};
    #[pymodule_export]
    use crate::pair_class::PyPair;
    #[pymodule_export]
    use crate::parts::{Mesh, density, peg_in_hole};
    #[pymodule_export]
    use crate::poses::from_matrices;
    #[pymodule_export]
    use crate::search::{PyWay, correlate, dock, highest, path, poses_at};
    #[pymodule_export]
    use crate::source::Source;
    #[pymodule_export]
    use crate::tables::{bake_table, open_table};

    /// The version of the package.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");

    /// Quadrature points that a 1 kHz loop on one core has time for.
    #[pymodule_export]
    const REAL_TIME_POINTS: usize = match fft_correlate::DirectOptions::REAL_TIME.max_points {
        Some(points) => points,
        None => usize::MAX,
    };

    /// The `pegfit` command; `arguments` begin with its name. Returns its exit code.
    #[pyfunction]
    fn command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
        py.detach(|| pegfit::program::run(arguments)) as u8
    }
}
