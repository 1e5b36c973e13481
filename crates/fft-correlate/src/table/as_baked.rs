//! A table and the parts that it is to be used with: are they those it was baked from?

use crate::pair::builder::PairBuildError;
use crate::pair::contact::Smoothing;
use crate::setup::energy_scale::EnergyScale;
use crate::setup::pair_setup::PairSetup;
use crate::table::spec::TableSpec;
use crate::table::store::error::StoreError;
use crate::table::store::table_store::TableStore;

/// Why a table is not one of a setup's pair.
#[derive(Debug, thiserror::Error)]
pub enum TableSetupError {
    /// The setup makes no pair.
    #[error(transparent)]
    Build(#[from] PairBuildError),
    /// The table was baked from another pair ([`StoreError::Different`]).
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl PairSetup {
    /// The setup on the lattice that a table was baked on, which its tolerance may have chosen, and
    /// with the table's energy scale unless the setup states one.
    #[must_use]
    pub fn as_baked(&self, spec: &TableSpec) -> Self {
        let mut setup = self.clone();
        setup.builder.spacing = Some(spec.window.spacing());
        let smoothing = Smoothing::of_recipe(&spec.recipe);
        setup.builder.smoothing = smoothing.map(|s| s.in_spacings());
        let gamma = match setup.energy {
            EnergyScale::Gamma(gamma) => gamma,
            EnergyScale::PeakForce(_) => spec.model().gamma,
        };
        setup.energy = EnergyScale::Gamma(gamma);
        setup.model.gamma = gamma;
        setup
    }
}

impl TableStore {
    /// Checks that the table was baked from these parts, with this model and these fields, as far as
    /// the table has not chosen for itself ([`PairSetup::as_baked`]); nothing is computed.
    ///
    /// # Errors
    /// If the setup makes no pair; else names the first key of the recipe that differs.
    pub fn expect_setup(&self, setup: &PairSetup) -> Result<(), TableSetupError> {
        let baked = setup.as_baked(self.spec());
        let recipe = baked.plan()?.recipe(&baked.fixed, &baked.moving);
        Ok(self.expect_recipe(&recipe)?)
    }
}
