//! The table of a pair: its nodes, its symmetry, its provenance; and whether a stored table was baked
//! from the same pair.

use std::fmt;

use sdf_grid::Aabb;

use crate::correlate::support::CorrelateError;
use crate::correlate::{CorrelatorPlan, PairSupport};
use crate::geometry::translation::TranslationWindow;
use crate::pair::builder::PairBuildError;
use crate::pair::contact::Smoothing;
use crate::pair::fields::Pair;
use crate::pair::setup::{EnergyScale, PairSetup};
use crate::rotations::domain::{RotationDomain, RotationError};
use crate::rotations::grid::RotationGrid;
use crate::rotations::symmetry::{symmetry_on_lattice, table_symmetry};
use crate::sweep::PairEnergies;
use crate::table::spec::TableSpec;
use crate::table::store::error::StoreError;
use crate::table::store::table_store::TableStore;

/// A pair and the table that is to be computed of it.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::{PairBuilder, PairSetup, RotationDomain, TablePlan};
/// use glam::DVec3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = PairSetup {
///     builder: PairBuilder { spacing: Some(0.004), ..PairBuilder::default() },
///     half_extent: Some(DVec3::splat(0.008)),
///     ..PairSetup::new(Arc::new(hole), Arc::new(peg))
/// };
/// let plan = TablePlan::new(&setup, setup.load(&Silent)?, RotationDomain::full(15.0))?;
/// // 8 mm either way in steps of 4 mm; the square peg's symmetry leaves nodes out.
/// assert_eq!(plan.window.shape(), [5; 3]);
/// assert_eq!(plan.spec.symmetry.map(|symmetry| symmetry.order), Some(4));
/// assert!(plan.plan()?.bytes <= plan.spec.bytes(plan.plan()?.rotations));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct TablePlan {
    /// The pair; its gamma is the table's.
    pub pair: Pair,
    /// Displacements of the pivot.
    pub window: TranslationWindow,
    /// What the table holds; how it is stored may be changed.
    pub spec: TableSpec,
}

