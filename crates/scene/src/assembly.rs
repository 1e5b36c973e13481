//! A scene ready to be scored: its meshes read, its fields computed, the energy scale fixed; and profiles
//! of its energy through the fit.

use web_time::Instant;

use fft_correlate::{
    Correlator, DirectEvaluator, DirectOptions, EnergySource, InScene, Pair, Placement, Pose,
    Response, TablePlan, TranslationWindow, Well, WellOptions, from_fit, symmetry_group,
    symmetry_on_lattice,
};
use glam::{DQuat, DVec3};
use haptic::{Geometry, Workspace};
use ndarray::Array3;
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::error::SceneError;
use crate::scene::Scene;
use crate::setup::scene_setup::SceneSetup;

/// A scene ready to be scored.
///
/// ```
/// use fft_correlate::{DirectOptions, EnergySource};
/// use pegfit_scene::{Assembly, Scene, SceneSetup};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let text = "unit = \"mm\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\nlattice.spacing = 4";
/// let scene = Scene::parse("scene.toml", text)?;
/// // Solids from anywhere; `Assembly::load` reads those that the scene names.
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = SceneSetup::from_solids(scene, hole, peg, 1 << 30)?;
/// let assembly = Assembly::new(setup, &Silent)?;
/// assert_eq!(assembly.pair.spacing(), 0.004);
/// let source = assembly.source(&DirectOptions::FULL)?;
/// let response = source.evaluate(&assembly.assembled(), &mut source.scratch());
/// assert!(response.energy < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Assembly {
    /// The scene and its parts.
    pub setup: SceneSetup,
    /// Densities, model and pivot; its gamma is the scene's.
    pub pair: Pair,
    /// Seconds spent on the density fields.
    pub field_seconds: f64,
}

impl Assembly {
    /// Reads the meshes of a scene with one fixed part and computes their fields, within `memory`
    /// bytes.
    ///
    /// # Errors
    /// As [`SceneSetup::read`] and [`Assembly::new`].
    pub fn load(scene: Scene, memory: u64, monitor: &dyn Monitor) -> Result<Self, SceneError> {
        Self::new(SceneSetup::read(scene, memory)?, monitor)
    }

    /// Computes the fields of parts that have been read.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn new(setup: SceneSetup, monitor: &dyn Monitor) -> Result<Self, SceneError> {
        Self::with(setup, |setup| setup.pair(monitor))
    }

    /// The same for a loop, for poses near the fit ([`SceneSetup::pair_near_fit`]): of a large part far
    /// less is computed. [`LivePairs`](crate::LivePairs) brings the rest.
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn near_fit(setup: SceneSetup, monitor: &dyn Monitor) -> Result<Self, SceneError> {
        Self::with(setup, |setup| setup.pair_near_fit(monitor))
    }

    /// The same for a loop, for poses about the fit ([`SceneSetup::pair_about_fit`]).
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn about_fit(
        setup: SceneSetup,
        lengths: f64,
        monitor: &dyn Monitor,
    ) -> Result<Self, SceneError> {
        Self::with(setup, |setup| setup.pair_about_fit(lengths, monitor))
    }

    /// The same for poses in the scene's window ([`SceneSetup::pair_in_window`]).
    ///
    /// # Errors
    /// As [`SceneSetup::pair`].
    pub fn in_window(setup: SceneSetup, monitor: &dyn Monitor) -> Result<Self, SceneError> {
        Self::with(setup, |setup| setup.pair_in_window(monitor))
    }

    fn with(
        setup: SceneSetup,
        pair: impl FnOnce(&SceneSetup) -> Result<Pair, SceneError>,
    ) -> Result<Self, SceneError> {
        let began = Instant::now();
        Ok(Self {
            pair: pair(&setup)?,
            setup,
            field_seconds: began.elapsed().as_secs_f64(),
        })
    }

    /// The scene.
    pub fn scene(&self) -> &Scene {
        &self.setup.scene
    }

    /// The pose in the scene in which its parts fit; that of the shapes is the setup's.
    pub fn assembled(&self) -> Pose {
        self.scene().fit.assembled
    }

    /// Where the scene puts the shapes.
    pub fn placement(&self) -> &Placement {
        self.setup.placement()
    }

    /// The pair's pivot where the scene puts it, metres: the point that poses in the scene turn least.
    pub fn pivot(&self) -> DVec3 {
        self.placement().moving.apply(self.pair.pivot())
    }

    /// A direct evaluator of the pair, asked in the scene.
    ///
    /// # Errors
    /// As [`Assembly::direct`].
    pub fn source(&self, options: &DirectOptions) -> Result<InScene<DirectEvaluator>, SceneError> {
        Ok(InScene::new(self.direct(options)?, *self.placement()))
    }

    /// A direct evaluator of the pair, asked at poses of the shapes.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn direct(&self, options: &DirectOptions) -> Result<DirectEvaluator, SceneError> {
        self.setup.direct(&self.pair, options)
    }

    /// The table of the scene.
    ///
    /// # Errors
    /// If its window has too many nodes.
    pub fn design(&self) -> Result<TablePlan, SceneError> {
        self.setup.design(self.pair.clone())
    }

    /// The score of the assembled rotation at every displacement of a window, cubic metres.
    ///
    /// # Errors
    /// If the window is too large for a transform.
    pub fn scores(&self, window: &TranslationWindow) -> Result<Array3<f32>, SceneError> {
        let correlator = Correlator::new(&self.pair, window)
            .map_err(|e| SceneError::refused(&self.scene().path, "window", e))?;
        let mut score = Array3::zeros(window.shape());
        let rotation = self.setup.parts.assembled.rotation;
        correlator.score(rotation, &mut correlator.scratch(), score.view_mut());
        self.pair.add_contact(rotation, window, score.view_mut());
        Ok(score)
    }

    /// The well about the fit along the fixed shape's own axes: `source` is asked at poses of the
    /// shapes, a lattice step apart for the second differences.
    ///
    /// # Errors
    /// If the energy has no minimum there.
    pub fn well(&self, source: &dyn EnergySource) -> Result<Well, SceneError> {
        let parts = &self.setup.parts;
        let options = WellOptions {
            length: self.pair.spacing(),
            radius: self.radius(),
            reach: parts.reach().max_element(),
            pivot: self.pair.pivot(),
            directions: DVec3::AXES.into_iter().flat_map(|a| [a, -a]).collect(),
        };
        Well::analyse(source, &parts.assembled, &options)
            .map_err(|e| SceneError::refused(&self.scene().path, "well", e))
    }

    /// Distance of the pivot (metres) and angle (radians) between a pose in the scene and the fit,
    /// or that turn of it under the moving part's symmetry which is nearest in angle.
    pub fn from_fit(&self, pose: &Pose) -> (f64, f64) {
        let parts = &self.setup.parts;
        let axes = symmetry_on_lattice(&parts.moving, self.pair.spacing());
        let pose = self.placement().to_shapes(pose);
        from_fit(
            &pose,
            &parts.assembled,
            self.pair.pivot(),
            &symmetry_group(&axes),
        )
    }

    /// Where the fit is and how one gets there, in the scene; so is `source`.
    pub fn geometry(&self, source: &dyn EnergySource) -> Geometry {
        let fit = &self.scene().fit;
        let moving = self.setup.moving_at(&Pose::IDENTITY);
        Geometry::from_fit(source, &moving, fit.assembled, fit.axis, fit.depth)
    }

    /// Where a hand at rest holds the moving part: at the fit.
    pub fn workspace(&self) -> Workspace {
        let device = &self.scene().device;
        device.workspace(self.assembled(), self.pivot())
    }

    /// The moving part's bounding radius about its pivot, metres.
    pub fn radius(&self) -> f64 {
        self.setup.parts.moving.radius_about(self.pair.pivot())
    }
}

