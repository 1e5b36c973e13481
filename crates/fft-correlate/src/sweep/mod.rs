//! Energies of many rotations, each at all translations of a window: what tables are filled with
//! and docking looks through.

pub(crate) mod pair_energies;
pub(crate) mod producer;
pub(crate) mod run;
