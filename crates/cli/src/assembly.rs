//! From a scene to a pair that can be scored: meshes read, placed and checked, fields computed or
//! found in the cache, the energy scale fixed.

use std::time::Instant;

use fft_correlate::well::gamma_for_peak_force;
use fft_correlate::{
    DirectEvaluator, DirectOptions, EnergySource, Pair, PairBuildError, PairBuilder, Pose,
    TranslationWindow,
};
use glam::DVec3;
use haptic::Geometry;
use sdf_grid::{Aabb, DensityError, DensityField, HygieneOptions, TriangleMesh, mesh_io};

use crate::command::Context;
use crate::error::CommandError;
use crate::scene::{EnergyScale, LatticeStep, Part, Scene};

/// Parts whose diagonals differ by more than this are probably in different units.
const SUSPICIOUS_RATIO: f64 = 30.0;

/// How far a careless hand tilts the part, radians.
const CARELESS_TILT: f64 = 0.08;

/// A scene ready to be scored.
#[derive(Debug)]
pub struct Assembly {
    /// The scene.
    pub scene: Scene,
    /// The fixed part, placed.
    pub fixed: TriangleMesh,
    /// The moving part, placed.
    pub moving: TriangleMesh,
    /// Densities, model and pivot; its gamma is the scene's.
    pub pair: Pair,
    /// Half the sides of the translation window, metres.
    pub half_extent: DVec3,
    /// Seconds spent on the density fields.
    pub field_seconds: f64,
}

impl Assembly {
    /// Reads the scene's meshes and computes what every command needs.
    ///
    /// # Errors
    /// If a mesh cannot be used, the fields would not fit in memory, or the user interrupts.
    pub fn load(scene: Scene, context: &Context) -> Result<Self, CommandError> {
        let fixed = read_part(&scene, &scene.fixed, context)?;
        let moving = read_part(&scene, &scene.moving, context)?;
        warn_of_scale(&scene, &fixed, &moving, context);
        let began = Instant::now();
        let pair = compute_pair(&scene, &fixed, &moving, context)?;
        let field_seconds = began.elapsed().as_secs_f64();
        context.progress.finish();
        let half_extent = scene
            .window
            .half_extent
            .unwrap_or_else(|| DVec3::splat(0.5 * moving.bounds().size().max_element()));
        let pair = scaled(&scene, pair, half_extent)?;
        Ok(Self {
            scene,
            fixed,
            moving,
            pair,
            half_extent,
            field_seconds,
        })
    }

    /// The pose in which the scene's parts fit.
    pub fn assembled(&self) -> Pose {
        self.scene.fit.assembled
    }

    /// A direct evaluator of the pair.
    ///
    /// # Errors
    /// If a part has no interior on its lattice.
    pub fn direct(&self, options: &DirectOptions) -> Result<DirectEvaluator, CommandError> {
        direct(&self.scene, &self.pair, options)
    }

    /// The translation window of the scene, about the assembled pose's pivot displacement.
    ///
    /// # Errors
    /// If it has too many nodes.
    pub fn window(&self) -> Result<TranslationWindow, CommandError> {
        let middle = self.scene.window.center + self.pair.displacement(&self.assembled());
        TranslationWindow::new(
            middle - self.half_extent,
            middle + self.half_extent,
            self.pair.spacing(),
        )
        .map_err(|e| CommandError::bad_input(self.context("window"), e))
    }

    /// Where the fit is and how one gets there.
    ///
    /// An axis that the scene does not give is the coordinate direction along which the part can
    /// be withdrawn with the least climb in energy.
    pub fn geometry(&self, source: &dyn EnergySource) -> Geometry {
        let seated = self.assembled();
        let size = self
            .moving
            .transformed(seated.rotation, DVec3::ZERO)
            .bounds()
            .size();
        let axis = self
            .scene
            .fit
            .axis
            .unwrap_or_else(|| -easiest_way_out(source, &seated, size));
        let along = axis.abs().dot(size);
        let across = size.length_squared() - along * along;
        Geometry {
            seated,
            axis,
            depth: self.scene.fit.depth.unwrap_or(along),
            radius: 0.25 * (0.5 * across.max(0.0)).sqrt(),
            tilt: CARELESS_TILT,
        }
    }

    /// The box around both parts when assembled, grown by `margin` of its longest side.
    pub fn bounds(&self, margin: f64) -> Aabb {
        let pose = self.assembled();
        let moving = self.moving.transformed(pose.rotation, pose.translation);
        let both = self.fixed.bounds().union(&moving.bounds());
        both.grown(margin * both.size().max_element())
    }

    /// The moving part's bounding radius about its pivot, metres.
    pub fn radius(&self) -> f64 {
        let pivot = self.pair.pivot();
        self.moving
            .vertices()
            .iter()
            .map(|v| v.distance(pivot))
            .fold(0.0, f64::max)
    }