/// Why there is no such table.
#[derive(Debug, thiserror::Error)]
pub enum TablePlanError {
    /// The translations do not make a window.
    #[error("translations: {0}")]
    Window(#[from] sdf_grid::LatticeError),
    /// The rotations do not make a grid.
    #[error("rotations: {0}")]
    Rotations(#[from] RotationError),
    /// The correlation that would fill it cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
    /// Its rotations, or the correlation that would fill it, do not fit in memory.
    #[error("the rotations and their correlation need {needed} bytes, expected at most {limit}")]
    Memory {
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
}

impl TablePlan {
    /// The table of a setup's pair over its box of displacements and `rotations` (of
    /// the shapes), shortened by the
    /// symmetry of either part. `pair` is [`PairSetup::load_in_window`]'s, or [`PairSetup::load`]'s.
    ///
    /// # Errors
    /// If the box has too many nodes.
    pub fn new(
        setup: &PairSetup,
        pair: Pair,
        rotations: RotationDomain,
    ) -> Result<Self, TablePlanError> {
        let spacing = pair.spacing();
        let Aabb { min, max } = setup.displacements(pair.pivot());
        let window = TranslationWindow::new(min, max, spacing)?;
        let axes = [&setup.fixed, &setup.moving].map(|mesh| symmetry_on_lattice(mesh, spacing));
        let symmetry = table_symmetry(&rotations, &axes[0], &axes[1]);
        let spec = TableSpec {
            symmetry,
            placement: setup.placement,
            ..TableSpec::for_pair(&pair, &window, rotations)
        };
        Ok(Self { pair, window, spec })
    }

    /// What the bake of the table needs.
    ///
    /// # Errors
    /// If the rotations are out of range or too many, the window is too large for a transform, or a
    /// density is not finite.
    pub fn plan(&self) -> Result<BakePlan, TablePlanError> {
        let grid = self.spec.grid()?;
        let support = PairSupport::of(&self.pair)?;
        let groups = grid.half_turn_groups();
        let rotations = grid.nodes().len();
        Ok(BakePlan {
            rotations,
            bytes: self.spec.bytes(rotations),
            scores: CorrelatorPlan::for_groups(&support, &self.window, &groups)?.for_sums(),
        })
    }

    /// The correlation that fills the table, if it needs no more than `limit` bytes with the threads
    /// of the current rayon pool; nothing of its size is allocated before that is known.
    ///
    /// # Errors
    /// If it would need more, or as [`TablePlan::plan`].
    pub fn energies(&self, limit: u64) -> Result<PairEnergies, TablePlanError> {
        Ok(PairEnergies::build(&self.scores(limit)?, &self.pair)?)
    }

    /// The plan of [`TablePlan::energies`].
    ///
    /// # Errors
    /// As it.
    pub(crate) fn scores(&self, limit: u64) -> Result<CorrelatorPlan, TablePlanError> {
        // Not even the rotations are listed before this.
        let listed = RotationGrid::bytes(&self.spec.rotations, self.spec.symmetry.as_ref());
        if let Some(needed) = listed.filter(|needed| *needed > limit) {
            return Err(TablePlanError::Memory { needed, limit });
        }
        let BakePlan { scores, .. } = self.plan()?;
        let needed = scores.bytes(rayon::current_num_threads());
        match needed > limit {
            true => Err(TablePlanError::Memory { needed, limit }),
            false => Ok(scores),
        }
    }
}

/// The rotations, memory and correlation of a bake: data to print and compare.
#[derive(Debug, Clone, PartialEq)]
pub struct BakePlan {
    /// Rotation nodes.
    pub rotations: usize,
    /// Bytes of the energies, if nothing of note is left out.
    pub bytes: u128,
    /// The scores of each.
    pub scores: CorrelatorPlan,
}

impl fmt::Display for BakePlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = self.bytes as f64 / f64::from(1 << 20);
        write!(
            f,
            "{} rotations x {}; {mib:.1} MiB of energies",
            self.rotations, self.scores
        )
    }
}

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
        let smoothing = Smoothing::of_provenance(&spec.provenance);
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
    /// If the setup makes no pair; else names the first key of the provenance that differs.
    pub fn expect_setup(&self, setup: &PairSetup) -> Result<(), TableSetupError> {
        let baked = setup.as_baked(self.spec());
        let provenance = baked.plan()?.provenance(&baked.fixed, &baked.moving);
        Ok(self.expect_provenance(&provenance)?)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::DVec3;
    use sdf_grid::{Silent, shapes::PegInHole};

    use super::*;

    #[test]
    fn a_correlation_beyond_the_limit_is_refused_by_what_its_plan_says() {
        let (hole, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let mut setup = PairSetup::new(Arc::new(hole), Arc::new(peg));
        setup.builder.spacing = Some(0.004);
        setup.half_extent = Some(DVec3::splat(0.01));
        let pair = setup.load(&Silent).unwrap();
        let design = TablePlan::new(&setup, pair, RotationDomain::ball(20.0, 10.0)).unwrap();
        let plan = design.plan().unwrap();
        let needed = plan.scores.bytes(rayon::current_num_threads());
        match design.energies(needed - 1) {
            Err(TablePlanError::Memory { needed: n, limit }) => {
                assert_eq!((n, limit), (needed, needed - 1));
            }
            other => panic!("{:?}", other.map(|_| "energies")),
        }
        let energies = design.energies(needed).unwrap();
        assert_eq!(*energies.correlator().plan(), plan.scores);
        let said = plan.to_string();
        let rotations = design.spec.grid().unwrap().nodes().len();
        assert!(
            said.contains(&format!("{rotations} rotations")) && said.contains("MiB"),
            "{said}"
        );
    }
}
