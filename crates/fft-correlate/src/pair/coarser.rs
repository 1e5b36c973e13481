//! The same pair on coarser lattices.

use sdf_grid::Silent;

use crate::pair::builder::{PairBuildError, PairBuilder};
use crate::pair::contact::Contact;
use crate::pair::fields::Pair;

/// The pair of `contact`'s parts, that of `pair`, on lattices `factor` times as coarse: the same
/// model, and the same energies up to what the coarser lattice leaves. Fields are looked for, and
/// kept, where those of `pair` are.
///
/// # Errors
/// As [`PairBuilder::build`].
pub(crate) fn coarser(pair: &Pair, contact: &Contact, factor: f64) -> Result<Pair, PairBuildError> {
    let recipe = &pair.fixed().recipe;
    let builder = PairBuilder {
        spacing: Some(factor * pair.spacing()),
        halo: Some(recipe.halo),
        tolerance: recipe.tolerance,
        smoothing: Some(contact.smoothing().in_spacings()),
        ..PairBuilder::default()
    };
    let [fixed, moving] = contact.parts();
    let plan = builder.plan(fixed, moving, pair.model())?;
    plan.build(fixed, moving, pair.cache(), &Silent)
}