    /// What errors say they are about: the scene file and a part of it.
    pub fn context(&self, item: &str) -> String {
        format!("{}: {item}", self.scene.path.display())
    }
}

fn read_part(scene: &Scene, part: &Part, context: &Context) -> Result<TriangleMesh, CommandError> {
    let (mesh, report) = mesh_io::read(&part.mesh, scene.unit, &HygieneOptions::default())?;
    for warning in report.warnings() {
        context.progress.note(&format!("note: {warning}"));
    }
    if part.pose == Pose::IDENTITY {
        return Ok(mesh);
    }
    Ok(mesh.transformed(part.pose.rotation, part.pose.translation))
}

fn warn_of_scale(scene: &Scene, fixed: &TriangleMesh, moving: &TriangleMesh, context: &Context) {
    let (a, b) = (fixed.bounds().diagonal(), moving.bounds().diagonal());
    let ratio = a.max(b) / a.min(b);
    if ratio > SUSPICIOUS_RATIO {
        let unit = scene.unit;
        let metre = unit.in_metres();
        context.progress.note(&format!(
            "warning: {} is {:.4} {unit} across and {} is {:.4} {unit}: are both in {unit}?",
            scene.fixed.name,
            a / metre,
            scene.moving.name,
            b / metre
        ));
    }
}

fn compute_pair(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
    context: &Context,
) -> Result<Pair, CommandError> {
    let spacing = match scene.lattice.step {
        LatticeStep::Spacing(h) => Some(h),
        LatticeStep::Points(n) => {
            let longest = |m: &TriangleMesh| m.bounds().size().max_element();
            Some(longest(fixed).max(longest(moving)) / f64::from(n))
        }
        LatticeStep::Automatic => None,
    };
    let builder = PairBuilder {
        spacing,
        halo: scene.lattice.halo,
        tolerance: scene.lattice.field_tolerance,
        sampling: scene.lattice.sampling,
        memory_limit: Some(context.memory),
    };
    let explain = |error| explain(scene, error);
    let plan = builder.plan(fixed, moving, &scene.model).map_err(explain)?;
    plan.build_with(fixed, moving, |mesh, kernel, lattice, options| {
        DensityField::compute(mesh, kernel, lattice, options, &context.progress)
    })
    .map_err(explain)
}

fn explain(scene: &Scene, error: PairBuildError) -> CommandError {
    match error {
        PairBuildError::Memory { needed, limit, .. } => CommandError::Memory {
            what: format!("{}: the density fields", scene.path.display()),
            needed,
            budget: limit,
        },
        PairBuildError::Density {
            source: DensityError::Cancelled,
            ..
        } => CommandError::Interrupted,
        other => CommandError::bad_input(scene.path.display().to_string(), other),
    }
}

/// The pair with the scene's energy scale.
fn scaled(scene: &Scene, pair: Pair, window: DVec3) -> Result<Pair, CommandError> {
    let failed = |e| CommandError::bad_input(format!("{}: energy", scene.path.display()), e);
    let gamma = match scene.energy {
        EnergyScale::Gamma(gamma) => gamma,
        EnergyScale::PeakForce(newtons) => {
            let source = direct(scene, &pair, &DirectOptions::REAL_TIME)?;
            let gamma = pair.model().gamma;
            gamma_for_peak_force(&source, gamma, &scene.fit.assembled, window, newtons).map_err(
                |e| CommandError::bad_input(format!("{}: energy", scene.path.display()), e),
            )?
        }
    };
    pair.with_gamma(gamma).map_err(failed)
}

fn direct(
    scene: &Scene,
    pair: &Pair,
    options: &DirectOptions,
) -> Result<DirectEvaluator, CommandError> {
    DirectEvaluator::new(pair, options)
        .map_err(|e| CommandError::bad_input(scene.path.display().to_string(), e))
}

/// Of the six coordinate directions, the one whose highest energy on the way out is lowest; the
/// first such one of +z, -z, +y, -y, +x, -x.
fn easiest_way_out(source: &dyn EnergySource, seated: &Pose, size: DVec3) -> DVec3 {
    const STEPS: u32 = 60;
    let mut scratch = source.scratch();
    let mut climb = |direction: DVec3| {
        let reach = direction.abs().dot(size);
        (1..=STEPS)
            .map(|i| {
                let away = direction * (reach * f64::from(i) / f64::from(STEPS));
                let pose = Pose {
                    translation: seated.translation + away,
                    ..*seated
                };
                source.evaluate(&pose, &mut scratch).energy
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let mut best = (f64::INFINITY, DVec3::Z);
    for axis in [DVec3::Z, DVec3::Y, DVec3::X] {
        for direction in [axis, -axis] {
            let energy = climb(direction);
            // A part symmetric front to back differs by rounding only: keep the first.
            if energy < best.0 - 1e-3 * best.0.abs() {
                best = (energy, direction);
            }
        }
    }
    best.1
}
