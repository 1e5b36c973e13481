//! Content of a page besides the loop: surfaces, densities, places, and the error of the forces.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fft_correlate::{
    DirectEvaluator, DirectOptions, DockingRequest, EnergyScale, EnergySource, Placement, Pose,
    TableStore,
};
use glam::{DQuat, DVec3};
use haptic::Geometry;
use haptic::scene::with_spare_core;
use pegfit_pictures::{Slice, number, sheet, skeleton_points};
use pegfit_scene::{Assembly, Scene};
use rand::rngs::SmallRng;
use rand::{Rng, SeedableRng};
use sdf_grid::{DensityKernel, Monitor, TriangleMesh};
use serde_json::{Value, json};

use crate::error::PlayError;
use crate::protocol::mesh::{MOST_TRIANGLES, MeshMessage};
use crate::session::content::Content;

/// Poses that a search lists.
const FITS: usize = 6;

/// What a page shows of a scene.
pub struct SceneContent {
    assembly: Assembly,
    /// Surfaces of the fixed parts where they stand, in the scene's order.
    fixed: Vec<MeshMessage>,
    moving: MeshMessage,
    /// The coordinate axis across which parts are cut open: 0, 1, 2.
    cut: usize,
    geometry: Geometry,
    description: Value,
    monitor: Arc<dyn Monitor + Send>,
    /// Nobody looks any more.
    over: AtomicBool,
}

/// Shows nothing; cancels what nobody waits for any more.
struct Quiet<'a>(&'a SceneContent);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.over.load(Ordering::Relaxed) || self.0.monitor.cancelled()
    }
}

/// A scene whose loop runs.
pub struct PlayedScene<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The pair of its first fixed part.
    pub assembly: &'a Assembly,
    /// Names of its fixed parts.
    pub names: &'a [String],
    /// Energy at poses in the scene.
    pub source: &'a dyn EnergySource,
    /// Where the fit is and how one gets there.
    pub geometry: Geometry,
    /// The table whose energies these are, if any.
    pub table: Option<&'a Path>,
}

impl SceneContent {
    /// Reads what is shown of a scene. Searches end when `monitor` says so, whom nothing is shown.
    ///
    /// # Errors
    /// If a mesh of a further part, or the table, cannot be read, or a part has no interior.
    pub fn new(
        played: &PlayedScene<'_>,
        monitor: Arc<dyn Monitor + Send>,
    ) -> Result<Self, PlayError> {
        let loaded = played.assembly;
        let assembly = Assembly {
            setup: loaded.setup.clone(),
            pair: loaded.pair.clone(),
            field_seconds: loaded.field_seconds,
        };
        let fixed = assembly.setup.all_fixed(played.scene)?;
        let fixed = fixed.iter().map(message).collect();
        let moving = message(&assembly.setup.moving_at(&Pose::IDENTITY));
        let mut content = Self {
            assembly,
            fixed,
            moving,
            cut: cut_axis(&played.geometry),
            geometry: played.geometry,
            description: Value::Null,
            monitor,
            over: AtomicBool::new(false),
        };
        content.description = content.describe(played)?;
        Ok(content)
    }

    /// Ends searches that still run.
    pub fn end(&self) {
        self.over.store(true, Ordering::Relaxed);
    }

    fn describe(&self, played: &PlayedScene<'_>) -> Result<Value, PlayError> {
        let (assembly, source) = (&self.assembly, played.source);
        let geometry = played.geometry;
        let limits = &assembly.scene().device.limits;
        let grip = assembly.workspace().grip;
        let table = (played.table).or(assembly.scene().fixed.table.as_deref());
        let (source_words, error) = match table {
            Some(path) => {
                let (words, error) = of_table(path)?;
                (words, Some(error))
            }
            None => {
                let spacing = 1e3 * assembly.pair.spacing();
                let words = format!("Forces by direct sums on densities {spacing:.2} mm apart.");
                // Finer densities decide: computed when somebody asks for them.
                (words, None)
            }
        };
        Ok(json!({
            "title": assembly.scene().moving.name,
            "fixed": played.names,
            "moving": assembly.scene().moving.name,
            "seated": pegfit_scene::poses::pose_fields(&geometry.seated),
            "axis": geometry.axis.to_array(),
            "depth": geometry.depth,
            "grip": grip.to_array(),
            "cut": self.cut,
            "limits": [limits.force, limits.torque],
            "profile": profile(source, &geometry),
            "places": [
                place("Seated", "the scene's fit", &geometry.seated),
                place("At the entrance", "", &at_depth(&geometry, 0.1 * geometry.depth)),
                place("Outside", "where it began", &start_pose(&geometry, grip)),
            ],
            "source": source_words,
            "error": error,
            "coarser": self.coarser(),
        }))
    }

