//! Where contact holds a part: hypotheses from planes and axes of both surfaces, seated on each
//! other, ranked by how much their contact says about the pose, and the joint that it leaves.
//!
//! A sample of the moving part's surface mates if a face of the fixed part lies opposite within a
//! clearance. It resists motions along its normal: a row `J` of six numbers. The sum of `Jᵀ J` over
//! mating samples, the contact Gramian, tells which motions contact resists, how well, and which it
//! leaves free. Formulas are in `docs/conventions.md`.

pub(crate) mod axis;
pub(crate) mod contact;
pub(crate) mod hypotheses;
pub(crate) mod joint;
pub(crate) mod representative;
pub(crate) mod search;
pub(crate) mod seat;

pub use contact::{ContactGramian, HoldReport, MatingContact};
pub use joint::{Joint, JointKind, Travel};
pub use search::{HeldPose, MatingSearch, MatingSearchOptions, SearchRegion};

#[cfg(test)]
mod tests;