/// One degree of freedom through the assembled pose; directions have unit length and are along the
/// fixed shape's own axes, as displacements of a table are.
///
/// ```
/// use fft_correlate::DirectOptions;
/// use glam::DVec3;
/// use pegfit_scene::{Assembly, Motion, Scene, SceneSetup};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let text = "unit = \"mm\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"\nlattice.spacing = 4";
/// let scene = Scene::parse("scene.toml", text)?;
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let assembly = Assembly::new(SceneSetup::from_solids(scene, hole, peg, 1 << 30)?, &Silent)?;
/// let source = assembly.direct(&DirectOptions::FULL)?;
/// // 4 mm out of the hole and 4 mm too deep: the peg is drawn back, newtons along z.
/// let up = Motion::Translation(DVec3::Z);
/// let profile = assembly.profile(&source, up, &[0.004, -0.004]);
/// assert_eq!(profile[0].amount, 0.004);
/// assert!(profile[0].load < 0.0 && profile[1].load > 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// Along a direction.
    Translation(DVec3),
    /// About a direction, through the pair's pivot.
    Rotation(DVec3),
}

/// One pose of a profile, with the energy and the load there.
///
/// See the example of [`Motion`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// How far from the fit, metres or radians.
    pub amount: f64,
    /// The pose, of the shapes.
    pub pose: Pose,
    /// Energy, wrench and coverage there, of the shapes.
    pub response: Response,
    /// Minus the slope of the energy along the motion: a force, newtons, or a torque about the pivot,
    /// newton metres.
    pub load: f64,
}

impl Assembly {
    /// The assembled pose of the shapes moved by `amount` metres or radians.
    pub fn moved(&self, motion: Motion, amount: f64) -> Pose {
        let assembled = self.setup.parts.assembled;
        match motion {
            Motion::Translation(direction) => Pose {
                translation: assembled.translation + amount * direction,
                ..assembled
            },
            Motion::Rotation(axis) => {
                let turn = DQuat::from_axis_angle(axis, amount);
                let rotation = (turn * assembled.rotation).normalize();
                self.pair.pose(rotation, self.pair.displacement(&assembled))
            }
        }
    }

    /// Energy and load at each of `amounts` (metres or radians) of a motion, in their order; `source`
    /// is asked at poses of the shapes, by all threads.
    pub fn profile(
        &self,
        source: &dyn EnergySource,
        motion: Motion,
        amounts: &[f64],
    ) -> Vec<ProfilePoint> {
        let point = |scratch: &mut _, &amount: &f64| {
            let pose = self.moved(motion, amount);
            let response = source.evaluate(&pose, scratch);
            let load = match motion {
                Motion::Translation(direction) => response.wrench.force.dot(direction),
                Motion::Rotation(axis) => {
                    let arm = pose.rotation * self.pair.pivot();
                    response.wrench.about(arm).torque.dot(axis)
                }
            };
            ProfilePoint {
                amount,
                pose,
                response,
                load,
            }
        };
        let points = amounts.par_iter().map_init(|| source.scratch(), point);
        points.collect()
    }
}
