//! `pegfit plot`: the paper's figures for any scene.

mod curve;
mod density;
mod force;
mod run;
mod surface;
mod well;

pub(super) use curve::{Along, curve};
pub(super) use density::{densities, on_plane, overlap};
pub(super) use force::force_chart;
pub(super) use run::run;
pub(super) use surface::score_surface;
pub(super) use well::analyse;
