//! Two parts and all that decides their pair: where docking, tables and the haptic loop begin.

use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{DensityError, FieldCache, Monitor, TriangleMesh};

use crate::geometry::placement::Placement;
use crate::geometry::se3::Pose;
use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan};
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;
use crate::setup::energy_scale::{EnergyScale, EnergyScaleError};

/// Two parts, each in its own frame, and what is asked of their pair: all but the placement speaks
/// of the shapes ([`Placement::to_shapes`]), wherever a scene puts them.
#[derive(Debug, Clone)]
pub struct PairSetup {
    /// The part that stays.
    pub fixed: Arc<TriangleMesh>,
    /// The part that moves.
    pub moving: Arc<TriangleMesh>,
    /// Weights and kernel thickness; gamma is what [`PairSetup::energy`] says.
    pub model: ScoreModel,
    /// How finely the densities are computed, and within which memory.
    pub builder: PairBuilder,
    /// What fixes gamma.
    pub energy: EnergyScale,
    /// Pose of the moving part in which the parts fit.
    pub assembled: Pose,
    /// Middle of the displacements of interest from the assembled pose, metres, along the fixed
    /// part's own axes.
    pub center: DVec3,
    /// Half the sides of their box along these axes, metres; chosen from the moving part if absent
    /// ([`PairSetup::reach`]).
    pub half_extent: Option<DVec3>,
    /// Where a scene puts the parts; decides nothing about the pair.
    pub placement: Placement,
    /// Where fields are kept between runs.
    pub cache: Option<FieldCache>,
}

/// Why a setup gives no pair.
#[derive(Debug, thiserror::Error)]
pub enum PairSetupError {
    /// The fields cannot be had.
    #[error(transparent)]
    Build(PairBuildError),
    /// The energy scale cannot be had.
    #[error(transparent)]
    Energy(#[from] EnergyScaleError),
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<PairBuildError> for PairSetupError {
    fn from(error: PairBuildError) -> Self {
        match error {
            PairBuildError::Density {
                source: DensityError::Cancelled,
                ..
            } => Self::Cancelled,
            other => Self::Build(other),
        }
    }
}

impl PairSetup {
    /// Two parts that fit where they are: the guided model as it is, lattices chosen from the parts,
    /// no memory limit, no cache.
    pub fn new(fixed: Arc<TriangleMesh>, moving: Arc<TriangleMesh>) -> Self {
        Self {
            fixed,
            moving,
            model: ScoreModel::GUIDED,
            builder: PairBuilder::default(),
            energy: EnergyScale::Gamma(ScoreModel::GUIDED.gamma),
            assembled: Pose::IDENTITY,
            center: DVec3::ZERO,
            half_extent: None,
            placement: Placement::IDENTITY,
            cache: None,
        }
    }

    /// Half the sides of the box of displacements, metres: half the longest side of the moving part
    /// either way unless given.
    pub fn reach(&self) -> DVec3 {
        let longest = || self.moving.bounds().size().max_element();
        self.half_extent
            .unwrap_or_else(|| DVec3::splat(0.5 * longest()))
    }

    /// The energy scale of the pair, joules per cubic metre; nothing else is computed.
    ///
    /// # Errors
    /// As [`EnergyScale::gamma`].
    pub fn gamma(&self) -> Result<f64, EnergyScaleError> {
        self.energy.gamma(&self.model, &self.fixed, &self.moving)
    }

    /// Lattices, halo, pivot and memory of the pair; nothing of their size is allocated.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`].
    pub fn plan(&self) -> Result<PairPlan, PairBuildError> {
        self.builder.plan(&self.fixed, &self.moving, &self.model)
    }

    /// The pair, its fields computed or found in the cache, with the energy scale asked for.
    ///
    /// # Errors
    /// As [`PairPlan::build`] and [`EnergyScale::gamma`].
    pub fn load(&self, monitor: &dyn Monitor) -> Result<Pair, PairSetupError> {
        let cache = self.cache.as_ref();
        let pair = self
            .plan()?
            .build(&self.fixed, &self.moving, cache, monitor)?;
        Ok(pair
            .with_gamma(self.gamma()?)
            .map_err(PairBuildError::from)?)
    }
}
