//! The solids of a file, each with its place.

use std::path::{Path, PathBuf};
use std::time::Duration;

use fft_correlate::Pose;
use sdf_grid::mesh_io::{MeshFile, ReadOptions, StepOptions};
use sdf_grid::text::quoted;
use sdf_grid::{Ledger, LengthUnit, TriangleMesh};

use crate::solids::element::Element;
use crate::solids::error::ImportError;
use crate::solids::geometry::Shape;
use crate::solids::mjcf::geom::MujocoOptions;
use crate::solids::{mjcf, urdf};

/// Metres; scenes of solids below are in millimetres.
const SMALL: f64 = 1.0;

/// How a file of solids is read.
///
/// ```
/// use std::time::Duration;
///
/// use pegfit_scene::{MujocoOptions, SolidOptions, SolidSet};
/// use sdf_grid::{LengthUnit, mesh_io, shapes};
///
/// # let folder = tempfile::tempdir()?;
/// let file = folder.path().join("plate.obj");
/// mesh_io::write_obj_in(&file, &shapes::plate(0.02, 0.005)?, LengthUnit::Cm)?;
/// let mujoco = MujocoOptions { time_limit: Duration::from_secs(10), ..MujocoOptions::default() };
/// let options = SolidOptions { unit: LengthUnit::Cm, mujoco, ..SolidOptions::default() };
/// // OBJ states no unit: these are centimetres, and metres from here on.
/// let set = SolidSet::read(&file, &options)?;
/// assert!((set.solids[0].mesh.bounds().size().x - 0.02).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct SolidOptions {
    /// Unit of the coordinates, for mesh formats that state none.
    pub unit: LengthUnit,
    /// Edges around a full turn of a curved face of a STEP file.
    pub segments_per_turn: u32,
    /// Processor time after which a converter of a STEP file is stopped.
    pub step_time_limit: Duration,
    /// Leave out what changes a solid of a mesh file and cannot be read, instead of refusing it.
    pub lossy: bool,
    /// Of robots' descriptions, the shapes to look at instead of those to collide with, where a link or
    /// body has both.
    pub visual: bool,
    /// How MuJoCo compiles MJCF.
    pub mujoco: MujocoOptions,
}

impl Default for SolidOptions {
    /// Millimetres, 64 edges around a full turn, shapes to collide with, MuJoCo from the PATH.
    fn default() -> Self {
        Self {
            unit: LengthUnit::Mm,
            segments_per_turn: 64,
            step_time_limit: StepOptions::default().time_limit,
            lossy: false,
            visual: false,
            mujoco: MujocoOptions::default(),
        }
    }
}

/// The solids of a file: those of a mesh file or a STEP assembly, or the links or bodies of a URDF
/// or MJCF file with joints at zero.
///
/// ```
/// use fft_correlate::Pose;
/// use pegfit_scene::SolidSet;
/// use sdf_grid::{LengthUnit, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let parts = [("hole", hole), ("peg", peg)];
/// let parts = parts.map(|(name, mesh)| (name.to_string(), mesh, Pose::IDENTITY));
/// let set = SolidSet::assembled("assembly.step", parts, LengthUnit::Mm);
/// assert_eq!(set.groups(), [(0, "hole"), (1, "peg")]);
/// // A scene in which the peg moves; the hole is in reach and stays.
/// let draft = set.draft(&["peg".into()], &[], false)?;
/// assert_eq!((&draft.moving[..], &draft.fixed[..]), (&[1][..], &[0][..]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct SolidSet {
    /// The file.
    pub path: PathBuf,
    /// Its solids, in its order.
    pub solids: Vec<PlacedSolid>,
    /// What was read of the file, what was ignored and what was assumed.
    pub ledger: Ledger,
    /// Unit for the scene's lengths.
    pub(super) unit: LengthUnit,
}

/// A solid of a file.
///
/// See the example of [`SolidSet`].
#[derive(Debug, Clone)]
pub struct PlacedSolid {
    /// Its name, that of its link or body, or empty.
    pub name: String,
    /// Solids of one number are one thing: shapes of one link or body.
    pub group: usize,
    /// Where it lies, metres.
    pub pose: Pose,
    /// Its surface in its own frame, metres.
    pub mesh: TriangleMesh,
    /// The solid by its name or number in the file, if a scene can read it from there.
    pub(super) in_file: Option<InFile>,
}

/// How a scene names a solid of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum InFile {
    /// All there is.
    Whole,
    /// Of a name that no other has.
    Named,
    /// From 1.
    Number(usize),
}

impl PlacedSolid {
    /// Its surface where it lies, metres.
    pub fn placed(&self) -> TriangleMesh {
        match self.pose == Pose::IDENTITY {
            true => self.mesh.clone(),
            false => (self.mesh).transformed(self.pose.rotation, self.pose.translation),
        }
    }
}

impl SolidSet {
    /// Reads every solid of a mesh file (`.obj`, `.stl`, `.ply`, `.glb`, `.gltf`, `.3mf`, `.step`), every
    /// link of a `.urdf` or every body of an MJCF `.xml` or `.mjcf` file. Joints are left out: links and
    /// bodies are where they are with joints at zero.
    ///
    /// # Errors
    /// If the file, or a mesh that it names, cannot be read or used, or has something that may change a
    /// solid and is not read.
    pub fn read(path: impl AsRef<Path>, options: &SolidOptions) -> Result<Self, ImportError> {
        let path = path.as_ref();
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let mut ledger = Ledger::default();
        let shapes = match ending.as_deref() {
            Some("urdf" | "xacro" | "xml" | "mjcf") => described(path, options, &mut ledger)?,
            _ => return Self::of_mesh_file(path, options),
        };
        let mut solids = Vec::new();
        for shape in shapes {
            solids.push(PlacedSolid {
                mesh: shape.geometry.mesh(&mut ledger)?,
                name: shape.name,
                group: shape.group,
                pose: shape.pose,
                in_file: None,
            });
        }
        Ok(Self {
            path: path.to_owned(),
            solids,
            ledger,
            unit: LengthUnit::M,
        })
    }

