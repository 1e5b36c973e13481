//! Files of solids, of whatever format.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::content::MeshFormat;
use super::ledger::{Ledger, LedgerKind};
use super::soup::{Solid, Soup};
use super::step::{self, StepOptions};
use super::unit::LengthUnit;
use super::{content, gltf, obj, ply, stl, threemf};
use crate::frame::symmetry;
use crate::frame::symmetry::SymmetryAxis;
use crate::mesh::error::MeshError;
use crate::mesh::repair::report::{RepairOptions, RepairReport};
use crate::mesh::triangle_mesh::TriangleMesh;

/// The file name endings that are read.
pub const FORMATS: &str = ".obj, .stl, .ply, .glb, .gltf, .3mf, .step or .stp";

/// Those of files that no converter reads.
const FORMATS_IN_BYTES: &str = ".obj, .stl, .ply, .glb, .gltf or .3mf";

/// The format that a file's name promises; `None` for STEP, which a converter reads.
fn format_of(path: &Path) -> Result<Option<MeshFormat>, MeshError> {
    let ending = path
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    Ok(Some(match ending.as_str() {
        "obj" => MeshFormat::Obj,
        "stl" => MeshFormat::Stl,
        "ply" => MeshFormat::Ply,
        "glb" | "gltf" => MeshFormat::Gltf,
        "3mf" => MeshFormat::ThreeMf,
        "step" | "stp" => return Ok(None),
        _ => {
            return Err(MeshError::Format {
                path: path.to_owned(),
                expected: FORMATS,
                found: ending,
            });
        }
    }))
}

/// How a mesh file is read.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadOptions {
    /// Unit of the coordinates, for formats that do not state one (OBJ, STL, PLY).
    pub unit: LengthUnit,
    /// The solid to use, by its name or its number from 1 as [`MeshFile::solids`] lists them; all
    /// of them if `None`.
    pub solid: Option<String>,
    /// Leaves out items that change a solid and cannot be read (a slicer's negative part, a beam
    /// lattice, free-form surfaces) instead of refusing the file; the ledger lists them.
    pub lossy: bool,
    /// Options of the repair of the mesh.
    pub repair: RepairOptions,
    /// How STEP files become triangles.
    pub step: StepOptions,
}

impl ReadOptions {
    /// Options for one solid of a file, or all of them, with `segments_per_turn` edges around a full
    /// turn of curved faces in STEP files.
    pub fn choosing(unit: LengthUnit, solid: Option<String>, segments_per_turn: u32) -> Self {
        Self {
            unit,
            solid,
            step: StepOptions {
                segments_per_turn,
                ..StepOptions::default()
            },
            ..Self::default()
        }
    }

    /// The same, with a limit to the processor time of a converter of STEP files, and leaving out
    /// what changes a solid and cannot be read if that is `lossy`.
    #[must_use]
    pub fn within(mut self, step_time_limit: Duration, lossy: bool) -> Self {
        self.step.time_limit = step_time_limit;
        self.lossy = lossy;
        self
    }
}

/// A mesh file's content before repair.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    name: String,
    soup: Soup,
    /// The program that made the triangles, if the file holds none.
    converter: Option<PathBuf>,
}

impl MeshFile {
    /// Reads a file; the format follows from the name's ending.
    ///
    /// # Errors
    /// If the file cannot be read, has an unknown ending or does not follow its format, or if the
    /// converter of a STEP file is missing, fails or passes a limit.
    pub fn open(path: impl AsRef<Path>, step: &StepOptions) -> Result<Self, MeshError> {
        let path = path.as_ref();
        match format_of(path)? {
            Some(format) => {
                let bytes = content::read_whole(path)?;
                Self::parse(&path.display().to_string(), &bytes, format, path.parent())
            }
            None => Self::convert(path, step),
        }
    }

