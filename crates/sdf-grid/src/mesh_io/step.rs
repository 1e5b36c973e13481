//! STEP, through an external converter.
//!
//! Boundary representations need a CAD kernel to become triangles.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::converter::Converter;
use super::soup::Soup;
use super::stl;
use super::unit::LengthUnit;
use crate::mesh::error::MeshError;

/// What Python runs: Gmsh, or else Open CASCADE, through their Python modules.
const SCRIPT: &str = include_str!("step.py");

/// Looked for on the PATH, in this order, when no converter is given.
const CONVERTERS: [&str; 3] = ["python3", "python", "gmsh"];

/// What to do without a converter.
const INSTALL: &str = "an installed converter (pip install gmsh)";

/// How a STEP file becomes triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct StepOptions {
    /// The program to run: a Python interpreter (a file name that starts with `python`) whose
    /// `gmsh` or `OCP` module does the work, or the [Gmsh](https://gmsh.info) 4.11 program, which
    /// cannot tell the names of solids. A path, or a name on the PATH; if `None`, the first of
    /// `python3`, `python` and `gmsh` that will do.
    pub converter: Option<PathBuf>,
    /// Edges around a full turn of a curved face, 6 .. 1000: the deflection of an arc of radius r
    /// is `r (1 - cos(pi / n))`.
    pub segments_per_turn: u32,
    /// Time after which the converter is stopped.
    pub time_limit: Duration,
    /// Address space the converter may use, and the most it may write to a file, bytes.
    pub memory_limit: u64,
}

impl Default for StepOptions {
    /// A converter from the PATH, 64 segments per turn, 2 minutes, 4 GiB.
    fn default() -> Self {
        Self {
            converter: None,
            segments_per_turn: 64,
            time_limit: Duration::from_secs(120),
            memory_limit: 4 << 30,
        }
    }
}

/// Converts all solids of a STEP file, called `name` in errors; says which program did it. The file
/// states its own unit; the result is in metres.
pub(super) fn convert_file(
    name: &str,
    path: &Path,
    options: &StepOptions,
) -> Result<(PathBuf, Soup), MeshError> {
    // An absolute name cannot be taken for an option of the converter.
    let file = path.canonicalize().map_err(|source| MeshError::Read {
        path: path.to_owned(),
        source,
    })?;
    if !(6..=1000).contains(&options.segments_per_turn) {
        return Err(MeshError::OutOfRange {
            part: name.to_owned(),
            item: "segments-per-turn",
            expected: "6 .. 1000",
            found: f64::from(options.segments_per_turn),
        });
    }
    let (converter, bytes) = convert(&file, options)?;
    let mut soup = stl::read(name, &bytes)?;
    soup.unit = Some(LengthUnit::M);
    Ok((converter, soup))
}

/// Runs the converter, or the first that is installed, and returns it and the STL that it writes.
fn convert(file: &Path, options: &StepOptions) -> Result<(PathBuf, Vec<u8>), MeshError> {
    let candidates = match &options.converter {
        Some(converter) => vec![converter.clone()],
        None => CONVERTERS.map(PathBuf::from).to_vec(),
    };
    let mut missing = Vec::new();
    for converter in &candidates {
        let run = Converter {
            file,
            program: converter,
            time_limit: options.time_limit,
            memory_limit: options.memory_limit,
        };
        let outcome = run.run("triangles", |command, folder, output| {
            arguments(command, file, [folder, output], converter, options)
        })?;
        match outcome {
            Ok(bytes) => return Ok((converter.clone(), bytes)),
            Err(why) => missing.push(format!("{}: {why}", converter.display())),
        }
    }
    Err(MeshError::Converter {
        path: file.to_owned(),
        converter: candidates.into_iter().next_back().unwrap_or_default(),
        expected: INSTALL.to_owned(),
        found: missing.join("; "),
    })
}

/// What a converter is told.
fn arguments(
    command: &mut Command,
    file: &Path,
    [folder, output]: [&Path; 2],
    converter: &Path,
    options: &StepOptions,
) -> std::io::Result<()> {
    let segments = options.segments_per_turn.to_string();
    let name = converter.file_name().unwrap_or_default();
    if name.to_string_lossy().starts_with("python") {
        let script = folder.join("step.py");
        std::fs::write(&script, SCRIPT)?;
        command.arg(script).arg(file).arg(output).arg(segments);
    } else {
        command
            .arg(file)
            .args(["-setstring", "Geometry.OCCTargetUnit", "M"])
            .args(["-setnumber", "Mesh.MeshSizeFromCurvature", &segments])
            .args(["-setnumber", "Mesh.Binary", "1"])
            .args(["-2", "-format", "stl", "-o"])
            .arg(output);
    }
    Ok(())
}
