//! A scene ready to be scored: its meshes read, its fields computed, the energy scale fixed.

use std::time::Instant;

use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, InScene, Pair, PairSetup, Placement, Pose,
    RotationDomain, TableDesign, TableDesignError, from_fit, symmetry_group, symmetry_on_lattice,
};
use glam::DVec3;
use haptic::Geometry;
use sdf_grid::{Aabb, LengthUnit};

use super::setup::{bounds, display_unit, explain, put, rotations, setup};
use super::types::Scene;
use crate::context::Context;
use crate::error::CommandError;

/// A scene ready to be scored.
#[derive(Debug)]
pub struct Assembly {
    /// The scene.
    pub scene: Scene,
    /// Its parts, each in its own frame, and what is asked of them there.
    pub setup: PairSetup,
    /// The rotations that it names, of the shapes.
    pub rotations: RotationDomain,
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
        let rotations = rotations(&scene)?;
        let setup = setup(&scene, context)?;
        let began = Instant::now();
        let pair = setup
            .load(&context.progress)
            .map_err(|e| explain(&scene, e))?;
        context.progress.finish();
        Ok(Self {
            scene,
            setup,
            rotations,
            pair,
            field_seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// The pose in the scene in which its parts fit; that of the shapes is the setup's.
    pub fn assembled(&self) -> Pose {
        self.scene.fit.assembled
    }

    /// Where the scene puts the shapes.
    pub fn placement(&self) -> &Placement {
        &self.setup.placement
    }

    /// The pair's pivot where the scene puts it: the point that poses in the scene turn least.
    pub fn pivot(&self) -> DVec3 {
        self.placement().moving.apply(self.pair.pivot())
    }

    /// A direct evaluator of the pair, asked in the scene.
    ///
    /// # Errors
    /// As [`Assembly::direct`].
    pub fn source(
        &self,
        options: &DirectOptions,
    ) -> Result<InScene<DirectEvaluator>, CommandError> {
        Ok(InScene::new(self.direct(options)?, *self.placement()))
    }

    /// A direct evaluator of the pair, asked at poses of the shapes.
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
        let (pair, rotations) = (self.pair.clone(), self.rotations.clone());
        TableDesign::new(&self.setup, pair, rotations).map_err(|e| explain_design(&self.scene, e))
    }

    /// Distance of the pivot (metres) and angle (radians) between a pose in the scene and the fit,
    /// or that turn of it under the moving part's symmetry which is nearest in angle.
    pub fn from_fit(&self, pose: &Pose) -> (f64, f64) {
        let axes = symmetry_on_lattice(&self.setup.moving, self.pair.spacing());
        let (fit, pivot) = (self.setup.assembled, self.pair.pivot());
        let pose = self.placement().to_shapes(pose);
        from_fit(&pose, &fit, pivot, &symmetry_group(&axes))
    }

    /// Where the fit is and how one gets there, in the scene; so is `source`.
    pub fn geometry(&self, source: &dyn EnergySource) -> Geometry {
        let fit = &self.scene.fit;
        let moving = put(&self.setup.moving, &self.placement().moving);
        Geometry::of_fit(source, &moving, fit.assembled, fit.axis, fit.depth)
    }

    /// The box in the scene around both assembled parts, grown by `margin` of its longest side.
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