    /// Says which surfaces are shown coarser than they are.
    fn coarser(&self) -> Option<String> {
        let setup = &self.assembly.setup;
        let whole = [&setup.parts.fixed, &setup.parts.moving].map(|m| m.triangles().len());
        let shown = [self.fixed[0].triangles, self.moving.triangles];
        (shown != whole).then(|| {
            format!(
                "Surfaces are shown with {} and {} of their {} and {} triangles; the forces are \
                 those of all.",
                shown[0], shown[1], whole[0], whole[1]
            )
        })
    }

    /// A part and where it is: the fixed one in the scene, the moving one as poses move it.
    fn part(&self, name: &str) -> Option<(TriangleMesh, Pose)> {
        let setup = &self.assembly.setup;
        let Placement { fixed, moving } = *setup.placement();
        match name {
            "0" => Some((setup.placed_fixed(), fixed)),
            "moving" => Some((setup.moving_at(&Pose::IDENTITY), moving)),
            _ => None,
        }
    }

    /// A part's density on the plane through the middle: inside positive, outside negative.
    fn slice(&self, name: &str) -> Option<Vec<u8>> {
        let (mesh, ..) = self.part(name)?;
        let pivot = self.assembly.pivot();
        let through = match name {
            "moving" => pivot,
            _ => self.assembly.assembled().apply(pivot),
        };
        let slice = Slice {
            axis: self.cut,
            at: through[self.cut],
        };
        let bounds = mesh.bounds();
        let bounds = bounds.grown(0.2 * bounds.size().max_element());
        let sigma = self.assembly.setup.parts.model.sigma;
        let field = slice.density(&mesh, sigma, &bounds, &Quiet(self)).ok()?;
        let inside = sheet(&field.interior, &field, &slice);
        let outside = sheet(&field.exterior, &field, &slice);
        let lattice = field.lattice();
        let [across, up] = slice.plane_axes();
        let shape = lattice.shape();
        let mut bytes = Vec::new();
        for count in [shape[across], shape[up]] {
            bytes.extend(u32::try_from(count).ok()?.to_le_bytes());
        }
        let spacing = lattice.spacing();
        let side = |axis: usize| DVec3::AXES[axis] * (spacing * shape[axis] as f64);
        let corner = lattice.origin() - 0.5 * spacing * (DVec3::AXES[across] + DVec3::AXES[up]);
        for vector in [corner, side(across), side(up)] {
            bytes.extend(floats(vector.to_array()));
        }
        for row in 0..shape[up] {
            let value = |column| {
                let [i, o] = [&inside, &outside].map(|v| f64::from(v[[column, row]].norm()));
                if i > o { i } else { -o }
            };
            bytes.extend(floats((0..shape[across]).map(value)));
        }
        Some(bytes)
    }

    /// How far the forces of the loop's densities are off, in words: beside sums over every cell of
    /// the scene's own, at poses about the path in.
    fn error(&self) -> Result<String, PlayError> {
        let (assembly, setup) = (&self.assembly, &self.assembly.setup);
        let poses = poses_about_path(&self.geometry).into_iter();
        let poses: Vec<Pose> = poses.map(|p| setup.placement().to_shapes(&p)).collect();
        let forces = |source: &DirectEvaluator, indices: &[usize]| -> Vec<DVec3> {
            let mut scratch = source.scratch();
            let force = |i: &usize| source.evaluate(&poses[*i], &mut scratch).wrench.force;
            indices.iter().map(force).collect()
        };
        let all: Vec<usize> = (0..poses.len()).collect();
        let found = forces(&assembly.direct(&DirectOptions::REAL_TIME)?, &all);
        let mut expected = vec![DVec3::ZERO; poses.len()];
        for (pair, indices) in setup.pairs_at(&poses, &Quiet(self))? {
            let full = setup.direct(&pair, &DirectOptions::FULL)?;
            for (index, force) in indices.iter().zip(forces(&full, &indices)) {
                expected[*index] = force;
            }
        }
        let error = 100.0 * force_error(&found, &expected);
        Ok(format!("{error:.1} % (rms) of sums over every cell"))
    }