    /// Reads the bytes of a file called `name`, which is nowhere else: the format follows from the
    /// name's ending.
    ///
    /// # Errors
    /// If the name has an unknown ending, the bytes do not follow the format, or are those of a STEP
    /// file, which a converter reads from a disk.
    pub fn from_bytes(name: &str, bytes: &[u8]) -> Result<Self, MeshError> {
        match format_of(Path::new(name))? {
            Some(format) => Self::parse(name, bytes, format, None),
            None => {
                content::check_step(name, &bytes[..bytes.len().min(content::PEEK)])?;
                Err(MeshError::Format {
                    path: name.into(),
                    expected: FORMATS_IN_BYTES,
                    found: "step".to_owned(),
                })
            }
        }
    }

    fn convert(path: &Path, options: &StepOptions) -> Result<Self, MeshError> {
        let name = path.display().to_string();
        content::check_step(&name, &content::read_start(path, content::PEEK)?)?;
        let (converter, soup) = step::convert_file(&name, path, options)?;
        Ok(Self {
            name,
            soup,
            converter: Some(converter),
        })
    }

    /// Reads a file's bytes. `name` (the file) appears in every error; `folder` is where a glTF
    /// file's buffers may lie, if they are files of their own.
    ///
    /// # Errors
    /// If the bytes do not follow the format.
    pub fn parse(
        name: &str,
        bytes: &[u8],
        format: MeshFormat,
        folder: Option<&Path>,
    ) -> Result<Self, MeshError> {
        let mut ledger = Ledger::default();
        let bytes = &*content::prepare(name, bytes, format.into(), &mut ledger)?;
        let mut soup = match format {
            MeshFormat::Obj => obj::parse(name, bytes),
            MeshFormat::Stl => stl::parse(name, bytes),
            MeshFormat::Ply => ply::parse(name, bytes),
            MeshFormat::Gltf => gltf::parse(name, bytes, folder),
            MeshFormat::ThreeMf => threemf::parse(name, bytes),
        }?;
        soup.ledger.extend(&ledger);
        Ok(Self {
            name: name.to_owned(),
            soup,
            converter: None,
        })
    }

    /// The solids in the file, in its order; empty if the format knows none (PLY) or the file
    /// names none (OBJ).
    pub fn solids(&self) -> Vec<Solid> {
        self.soup.solids()
    }

    /// The unit that the file itself states.
    pub fn stated_unit(&self) -> Option<LengthUnit> {
        self.soup.unit
    }

    /// Whether a converter made its triangles, as of STEP files.
    pub fn is_converted(&self) -> bool {
        self.converter.is_some()
    }

    /// What was read of the file, what was ignored and what was assumed, if it is read with
    /// `options`.
    pub fn ledger(&self, options: &ReadOptions) -> Ledger {
        let mut ledger = self.soup.ledger.clone();
        if self.soup.unit.is_none() {
            let reason = format!("{}, as the file states none", options.unit);
            ledger.add(LedgerKind::Assumed, "unit", &reason);
        }
        ledger
    }

    /// Repairs it and reports its content, faults and symmetries, with the repaired mesh.
    ///
    /// # Errors
    /// As [`MeshFile::clean`].
    pub fn examine(&self, options: &ReadOptions) -> Result<(Examination, TriangleMesh), MeshError> {
        let (mesh, report) = self.clean(options)?;
        let tolerance = SYMMETRY_TOLERANCE * mesh.bounds().diagonal();
        let examination = Examination {
            report,
            solids: self.solids(),
            stated_unit: self.stated_unit(),
            ledger: self.ledger(options),
            symmetry: symmetry::detect(&mesh, tolerance),
        };
        Ok((examination, mesh))
    }

    /// Cleans all solids, or those that `options` choose, as one mesh in metres.
    ///
    /// # Errors
    /// If there is no such solid, the file has something of it that cannot be read and `options` do
    /// not allow that, [`TriangleMesh::clean`] refuses the mesh, or what a converter made of a STEP
    /// file is not watertight.
    pub fn clean(&self, options: &ReadOptions) -> Result<(TriangleMesh, RepairReport), MeshError> {
        let Self { name, soup, .. } = self;
        let wanted = options.solid.as_deref();
        let (mut vertices, triangles) = soup.select(name, wanted, options.lossy)?;
        let scale = soup.unit.unwrap_or(options.unit).in_metres();
        for vertex in &mut vertices {
            *vertex *= scale;
        }
        let (mesh, report) = TriangleMesh::clean(name, vertices, triangles, &options.repair)?;
        match &self.converter {
            Some(converter) if !report.watertight => Err(MeshError::Converter {
                path: PathBuf::from(name),
                converter: converter.clone(),
                expected: "closed solids".to_owned(),
                found: format!("{} open edges", report.open_edges),
            }),
            _ => Ok((mesh, report)),
        }
    }
}

