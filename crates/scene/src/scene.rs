//! A scene whose every value has been checked.

use std::path::PathBuf;
use std::time::Duration;

use fft_correlate::{EnergyScale, LatticeStep, Placement, Pose, RotationDomain, ScoreModel};
use glam::DVec3;
use haptic::HapticConfig;
use sdf_grid::LengthUnit;
use sdf_grid::mesh_io::ReadOptions;

use crate::error::SceneError;

/// A scene whose every value has been checked. Lengths are metres.
///
/// ```
/// use fft_correlate::{LatticeStep, Pose};
/// use pegfit_scene::Scene;
///
/// let text = r#"
///     unit = "mm"
///     fixed = "hole.stl"
///     moving = "peg.stl"
///     lattice.spacing = 0.5
///     window.half_extent = [10, 10, 15]
/// "#;
/// let scene = Scene::parse("scenes/peg.toml", text)?;
/// // Lengths are metres; meshes are looked for beside the scene.
/// assert_eq!(scene.window.half_extent.expect("given").z, 0.015);
/// assert!(scene.fixed.meshes[0].path.ends_with("scenes/hole.stl"));
/// assert_eq!(scene.lattice.step, LatticeStep::Spacing(0.0005));
/// // Unless a scene says otherwise, parts fit where they were modelled, and the program itself
/// // decides how much memory it uses.
/// assert_eq!((scene.fit.assembled, scene.loading.memory), (Pose::IDENTITY, None));
/// let error = Scene::parse("scenes/peg.toml", "unit = \"mm\"").unwrap_err();
/// assert!(error.to_string().contains("scenes/peg.toml"));
/// # Ok::<(), pegfit_scene::SceneError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Scene {
    /// The file it was read from.
    pub path: PathBuf,
    /// Unit of the meshes and of the lengths in the file.
    pub unit: LengthUnit,
    /// The part that stays: the first of them, into which the moving part fits.
    pub fixed: Part,
    /// Further parts that stay.
    pub others: Vec<Part>,
    /// The part that moves.
    pub moving: Part,
    /// Weights and kernel thickness; gamma is 1 unless the scene gives one.
    pub model: ScoreModel,
    /// What fixes the energy scale.
    pub energy: EnergyScale,
    /// How finely the densities are computed.
    pub lattice: LatticeChoice,
    /// Which translations are searched and tabulated.
    pub window: WindowChoice,
    /// Which rotations are searched and tabulated.
    pub rotations: RotationDomain,
    /// True if the scene itself names them; `dock` searches everywhere otherwise.
    pub rotations_given: bool,
    /// Where the parts fit.
    pub fit: FitChoice,
    /// Settings of the haptic loop.
    pub device: HapticConfig,
    /// What is kept in memory while the loop runs.
    pub loading: Loading,
    /// Folder where fields are kept between runs.
    pub cache: PathBuf,
}

/// One part of a scene: a mesh, or several that move or stay together.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// What to call it in reports.
    pub name: String,
    /// Its mesh files and where each lies in the part.
    pub meshes: Vec<PlacedMesh>,
    /// Where the scene puts it (metres).
    pub pose: Pose,
    /// A table of the pair with the moving part, to be interpolated by the haptic loop.
    pub table: Option<PathBuf>,
}

/// A mesh file of a part.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedMesh {
    /// The file.
    pub path: PathBuf,
    /// The solid of the file to use, by name or number; all of them if `None`.
    pub solid: Option<String>,
    /// Edges around a full turn of a curved face of a STEP file.
    pub segments_per_turn: u32,
    /// Processor time after which a converter of a STEP file is stopped.
    pub step_time_limit: Duration,
    /// Leave out what changes a solid and cannot be read, instead of refusing it.
    pub lossy: bool,
    /// Where it lies in the part (metres); the identity if it is the only one.
    pub pose: Pose,
}

impl PlacedMesh {
    /// How its file is read; `unit` is that of files that state none.
    pub fn options(&self, unit: LengthUnit) -> ReadOptions {
        ReadOptions::choosing(unit, self.solid.clone(), self.segments_per_turn)
            .within(self.step_time_limit, self.lossy)
    }
}

/// Which pairs are kept in memory while the loop runs.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loading {
    /// Bytes that loaded pairs may take together; what the program may use if absent.
    pub memory: Option<u64>,
    /// How far ahead of the moving part pairs are loaded, metres; its longest side if absent.
    pub ahead: Option<f64>,
    /// How far, radians, the part may turn to rotations of a table that are loaded before the loop
    /// starts.
    pub turn_ahead: f64,
    /// Time between two looks at the files.
    pub watch: Duration,
}

/// How finely the densities are computed.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LatticeChoice {
    /// The lattice step.
    pub step: LatticeStep,
    /// Distance outside the parts at which densities end, metres; chosen from the parts if absent.
    pub halo: Option<f64>,
    /// Relative L2 error allowed in a field.
    pub field_tolerance: f64,
}

/// A box of displacements of the moving part.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowChoice {
    /// Middle of the box, metres.
    pub center: DVec3,
    /// Half its sides, metres; chosen from the parts if absent.
    pub half_extent: Option<DVec3>,
}

/// Where the parts fit, and the straight insertion path.
///
/// See the example of [`Scene`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitChoice {
    /// Pose of the moving part when assembled.
    pub assembled: Pose,
    /// Unit direction, fixed frame, in which the moving part travels to seat; found by probing if
    /// absent.
    pub axis: Option<DVec3>,
    /// Travel from the entrance to the seat, metres; the moving part's extent if absent.
    pub depth: Option<f64>,
}

impl Scene {
    /// Where the first fixed part and the moving one are put.
    pub fn placement(&self) -> Placement {
        Placement {
            fixed: self.fixed.pose,
            moving: self.moving.pose,
        }
    }

    /// All parts that stay.
    pub fn fixed_parts(&self) -> impl Iterator<Item = &Part> {
        std::iter::once(&self.fixed).chain(&self.others)
    }

    /// The scene with only one of its fixed parts: the one called `name`, or the only one.
    ///
    /// # Errors
    /// If there is no such part, or several and no name.
    pub fn only(mut self, name: Option<&str>) -> Result<Self, SceneError> {
        let chosen = match name {
            None if self.others.is_empty() => return Ok(self),
            None => None,
            Some(name) => self.fixed_parts().find(|p| p.name == name).cloned(),
        };
        let Some(fixed) = chosen else {
            let names: Vec<&str> = self.fixed_parts().map(|p| p.name.as_str()).collect();
            return Err(SceneError::FixedPart {
                wanted: name.map(str::to_owned),
                found: names.join(", "),
                path: self.path,
            });
        };
        self.fixed = fixed;
        self.others.clear();
        Ok(self)
    }
}
