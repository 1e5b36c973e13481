//! Windowed correlation with lane-batched transforms, in three stages that each visit their data
//! once:
//!
//! 1. per x plane of the moving box: z transforms of bundles of y rows, a transposition of small
//!    blocks from lanes of y to lanes of kz;
//! 2. per block of kz lanes: y transforms; per column of x lines x transforms of every term,
//!    products with the fixed spectra, one x transform back; y transforms back. One block at a time
//!    lies in memory, small enough for the caches;
//! 3. per wanted x plane: blocks back to lanes of y, z transforms to real values.
//!
//! Only real parts are computed: `Re(A B) = Ar Br - Ai Bi`, two real transforms going in, and one
//! coming out of the sum of all products. Along z the period is `nz` but the frequencies are `2 k +
//! 1/2`: the sum over z of `b(z) e^{2 pi i z (2 k + 1/2) / nz}` is a complex transform of `nz / 2`
//! points of `(b(z) + i b(z + nz / 2)) e^{pi i z / nz}`, and those `nz / 2` values hold all there
//! is to know of a real line. No frequency is its own conjugate, so there is no zero and no Nyquist
//! frequency to treat apart and no half spectrum to split. What wraps around along z returns with
//! the opposite sign; nothing that wraps around is ever wanted.
//!
//! Lines that are zero going in are skipped, and so are those unwanted coming out. Half turns take
//! stages 2 and 3 from the products on ([`image`]).
//!
//! # Memory safety
//! Kernels reach their memory through [`tile::Tile`]s, whose every access is checked, and the
//! moving field through [`interpolation::TrilinearReader`] or [`interpolation::QuadraticReader`],
//! which check a place once for all nodes around it. All `unsafe` code of correlations is in these
//! two files.

mod fused;
mod image;
pub(crate) mod interpolation;
pub(crate) mod lane_fft;
mod layout;
pub(crate) mod radix;
mod stages;
mod tile;

pub(crate) use fused::Fused;
pub(crate) use fused::FusedScratch;
pub(crate) use layout::lanes;
pub(crate) use stages::correlate;

#[cfg(test)]
mod tests;