/// Reads a mesh file whose coordinates are in `unit`, unless the file states its own, and cleans
/// it; the mesh is in metres. All solids in the file become one mesh.
///
/// # Errors
/// As [`MeshFile::open`] and [`MeshFile::clean`].
pub fn read(
    path: impl AsRef<Path>,
    unit: LengthUnit,
    options: &RepairOptions,
) -> Result<(TriangleMesh, RepairReport), MeshError> {
    let options = ReadOptions {
        unit,
        repair: *options,
        ..ReadOptions::default()
    };
    read_with(path, &options)
}

/// Reads a mesh file and cleans it, as [`read`] does, with every option.
///
/// # Errors
/// As [`MeshFile::open`] and [`MeshFile::clean`].
pub fn read_with(
    path: impl AsRef<Path>,
    options: &ReadOptions,
) -> Result<(TriangleMesh, RepairReport), MeshError> {
    MeshFile::open(path, &options.step)?.clean(options)
}

/// Deviation from symmetry that counts as none, as a fraction of the diagonal: above the facets of
/// a fine tessellation, below what matters for a fit.
const SYMMETRY_TOLERANCE: f64 = 5e-4;

/// The result of examining a mesh file.
#[derive(Debug, Clone, PartialEq)]
pub struct Examination {
    /// The report of its repair.
    pub report: RepairReport,
    /// The solids in the file, in its order.
    pub solids: Vec<Solid>,
    /// The unit that the file itself states.
    pub stated_unit: Option<LengthUnit>,
    /// Items of the file that were read, ignored and assumed.
    pub ledger: Ledger,
    /// Axes about which the cleaned mesh may be turned onto itself, to within 5e-4 of its diagonal.
    pub symmetry: Vec<SymmetryAxis>,
}

/// Reads and repairs a mesh file and reports its content, faults and symmetries.
///
/// # Errors
/// As [`MeshFile::open`] and [`MeshFile::clean`].
pub fn examine(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Examination, MeshError> {
    let file = MeshFile::open(path, &options.step)?;
    file.examine(options).map(|(found, _)| found)
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::frame::symmetry::SymmetryOrder;
    use crate::mesh::shapes::PegInHole;
    use crate::mesh_io::write_obj;

    /// A peg that lies anywhere, in inches: its fourfold axis, and nothing of where it lies.
    #[test]
    fn a_turned_peg_is_told_by_its_axis_its_size_and_its_solids() {
        let (_, peg) = PegInHole::Rectangular.pair(0.0).unwrap();
        let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.7, 1.1);
        let placed = peg.transformed(turn, DVec3::new(0.2, -0.1, 0.05));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("peg.obj");
        write_obj(&path, &placed).unwrap();
        let options = ReadOptions {
            unit: LengthUnit::Inch,
            ..ReadOptions::default()
        };
        let found = examine(&path, &options).unwrap();
        assert_eq!(found.stated_unit, None);
        assert_eq!(found.report.triangles, peg.triangles().len());
        // Written in metres, read as inches; the text holds all digits.
        let volume = found.report.volume / 0.0254f64.powi(3) / peg.volume();
        assert!((volume - 1.0).abs() < 1e-9, "{volume}");
        let along = turn * DVec3::Z;
        let axis = found.symmetry.iter().find(|axis| {
            axis.order == SymmetryOrder::Finite(4) && axis.direction.dot(along).abs() > 1.0 - 1e-6
        });
        assert!(axis.is_some(), "{:?}", found.symmetry);
        let missing = examine(folder.path().join("none.obj"), &options);
        assert!(matches!(missing, Err(MeshError::Read { .. })));
    }
}
