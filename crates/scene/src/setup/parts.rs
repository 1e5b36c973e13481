//! The solids of a scene: read, cleaned, joined, each part in its own frame; and warnings about them.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::PathBuf;

use fft_correlate::Pose;
use sdf_grid::{LengthUnit, MeshError, RepairOptions, RepairReport, TriangleMesh, mesh_io};

use crate::scene::{Part, Scene};

/// Parts whose diagonals differ by more than this, one of them outside the usual sizes (metres), are
/// probably in different units: a screw in a chassis is not, a screw of 13 metres is.
const SUSPICIOUS_RATIO: f64 = 30.0;
const USUAL_SIZES: RangeInclusive<f64> = 5e-4..=5.0;

/// Reads and cleans the meshes of a part, in its own frame; several become one.
pub(crate) fn read_part(
    scene: &Scene,
    part: &Part,
    warnings: &mut Vec<SceneWarning>,
) -> Result<TriangleMesh, MeshError> {
    let mut warn = |report: RepairReport| {
        warnings.extend(report.warnings().into_iter().map(SceneWarning::Mesh));
    };
    let mut meshes = Vec::new();
    for placed in &part.meshes {
        let (mesh, report) = mesh_io::read_with(&placed.path, &placed.options(scene.unit))?;
        warn(report);
        meshes.push(moved(mesh, &placed.pose));
    }
    let (mesh, report) = joined(&part.name, meshes)?;
    report.into_iter().for_each(warn);
    Ok(mesh)
}

fn moved(mesh: TriangleMesh, pose: &Pose) -> TriangleMesh {
    match *pose == Pose::IDENTITY {
        true => mesh,
        false => mesh.transformed(pose.rotation, pose.translation),
    }
}

/// All meshes as one, and what was mended if there are several. Walls between solids that touch
/// disappear.
pub(crate) fn joined(
    name: &str,
    mut meshes: Vec<TriangleMesh>,
) -> Result<(TriangleMesh, Option<RepairReport>), MeshError> {
    if meshes.len() == 1 {
        return Ok((meshes.remove(0), None));
    }
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for mesh in &meshes {
        // Each mesh was small enough for 32-bit indices; together they are checked when cleaned.
        let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        vertices.extend_from_slice(mesh.vertices());
        let shifted = |t: &[u32; 3]| t.map(|v| v.saturating_add(first));
        triangles.extend(mesh.triangles().iter().map(shifted));
    }
    let (mesh, report) = TriangleMesh::clean(name, vertices, triangles, &RepairOptions::default())?;
    Ok((mesh, Some(report)))
}

/// A fixed part and the moving one where the scene says that they fit.
///
/// See the example of [`FitVerdict`](crate::FitVerdict).
#[derive(Debug, Clone)]
pub struct FitSolids {
    /// The fixed part's name.
    pub name: String,
    /// Where the scene puts it, metres.
    pub fixed: TriangleMesh,
    /// The moving part at the fit, metres.
    pub moving: TriangleMesh,
    /// Whether they seem to be in different units.
    pub scale: Option<SceneWarning>,
}

impl Scene {
    /// Reads every fixed part and the moving one, and puts them where they fit; no field is computed.
    ///
    /// # Errors
    /// If a mesh cannot be read or used.
    pub fn fit_solids(&self) -> Result<Vec<FitSolids>, MeshError> {
        let own = read_part(self, &self.moving, &mut Vec::new())?;
        let moving = moved(own.clone(), &(self.fit.assembled * self.moving.pose));
        let each = |part: &Part| {
            let mesh = read_part(self, part, &mut Vec::new())?;
            let scale = scale_of(self, part, &mesh, &own);
            Ok(FitSolids {
                name: part.name.clone(),
                fixed: moved(mesh, &part.pose),
                moving: moving.clone(),
                scale,
            })
        };
        self.fixed_parts().map(each).collect()
    }
}

/// Whether the parts differ in size as if they were in different units.
pub(super) fn compare_scale(
    scene: &Scene,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
) -> Option<SceneWarning> {
    scale_of(scene, &scene.fixed, fixed, moving)
}

fn scale_of(
    scene: &Scene,
    part: &Part,
    fixed: &TriangleMesh,
    moving: &TriangleMesh,
) -> Option<SceneWarning> {
    let (a, b) = (fixed.bounds().diagonal(), moving.bounds().diagonal());
    let unusual = ![a, b].iter().all(|d| USUAL_SIZES.contains(d));
    (unusual && a.max(b) / a.min(b) > SUSPICIOUS_RATIO).then(|| SceneWarning::Scale {
        fixed: part.name.clone(),
        fixed_diagonal: a,
        moving: scene.moving.name.clone(),
        moving_diagonal: b,
        unit: scene.unit,
    })
}

/// A warning about a scene that can be used all the same.
///
/// ```
/// use glam::DVec3;
/// use pegfit_scene::{Scene, SceneSetup, SceneWarning};
/// use sdf_grid::shapes::{PegInHole, cuboid};
///
/// let text = "unit = \"mm\"\nfixed = \"hole.obj\"\nmoving = \"peg.obj\"";
/// let scene = Scene::parse("scene.toml", text)?;
/// // A peg that was exported in millimetres and read in metres.
/// let (hole, _) = PegInHole::Rectangular.pair(0.0)?;
/// let peg = cuboid(DVec3::new(20.0, 20.0, 30.0))?;
/// let setup = SceneSetup::from_solids(scene, hole, peg, 1 << 30)?;
/// assert!(matches!(setup.warnings[0], SceneWarning::Scale { .. }));
/// assert!(setup.warnings[0].to_string().ends_with("are both in mm?"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub enum SceneWarning {
    /// What had to be repaired in a mesh, in words.
    Mesh(String),
    /// The parts differ in size as if they were in different units.
    Scale {
        /// The fixed part's name.
        fixed: String,
        /// Its diagonal, metres.
        fixed_diagonal: f64,
        /// The moving part's name.
        moving: String,
        /// Its diagonal, metres.
        moving_diagonal: f64,
        /// The scene's unit.
        unit: LengthUnit,
    },
    /// Fields are not kept, and computed again by each run; why, in words.
    NoCache(String),
    /// The table was baked with another energy scale than the scene's; the table's counts.
    EnergyScale {
        /// The table.
        table: PathBuf,
    },
}

impl fmt::Display for SceneWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Mesh(said) => f.write_str(said),
            Self::NoCache(said) => write!(f, "{said}; fields are computed again by each run"),
            Self::Scale {
                fixed,
                fixed_diagonal,
                moving,
                moving_diagonal,
                unit,
            } => {
                let metre = unit.in_metres();
                write!(
                    f,
                    "{fixed} is {:.4} {unit} across and {moving} is {:.4} {unit}: are both in \
                     {unit}?",
                    fixed_diagonal / metre,
                    moving_diagonal / metre
                )
            }
            Self::EnergyScale { table } => write!(
                f,
                "{} was baked with another energy scale than the scene's; the table's counts",
                table.display()
            ),
        }
    }
}