    /// Parts that were put together: name, surface in its own frame, and place of each. `source` is
    /// what they were made of, `unit` that of the scene's lengths.
    pub fn assembled(
        source: impl Into<PathBuf>,
        parts: impl IntoIterator<Item = (String, TriangleMesh, Pose)>,
        unit: LengthUnit,
    ) -> Self {
        let solid = |(group, (name, mesh, pose))| PlacedSolid {
            name,
            group,
            pose,
            mesh,
            in_file: None,
        };
        Self {
            path: source.into(),
            solids: parts.into_iter().enumerate().map(solid).collect(),
            ledger: Ledger::default(),
            unit,
        }
    }

    fn of_mesh_file(path: &Path, options: &SolidOptions) -> Result<Self, ImportError> {
        let whole = ReadOptions::choosing(options.unit, None, options.segments_per_turn)
            .within(options.step_time_limit, options.lossy);
        let file = MeshFile::open(path, &whole.step)?;
        let listed = file.solids();
        let converted = file.is_converted();
        // A scene reads a file anew only if it gets the same solids.
        let read_anew = !converted && !options.lossy;
        let mut solids = Vec::new();
        for (i, solid) in listed.iter().enumerate() {
            let number = (i + 1).to_string();
            let unique = listed.iter().filter(|s| s.name == solid.name).count() == 1;
            // Chosen as a scene would: by its name if there is only one of it.
            let by_name = unique && !solid.name.is_empty();
            let chosen = if by_name { solid.name.clone() } else { number };
            let options = ReadOptions {
                solid: Some(chosen),
                ..whole.clone()
            };
            let in_file = if by_name {
                InFile::Named
            } else {
                InFile::Number(i + 1)
            };
            solids.push(PlacedSolid {
                name: solid.name.clone(),
                group: i,
                pose: Pose::IDENTITY,
                mesh: file.clean(&options)?.0,
                in_file: read_anew.then_some(in_file),
            });
        }
        let stated = file.stated_unit().unwrap_or(options.unit);
        if solids.is_empty() {
            let stem = path.file_stem().unwrap_or_default();
            solids.push(PlacedSolid {
                name: stem.to_string_lossy().into_owned(),
                group: 0,
                pose: Pose::IDENTITY,
                mesh: file.clean(&whole)?.0,
                in_file: read_anew.then_some(InFile::Whole),
            });
        }
        let longest = |s: &PlacedSolid| s.mesh.bounds().size().max_element();
        // Nothing of a converted file is in the scene but meshes of our own.
        let small = converted && solids.iter().map(longest).fold(0.0, f64::max) < SMALL;
        Ok(Self {
            path: path.to_owned(),
            solids,
            ledger: file.ledger(&whole),
            unit: if small { LengthUnit::Mm } else { stated },
        })
    }

    /// Unit for the lengths of a scene of these solids.
    pub fn unit(&self) -> LengthUnit {
        self.unit
    }

    /// Indices (from 0) and names of what can be chosen, one for each group.
    pub fn groups(&self) -> Vec<(usize, &str)> {
        let mut groups: Vec<(usize, &str)> = Vec::new();
        for solid in &self.solids {
            if groups.last().is_none_or(|(g, _)| *g != solid.group) {
                groups.push((solid.group, &solid.name));
            }
        }
        groups
    }

    /// Indices of the solids of the one group that is called `wanted`, else of that number from 1 in
    /// [`SolidSet::groups`]. `option` stands in errors.
    pub(super) fn chosen(
        &self,
        option: &'static str,
        wanted: &str,
    ) -> Result<Vec<usize>, ImportError> {
        let groups = self.groups();
        let named: Vec<usize> = groups
            .iter()
            .filter(|g| g.1 == wanted)
            .map(|g| g.0)
            .collect();
        let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
        let group = match named[..] {
            [only] => Some(only),
            [] => number().and_then(|n| groups.get(n)).map(|g| g.0),
            _ => None,
        };
        let Some(group) = group else {
            let listed = groups.iter().take(20).enumerate();
            let names: Vec<String> = listed
                .map(|(i, g)| format!("{} {}", i + 1, quoted(g.1)))
                .collect();
            return Err(ImportError::Solid {
                path: self.path.clone(),
                option,
                wanted: wanted.to_owned(),
                known: names.join(", "),
            });
        };
        let indices = 0..self.solids.len();
        Ok(indices.filter(|&i| self.solids[i].group == group).collect())
    }
}

/// The shapes of a robot's description.
fn described(
    path: &Path,
    options: &SolidOptions,
    ledger: &mut Ledger,
) -> Result<Vec<Shape>, ImportError> {
    let root = Element::read(path)?;
    let visual = options.visual;
    let shapes = match root.name.as_str() {
        "robot" => urdf::shapes(path, &root, visual, ledger)?,
        "mujoco" => mjcf::shapes(path, &root, visual, &options.mujoco, ledger)?,
        other => {
            let expected = "<robot> (URDF) or <mujoco> (MJCF)";
            return Err(root.wrong(path, expected, format!("<{other}>")));
        }
    };
    match shapes.is_empty() {
        true => Err(root.wrong(path, "a link or body with a shape", "none")),
        false => Ok(shapes),
    }
}
