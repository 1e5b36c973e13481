//! The score by direct quadrature: any rotation, no table, a few megabytes.

pub(crate) mod condition;
pub(crate) mod evaluator;
mod lookup;
mod quadrature;
mod terms;

pub use crate::pair::model::Side;
pub use evaluator::{DirectDescription, FullResponse, TermDescription};
pub use terms::{Blend, Term, score_terms};
