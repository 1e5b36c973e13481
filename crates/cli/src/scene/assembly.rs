//! A scene ready to be scored: its meshes read, its fields computed, the energy scale fixed.

use std::time::Instant;


use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, Pair, PairSetup, Pose, TableDesign,
    TableDesignError, from_fit, symmetry_group, symmetry_on_lattice,
};
use haptic::Geometry;
use sdf_grid::{Aabb, LengthUnit};

use super::setup::{bounds, display_unit, explain, setup};
use super::types::Scene;
use crate::context::Context;
use crate::error::CommandError;

/// A scene ready to be scored.
#[derive(Debug)]
pub struct Assembly {
    /// The scene.
    pub scene: Scene,
    /// Its parts, placed, and what is asked of them.
    pub setup: PairSetup,
    /// Densities, model and pivot; its gamma is the scene's.
    pub pair: Pair,
    /// Seconds spent on the density fields.
    pub field_seconds: f64,
}

impl Assembly {
    /// Reads the scene's meshes and computes what every command needs.
    ///
    /// # Errors
    /// If the scene has several fixed parts, a mesh cannot be used, the fields would not fit in
    /// memory, or the user interrupts.
    pub fn load(scene: Scene, context: &Context) -> Result<Self, CommandError> {
        let setup = setup(&scene, context)?;
        let began = Instant::now();
        let pair = setup
            .load(&context.progress)
            .map_err(|e| explain(&scene, e))?;
        context.progress.finish();
        Ok(Self {
            scene,
            setup,
            pair,
            field_seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// The pose in which the scene's parts fit.
    pub fn assembled(&self) -> Pose {
        self.setup.assembled
    }

    /// A direct evaluator of the pair.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn direct(&self, options: &DirectOptions) -> Result<DirectEvaluator, CommandError> {
        DirectEvaluator::new(&self.pair, options)
            .map_err(|e| CommandError::bad_input(self.scene.path.display().to_string(), e))
    }

    /// The table of the scene.
    ///
    /// # Errors
    /// If its window has too many nodes.
    pub fn design(&self) -> Result<TableDesign, CommandError> {
        let (pair, rotations) = (self.pair.clone(), self.scene.rotations.clone());
        TableDesign::new(&self.setup, pair, rotations).map_err(|e| explain_design(&self.scene, e))
    }

    /// Distance of the pivot (metres) and angle (radians) between a pose and the fit, or that turn
    /// of it under the moving part's symmetry which is nearest in angle.
    pub fn from_fit(&self, pose: &Pose) -> (f64, f64) {
        let axes = symmetry_on_lattice(&self.setup.moving, self.pair.spacing());
        let (fit, pivot) = (self.assembled(), self.pair.pivot());
        from_fit(pose, &fit, pivot, &symmetry_group(&axes))
    }

    /// Where the fit is and how one gets there.
    pub fn geometry(&self, source: &dyn EnergySource) -> Geometry {
        let fit = &self.scene.fit;
        Geometry::of_fit(
            source,
            &self.setup.moving,
            fit.assembled,
            fit.axis,
            fit.depth,
        )
    }

    /// The box around both parts when assembled, grown by `margin` of its longest side.
    pub fn bounds(&self, margin: f64) -> Aabb {
        bounds(&self.setup, margin)
    }

    /// The moving part's bounding radius about its pivot, metres.
    pub fn radius(&self) -> f64 {
        self.setup.moving.radius_about(self.pair.pivot())
    }

    /// The unit for reports and pictures.
    pub fn display_unit(&self) -> LengthUnit {
        display_unit(&self.scene, &self.setup)
    }

    /// What errors say they are about: the scene file and a part of it.
    pub fn context(&self, item: &str) -> String {
        self.scene.context(item)
    }
}

/// What a scene without a table is to be called.
pub(crate) fn explain_design(scene: &Scene, error: TableDesignError) -> CommandError {
    match error {
        TableDesignError::Window(e) => CommandError::bad_input(scene.context("window"), e),
        TableDesignError::Rotations(e) => CommandError::bad_input(scene.context("rotations"), e),
        TableDesignError::Correlate(e) => CommandError::bad_input(scene.context("window"), e),
        TableDesignError::Memory { needed, limit } => CommandError::Memory {
            what: scene.context("the correlation"),
            needed,
            budget: limit,
        },
    }
}