    /// A part's skeleton: points and their densities.
    fn skeleton(&self, name: &str) -> Option<Vec<u8>> {
        let (_, pose) = self.part(name)?;
        // The loop's is coarser, and of a large part only what is near the fit.
        let pair = self.assembly.setup.pair(&Quiet(self)).ok()?;
        let field = match name {
            "moving" => pair.moving(),
            _ => pair.fixed(),
        };
        let kernel = DensityKernel::new(self.assembly.pair.model().sigma).ok()?;
        let points = skeleton_points(field, &kernel).into_iter();
        let numbers = points.flat_map(|(point, value)| {
            let [x, y, z] = pose.apply(point).to_array();
            [x, y, z, value]
        });
        Some(floats(numbers).collect())
    }
}

impl Content for SceneContent {
    fn description(&self) -> Value {
        self.description.clone()
    }

    fn bytes(&self, name: &str) -> Option<Vec<u8>> {
        if name == "error" {
            let error = with_spare_core(|| self.error()).ok()?;
            return error.ok().map(String::into_bytes);
        }
        let (kind, part) = name.split_once('/')?;
        match (kind, part) {
            ("mesh", "moving") => Some(self.moving.bytes.clone()),
            ("mesh", number) => {
                let number: usize = number.parse().ok()?;
                self.fixed.get(number).map(|mesh| mesh.bytes.clone())
            }
            ("slice", part) => with_spare_core(|| self.slice(part)).ok()?,
            ("skeleton", part) => with_spare_core(|| self.skeleton(part)).ok()?,
            _ => None,
        }
    }

    fn dock(&self) -> Result<Value, String> {
        with_spare_core(|| self.fits()).map_err(|e| e.to_string())?
    }
}

impl SceneContent {
    /// The poses that a search finds, as places of the page.
    fn fits(&self) -> Result<Value, String> {
        let mut setup = self.assembly.setup.clone();
        // Energies on the page have one scale.
        setup.parts.energy = EnergyScale::Gamma(self.assembly.pair.model().gamma);
        let options = DockingRequest {
            top: FITS,
            ..setup.docking_options()
        };
        let found = (setup.dock(options, &Quiet(self))).map_err(|e| e.to_string())?;
        // As the loop would have it there, not the search on its own lattice.
        let poses: Vec<Pose> = found.poses.iter().map(|p| p.found.pose).collect();
        let mut energies = vec![f64::NAN; poses.len()];
        let pairs = setup.pairs_at(&poses, &Quiet(self));
        for (pair, indices) in pairs.map_err(|e| e.to_string())? {
            let source = setup.direct(&pair, &DirectOptions::REAL_TIME);
            let source = source.map_err(|e| e.to_string())?;
            let mut scratch = source.scratch();
            for index in indices {
                energies[index] = source.evaluate(&poses[index], &mut scratch).energy;
            }
        }
        let places = found.poses.iter().enumerate().map(|(index, pose)| {
            let at = setup.placement().to_scene(&pose.found.pose);
            let (shift, turn) = self.assembly.from_fit(&at);
            // Without energies there is no quality.
            let quality = match pose.quality.is_finite() {
                true => format!(", quality {:.2}", pose.quality),
                false => String::new(),
            };
            let note = format!(
                "{} joint, {:.0} nats{quality}, {} mJ, {:.1} mm and {:.0}° from the fit",
                pose.joint.kind.name(),
                pose.hold.information,
                number(1e3 * energies[index], 3),
                1e3 * shift,
                turn.to_degrees()
            );
            place(&format!("Found {}", index + 1), &note, &at)
        });
        Ok(places.collect())
    }
}

fn message(mesh: &TriangleMesh) -> MeshMessage {
    MeshMessage::from_mesh(mesh, MOST_TRIANGLES)
}

