//! The score of a pair at all translations of a window, one rotation at a time, by FFT.
//!
//! For a rotation `R` and a displacement `d` of the pivot `c` the moving density at a point `p` of
//! the fixed frame is `g_R(p - d)` with `g_R(p) = rho_2(R^T (p - c) + c)`. The correlator samples
//! `g_R` on the fixed part's lattice and computes `Re sum_p A(p) g_R(p - d) h^3` (eq_5, eq_11; no
//! complex conjugate) for every displacement of the window at once.
//!
//! The general score is the sum of two products, each with one compact factor as far as the
//! separation weight `w` allows:
//!
//! | product | fixed field | moving field |
//! |---|---|---|
//! | 1 | `l2 (l1 O1 + l2 I1)` | `I2` |
//! | 2 | `l1 (w l1 O1 + l2 I1)` | `O2` |
//!
//! With `w = 1` they merge into `(l1 O1 + l2 I1)(l1 O2 + l2 I2)`. Each field is cropped to what can
//! meet the other inside the window, and the transforms have the shortest good length at which
//! nothing wraps into the window.
//!
//! From plan to run: [`PairSupport`], [`CorrelatorPlan`], [`crate::Correlator`]. A correlator enters
//! the kernels through two function pointers (`KernelEntries` in `correlator.rs`), so that crates
//! that name a `Correlator<T>` do not compile the kernels again.

mod contract;
pub(crate) mod correlator;
#[cfg(test)]
mod fixtures;
mod kernels;
mod overlap;
mod plan;
mod real;
mod resample;
pub(crate) mod support;

pub use crate::geometry::half_turn::{HalfTurn, RotationSum};
pub use contract::StageTimes;
pub use correlator::CorrelatorScratch;
pub use plan::{CorrelatorPlan, ProductPlan};
pub use real::Real;
pub use support::PairSupport;
