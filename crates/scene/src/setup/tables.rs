//! The table of a scene: designed, filled, and compared with the scene.

use fft_correlate::table::{TableSetupError, TolerantDesign, Trial};
use fft_correlate::{
    DirectEvaluator, DirectOptions, Pair, PairEnergies, StoreError, TableDesign, TableSpec,
    TableStore,
};
use sdf_grid::Monitor;

use crate::error::SceneError;
use crate::setup::scene_setup::SceneSetup;

impl SceneSetup {
    /// The table of the scene; `pair` is [`SceneSetup::pair`]'s.
    ///
    /// # Errors
    /// If its window has too many nodes.
    pub fn design(&self, pair: Pair) -> Result<TableDesign, SceneError> {
        let design = TableDesign::new(&self.parts, pair, self.rotations.clone());
        design.map_err(|e| self.scene.design_error(e))
    }

    /// The coarsest table of the scene whose force error, the rms as a share of the rms force, is
    /// within `tolerance` by its probes; `tried` hears of every step.
    ///
    /// # Errors
    /// As [`TableDesign::for_tolerance`].
    pub fn design_for(
        &self,
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<TolerantDesign, SceneError> {
        let (parts, rotations) = (&self.parts, &self.rotations);
        TableDesign::for_tolerance(parts, rotations, tolerance, self.memory, monitor, tried)
            .map_err(|e| self.scene.tolerance_error(e))
    }

    /// The correlation that fills a table of the scene.
    ///
    /// # Errors
    /// If it does not fit in memory, or its rotations or window are out of range.
    pub fn energies(&self, design: &TableDesign) -> Result<PairEnergies, SceneError> {
        let energies = design.energies(self.memory);
        energies.map_err(|e| self.scene.design_error(e))
    }

    /// Checks that a table was baked from the scene's parts, model and fields; nothing is computed.
    ///
    /// # Errors
    /// [`SceneError::OtherTable`] names the first key that differs.
    pub fn expect_table(&self, store: &TableStore) -> Result<(), SceneError> {
        store.expect_setup(&self.parts).map_err(|e| match e {
            TableSetupError::Build(e) => self.scene.fields_error(e),
            TableSetupError::Store(StoreError::Different { path, difference }) => {
                SceneError::OtherTable {
                    path: self.scene.path.clone(),
                    table: path,
                    difference,
                }
            }
            TableSetupError::Store(other) => other.into(),
        })
    }

    /// The setup on the lattice and over the rotations that a table was baked on, which its tolerance
    /// may have chosen.
    #[must_use]
    pub fn as_baked(self, spec: &TableSpec) -> Self {
        Self {
            parts: self.parts.as_baked(spec),
            rotations: spec.rotations.clone(),
            ..self
        }
    }

    /// What the error of a table with this `spec` is measured against: direct quadrature on densities
    /// of `spacing` (metres; the table's own if `None`), with the table's sampling and energy scale;
    /// and the pair that it evaluates.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`], or if a part has no interior on its lattice.
    pub fn reference(
        &self,
        spec: &TableSpec,
        spacing: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(DirectEvaluator, Pair), SceneError> {
        let mut parts = self.parts.as_baked(spec);
        parts.builder.spacing = spacing.or(parts.builder.spacing);
        let pair = parts.load(monitor).map_err(|e| self.scene.pair_error(e))?;
        Ok((self.direct(&pair, &DirectOptions::FULL)?, pair))
    }

    /// A direct evaluator of one of the scene's pairs, asked at poses of the shapes.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn direct(
        &self,
        pair: &Pair,
        options: &DirectOptions,
    ) -> Result<DirectEvaluator, SceneError> {
        DirectEvaluator::new(pair, options)
            .map_err(|e| SceneError::refused(&self.scene.path, "", e))
    }
}
