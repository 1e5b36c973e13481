//! The table of a scene: designed, filled, and compared with the scene and with the truth.

use fft_correlate::table::TableSetupError;
use fft_correlate::tolerance::{TolerantDirect, TolerantPlan, Trial};
use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergyTable, ErrorReport, Pair, PairEnergies, Pose, StoreError,
    TablePlan, TableSpec, TableStore, measure_error, typical_condition,
};
use sdf_grid::Monitor;

use crate::error::SceneError;
use crate::setup::scene_setup::SceneSetup;

/// At how many poses at most the condition number of the score is found, cell by cell.
const CONDITION_POSES: usize = 8;

/// At how many held-out poses the error of a table is measured unless somebody asks for more: fewer
/// where it was made for a tolerance, as its truth is then on half its spacing, which takes eight times
/// as long.
pub fn held_out_poses(tolerance: Option<f64>) -> usize {
    match tolerance {
        None => 1000,
        Some(_) => 300,
    }
}

/// The reference against which the error of a table is measured.
///
/// ```
/// use fft_correlate::EnergyTable;
/// use pegfit_scene::{Scene, SceneSetup};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let text = r#"
///     unit = "mm"
///     fixed = "hole.obj"
///     moving = "peg.obj"
///     lattice.spacing = 4
///     window.half_extent = [12, 12, 12]
///     rotations = { kind = "ball", angle_deg = 4, step_deg = 2 }
/// "#;
/// let scene = Scene::parse("scene.toml", text)?;
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = SceneSetup::from_solids(scene, hole, peg, 1 << 30)?;
/// let plan = setup.design(setup.pair_in_window(&Silent)?)?;
/// let energies = setup.energies(&plan)?;
/// let table = EnergyTable::compute(plan.spec.clone(), &energies, 1 << 30, &Silent)?;
/// let report = setup.reference_on(&plan.pair)?.measure(&table, &plan.pair, 20, 1);
/// assert_eq!(report.reference_spacing, 0.004);
/// assert!(report.energy.relative() < 0.1, "{report:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TableReference {
    /// Direct quadrature, with the table's energy scale.
    pub truth: DirectEvaluator,
    /// Spacing of the lattices that it sums over, metres.
    pub spacing: f64,
}

impl TableReference {
    /// The error of a table at `poses` random poses, and the median condition number of the score of
    /// `pair` at the first 8 of them.
    pub fn measure(
        &self,
        table: &EnergyTable,
        pair: &Pair,
        poses: usize,
        seed: u64,
    ) -> ErrorReport {
        let looks = poses.min(CONDITION_POSES);
        let mut report = measure_error(table, &self.truth, poses, seed);
        report.reference_spacing = self.spacing;
        report.condition = Some(typical_condition(pair, table.spec(), looks, seed));
        report
    }
}

impl SceneSetup {
    /// The table of the scene; `pair` is [`SceneSetup::pair_in_window`]'s.
    ///
    /// # Errors
    /// If its window has too many nodes.
    pub fn design(&self, pair: Pair) -> Result<TablePlan, SceneError> {
        let design = TablePlan::new(&self.parts, pair, self.rotations.clone());
        design.map_err(|e| self.scene.design_error(e))
    }

    /// The coarsest table of the scene whose errors of force and torque, the rms of each as a share
    /// of its own rms, are within `tolerance` by its probes; `tried` hears of every step.
    ///
    /// # Errors
    /// As [`TablePlan::for_tolerance`].
    pub fn design_for(
        &self,
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<TolerantPlan, SceneError> {
        let (parts, rotations) = (&self.parts, &self.rotations);
        TablePlan::for_tolerance(parts, rotations, tolerance, self.memory, monitor, tried)
            .map_err(|e| self.scene.tolerance_error(e))
    }

    /// Direct quadrature on the coarsest lattice on which errors at `poses` (of the shapes) are within
    /// `tolerance`; `tried` hears of every step.
    ///
    /// # Errors
    /// As [`TolerantDirect::new`].
    pub fn direct_for(
        &self,
        poses: &[Pose],
        tolerance: f64,
        monitor: &dyn Monitor,
        tried: &mut dyn FnMut(Trial),
    ) -> Result<TolerantDirect, SceneError> {
        TolerantDirect::new(&self.parts, poses, tolerance, monitor, tried)
            .map_err(|e| self.scene.tolerance_error(e))
    }

    /// The correlation that fills a table of the scene.
    ///
    /// # Errors
    /// If it does not fit in memory, or its rotations or window are out of range.
    pub fn energies(&self, design: &TablePlan) -> Result<PairEnergies, SceneError> {
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
    /// and the pair that it evaluates. Both are for poses of the table.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`], or if a part has no interior on its lattice.
    pub fn reference(
        &self,
        spec: &TableSpec,
        spacing: Option<f64>,
        monitor: &dyn Monitor,
    ) -> Result<(TableReference, Pair), SceneError> {
        let mut parts = self.parts.as_baked(spec);
        parts.builder.spacing = spacing.or(parts.builder.spacing);
        let window = spec.window.node_bounds();
        let pair = parts.load_in(&window, monitor);
        let pair = pair.map_err(|e| self.scene.pair_error(e))?;
        Ok((self.reference_on(&pair)?, pair))
    }

    /// What the error of a table is measured against if that is the pair it was baked from, or the same
    /// on another lattice.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn reference_on(&self, pair: &Pair) -> Result<TableReference, SceneError> {
        Ok(TableReference {
            truth: self.direct(pair, &DirectOptions::FULL)?,
            spacing: pair.spacing(),
        })
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
