//! Fields of a planned pair, taken from a cache where it has them.

use sdf_grid::{DensityField, FieldCache, Monitor, TriangleMesh};

use crate::pair::builder::{PairBuildError, PairPlan};
use crate::pair::fields::Pair;

impl PairPlan {
    /// The pair; with a cache, fields that it holds are read and those that it lacks are kept there.
    ///
    /// # Errors
    /// As [`DensityField::compute`], with the part's name.
    pub fn build(
        &self,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let pair = self.build_with(
            fixed,
            moving,
            |mesh, kernel, lattice, options| match cache {
                Some(cache) => cache.get_or_compute(mesh, kernel, lattice, options, monitor),
                None => DensityField::compute(mesh, kernel, lattice, options, monitor),
            },
        )?;
        Ok(pair.cached_in(cache.cloned()))
    }
}
