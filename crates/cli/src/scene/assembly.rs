//! From a scene to a pair that can be scored: meshes read, placed and checked, fields computed or
//! found in the cache, the energy scale fixed.

mod fields;
mod parts;

use std::time::Instant;

use fft_correlate::bake::PairEnergies;
use fft_correlate::well::gamma_for_peak_force;
use fft_correlate::{
    AxisSymmetry, DirectEvaluator, DirectOptions, EnergySource, FieldSampling, Pair, Pose,
    RotationGrid, TableSpec, TranslationWindow,
};
use glam::{DQuat, DVec3};
use haptic::Geometry;
use sdf_grid::{Aabb, LengthUnit, SymmetryAxis, SymmetryOrder, TriangleMesh, symmetry};

use crate::context::Context;
use crate::error::CommandError;
use crate::memory;
use crate::scene::{EnergyScale, Scene};
use fields::compute_pair;
pub(crate) use fields::plan;
use parts::warn_of_scale;
pub(crate) use parts::{hash_text, read_part};

/// Deviation from symmetry that counts as none, in lattice spacings.
const SYMMETRY_TOLERANCE: f64 = 0.02;

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
    /// Symmetry axes of the fixed part, highest order first.
    pub fixed_symmetry: Vec<SymmetryAxis>,
    /// Symmetry axes of the moving part, highest order first.
    pub moving_symmetry: Vec<SymmetryAxis>,
    /// Half the sides of the translation window, metres.
    pub half_extent: DVec3,
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
        Self::load_on(scene, |_, _| {}, context)
    }

    /// [`Assembly::load`] after `choose` has seen the moving part and set what it wants of the scene.
    ///
    /// # Errors
    /// As there.
    pub fn load_on(
        scene: Scene,
        choose: impl FnOnce(&mut Scene, &TriangleMesh),
        context: &Context,
    ) -> Result<Self, CommandError> {
        let mut scene = scene.only(None)?;
        let fixed = read_part(&scene, &scene.fixed, context)?;
        let moving = read_part(&scene, &scene.moving, context)?;
        choose(&mut scene, &moving);
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
        // What a lattice cannot tell apart is symmetric enough.
        let tolerance = SYMMETRY_TOLERANCE * pair.spacing();
        Ok(Self {
            fixed_symmetry: symmetry::detect(&fixed, tolerance),
            moving_symmetry: symmetry::detect(&moving, tolerance),
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

    /// The rotations of the scene, shortened by the symmetry of a part if it has any.
    ///
    /// # Errors
    /// If the domain is out of range or would have too many nodes.
    pub fn rotation_grid(&self) -> Result<RotationGrid, CommandError> {
        RotationGrid::new(&self.scene.rotations, self.table_symmetry().as_ref())
            .map_err(|e| CommandError::bad_input(self.context("rotations"), e))
    }

    /// What a table of this scene holds.
    ///
    /// # Errors
    /// If the window has too many nodes.
    pub fn table_spec(&self) -> Result<TableSpec, CommandError> {
        let mut spec =
            TableSpec::for_pair(&self.pair, &self.window()?, self.scene.rotations.clone());
        spec.symmetry = self.table_symmetry();
        spec.fields = Some(FieldSampling {
            sampling: self.scene.lattice.sampling,
            deaverage: self.scene.lattice.deaverage,
        });
        [spec.fixed_mesh, spec.moving_mesh] = self.mesh_hashes();
        Ok(spec)
    }

    /// The hashes of the fixed and the moving mesh, in hexadecimal.
    pub fn mesh_hashes(&self) -> [String; 2] {
        [&self.fixed, &self.moving].map(hash_text)
    }

    /// The correlation that fills a table.
    ///
    /// # Errors
    /// If it would not fit in memory, or the rotations are not a grid.
    pub fn energies(&self, context: &Context) -> Result<PairEnergies, CommandError> {
        let window = self.window()?;
        self.require_correlation_memory(&window, context)?;
        let grid = self.rotation_grid()?;
        PairEnergies::plan_for(&self.pair, &window, grid.nodes())
            .map_err(|e| CommandError::bad_input(self.context("window"), e))
    }

    /// The symmetry by which rotation nodes are left out: the axis of highest order of either
    /// part. Lists and spins are taken as they are written.
    pub fn table_symmetry(&self) -> Option<AxisSymmetry> {
        use fft_correlate::RotationDomain::{Ball, Full};
        if !matches!(self.scene.rotations, Ball { .. } | Full { .. }) {
            return None;
        }
        let of = |part, axes: &[SymmetryAxis]| {
            axes.first().map(|axis| AxisSymmetry {
                part,
                axis: axis.direction.to_array(),
                point: axis.point.to_array(),
                order: match axis.order {
                    SymmetryOrder::Continuous => 0,
                    SymmetryOrder::Finite(n) => n,
                },
            })
        };
        // An order beyond what grids accept is of no use to them.
        let candidates = [
            of(fft_correlate::Part::Moving, &self.moving_symmetry),
            of(fft_correlate::Part::Fixed, &self.fixed_symmetry),
        ];
        candidates
            .into_iter()
            .flatten()
            .filter(|s| s.order <= 64)
            .max_by_key(|s| if s.order == 0 { u32::MAX } else { s.order })
    }

    /// Turns of the moving part onto itself, so that poses which differ by one count as the same;
    /// a continuous axis is stood for by turns of 10 degrees.
    pub fn symmetry_turns(&self) -> Vec<Pose> {
        self.moving_symmetry
            .iter()
            .flat_map(|axis| {
                let turns = match axis.order {
                    SymmetryOrder::Continuous => 36,
                    SymmetryOrder::Finite(n) => n,
                };
                (1..turns).map(move |i| {
                    let angle = std::f64::consts::TAU * f64::from(i) / f64::from(turns);
                    let turn = DQuat::from_axis_angle(axis.direction, angle);
                    Pose::new(turn, axis.point - turn * axis.point)
                })
            })
            .collect()
    }

    /// Distance of the pivot (metres) and angle (radians) between a pose and the fit, or that turn
    /// of it under the moving part's symmetry which is nearest in angle.
    pub fn from_fit(&self, pose: &Pose) -> (f64, f64) {
        let fit = self.assembled();
        let pivot = self.pair.pivot();
        std::iter::once(Pose::IDENTITY)
            .chain(self.symmetry_turns())
            .map(|turn| fit * turn)
            .map(|same| {
                (
                    same.apply(pivot).distance(pose.apply(pivot)),
                    same.angle_to(pose),
                )
            })
            .min_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap_or((f64::NAN, f64::NAN))
    }

    /// Refuses a correlation over `window` that would not fit in memory.
    ///
    /// # Errors
    /// Names the need and the budget.
    pub fn require_correlation_memory(
        &self,
        window: &TranslationWindow,
        context: &Context,
    ) -> Result<(), CommandError> {
        // The transform covers the turned moving part and the window; one field per product and a
        // work space per thread, 8 bytes per point, lengths rounded up by at most a tenth.
        let moving = 2.0 * self.radius() / self.pair.spacing() + 2.0;
        let points: f64 = window
            .shape()
            .iter()
            .map(|&w| 1.1 * (w as f64 + moving))
            .product();
        let fields = 2.0 + 2.0 * rayon::current_num_threads() as f64;
        memory::require(
            &self.context("the correlation"),
            (8.0 * points * fields) as u64,
            context.memory,
        )
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

    /// The unit for reports and pictures: the scene's, but millimetres instead of small fractions
    /// of a metre.
    pub fn display_unit(&self) -> LengthUnit {
        let longest = self.bounds(0.0).size().max_element();
        match self.scene.unit {
            LengthUnit::M if longest < 0.5 => LengthUnit::Mm,
            unit => unit,
        }
    }

    /// What errors say they are about: the scene file and a part of it.
    pub fn context(&self, item: &str) -> String {
        format!("{}: {item}", self.scene.path.display())
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