fn floats(values: impl IntoIterator<Item = f64>) -> impl Iterator<Item = u8> {
    values.into_iter().flat_map(|v| (v as f32).to_le_bytes())
}

fn place(title: &str, note: &str, pose: &Pose) -> Value {
    json!({ "title": title, "note": note, "pose": pegfit_scene::poses::pose_fields(pose) })
}

/// Where energies come from, and how far they are off: of a table, what it states.
fn of_table(path: &Path) -> Result<(String, String), PlayError> {
    let store = TableStore::open(path).map_err(pegfit_scene::SceneError::from)?;
    let error = match store.error_report() {
        Some(report) => {
            let share = |e: &fft_correlate::table::Errors| 100.0 * e.rms / e.scale;
            format!(
                "It states {:.1} % error of forces and {:.1} % of torques (rms).",
                share(&report.force),
                share(&report.torque)
            )
        }
        None => "It states no error.".to_owned(),
    };
    Ok((format!("Forces from the table {}.", path.display()), error))
}

/// Points of the curve of the energy on the straight path in.
const POINTS: u32 = 120;

/// Share of the depth from which, and to which, the curve goes.
const SPAN: (f64, f64) = (-0.6, 1.08);

/// Poses at which forces are compared.
const POSES: usize = 24;

/// The assembled pose withdrawn so that it is `depth` metres in.
fn at_depth(geometry: &Geometry, depth: f64) -> Pose {
    Pose {
        translation: geometry.seated.translation + geometry.axis * (depth - geometry.depth),
        ..geometry.seated
    }
}

/// Where the hand begins: before the entrance, beside the axis, tilted a little; `grip` is the point
/// of the part about which it is turned.
pub fn start_pose(geometry: &Geometry, grip: DVec3) -> Pose {
    let before = at_depth(geometry, -0.4 * geometry.depth);
    let side = geometry.axis.any_orthonormal_vector();
    let turn = DQuat::from_axis_angle(side.cross(geometry.axis), geometry.tilt);
    let rotation = (turn * before.rotation).normalize();
    let held = before.apply(grip) + side * (1.5 * geometry.radius);
    Pose {
        rotation,
        translation: held - rotation * grip,
    }
}

/// The coordinate axis across which a cut shows the path in, seen from where the hand begins.
fn cut_axis(geometry: &Geometry) -> usize {
    let across = geometry.axis.cross(geometry.axis.any_orthonormal_vector());
    across.abs().max_position()
}

/// Energy (J) against depth (m) on the straight path in.
fn profile(source: &dyn EnergySource, geometry: &Geometry) -> Vec<[f64; 2]> {
    let mut scratch = source.scratch();
    let share = |k| SPAN.0 + (SPAN.1 - SPAN.0) * f64::from(k) / f64::from(POINTS);
    (0..=POINTS)
        .map(|k| geometry.depth * share(k))
        .map(|depth| {
            let pose = at_depth(geometry, depth);
            [depth, source.evaluate(&pose, &mut scratch).energy]
        })
        .collect()
}

/// Poses about the path in, at which forces are compared.
fn poses_about_path(geometry: &Geometry) -> Vec<Pose> {
    let mut rng = SmallRng::seed_from_u64(7);
    let about = |_| {
        let mut pose = at_depth(geometry, geometry.depth * rng.random_range(0.0..1.0));
        let mut any =
            |most: f64| DVec3::from_array([(); 3].map(|()| rng.random_range(-1.0..1.0) * most));
        pose.translation += any(0.3 * geometry.radius);
        pose.rotation =
            (DQuat::from_scaled_axis(any(0.5 * geometry.tilt)) * pose.rotation).normalize();
        pose
    };
    (0..POSES).map(about).collect()
}

/// Root mean square difference of forces, as a share of that of the `expected` ones.
fn force_error(found: &[DVec3], expected: &[DVec3]) -> f64 {
    let off = found
        .iter()
        .zip(expected)
        .map(|(f, e)| (*f - *e).length_squared());
    let scale: f64 = expected.iter().map(|e| e.length_squared()).sum();
    (off.sum::<f64>() / scale.max(f64::MIN_POSITIVE)).sqrt()
}
