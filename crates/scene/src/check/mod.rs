//! Whether meshes can be used and parts fit, in the words of `pegfit check`.

pub(crate) mod fit_verdict;
pub(crate) mod ledger;
pub(crate) mod mesh_verdict;
