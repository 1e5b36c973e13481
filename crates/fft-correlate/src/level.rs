//! Which vector instructions run: those that `sdf-grid` chooses.

use fearless_simd::Level;
pub(crate) use sdf_grid::dispatch_lanes;
use sdf_grid::level;
#[cfg(test)]
pub(crate) use sdf_grid::level::tested as levels;

/// The best vectors that this machine has and this crate was compiled for.
pub(crate) fn native() -> Level {
    match cfg!(test) {
        true => level::before_last().unwrap_or_else(level::native),
        false => level::native(),
    }
}
