//! STEP, through an external converter.
//!
//! Boundary representations need a CAD kernel to become triangles.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use super::converter::Converter;
use super::ledger::{Ledger, LedgerKind};
use super::soup::Soup;
use super::stl;
use super::unit::LengthUnit;
use crate::mesh::error::MeshError;

/// The script for Python: converts by Gmsh, or else Open CASCADE, through their Python modules.
const SCRIPT: &str = include_str!("step.py");

/// The script for the program `gmsh`, after a line that sets `Segments`: as [`SCRIPT`], but all
/// solids become one mesh.
const GEOMETRY: &str = include_str!("step.geo");

/// Looked for on the PATH, in this order, when no converter is given.
const CONVERTERS: [&str; 3] = ["python3", "python", "gmsh"];

/// Modules of Python that can convert, in the order in which they are tried.
const MODULES: [&str; 2] = ["gmsh", "OCP"];

/// Exit code of [`SCRIPT`] for a file without a solid.
const NO_SOLID: i32 = 70;

/// The message of [`GEOMETRY`] for such a file.
const NO_SOLID_SAID: &str = "pegfit: no solid in the file";

/// The remedy for a missing converter.
const INSTALL: &str = "an installed converter (pip install gmsh)";

/// The file that a converter writes, and what [`SCRIPT`] lists beside it.
const OUTPUT: &str = "converted.stl";
const LEDGER: &str = "converted.stl.ledger";

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
    /// Processor time after which a converter is stopped, in whole seconds, at least one; by the
    /// clock it may take ten times as long. The next converter has as much.
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
    let converted = convert(&file, options)?;
    let mut soup = stl::read(name, &converted.stl)?;
    soup.unit = Some(LengthUnit::M);
    soup.ledger = Ledger::default();
    soup.read("solid", soup.solids().len());
    soup.read("triangle made of its faces", soup.triangles.len());
    soup.ledger.extend(&converted.ledger);
    Ok((converted.converter, soup))
}

/// The output of a converter.
struct ConvertedFile {
    converter: PathBuf,
    stl: Vec<u8>,
    ledger: Ledger,
}

/// Why a converter failed.
enum ConversionError {
    /// It is not installed.
    Missing(String),
    /// It is, but failed: what it should have done and what came of it.
    Broken(String, String),
    /// It found no solid.
    NoSolid(String),
}

/// Runs the converter, or one after the other until one succeeds.
fn convert(file: &Path, options: &StepOptions) -> Result<ConvertedFile, MeshError> {
    let programs = match &options.converter {
        Some(converter) => vec![converter.clone()],
        None => CONVERTERS.map(PathBuf::from).to_vec(),
    };
    let (mut missing, mut broken) = (Vec::new(), Vec::new());
    for program in &programs {
        for &module in modules(program) {
            let run = Conversion {
                file,
                converter: program,
                module,
                options,
            };
            match run.run() {
                Ok((stl, ledger)) => {
                    return Ok(ConvertedFile {
                        converter: program.clone(),
                        stl,
                        ledger,
                    });
                }
                Err(ConversionError::NoSolid(found)) => {
                    let path = file.to_owned();
                    return Err(MeshError::NoSolid { path, found });
                }
                Err(ConversionError::Missing(why)) => {
                    missing.push(format!("{}: {why}", run.name()))
                }
                Err(ConversionError::Broken(expected, found)) => {
                    broken.push((program.clone(), run.name(), expected, found));
                }
            }
        }
    }
    // The message of an installed converter is more informative than that others are missing.
    let Some((converter, _, expected, found)) = broken.first().cloned() else {
        return Err(MeshError::Converter {
            path: file.to_owned(),
            converter: programs.into_iter().next_back().unwrap_or_default(),
            expected: INSTALL.to_owned(),
            found: missing.join("; "),
        });
    };
    let others = broken.iter().skip(1);
    let others = others.map(|(_, name, expected, found)| {
        format!("; then {name}: expected {expected}, found {found}")
    });
    Err(MeshError::Converter {
        path: file.to_owned(),
        converter,
        expected,
        found: found + &others.collect::<String>(),
    })
}

/// The modules by which a program can convert: those of Python, or none.
fn modules(program: &Path) -> &'static [Option<&'static str>] {
    const OF_PYTHON: [Option<&str>; 2] = [Some(MODULES[0]), Some(MODULES[1])];
    match is_python(program) {
        true => &OF_PYTHON,
        false => &[None],
    }
}

fn is_python(program: &Path) -> bool {
    let name = program.file_name().unwrap_or_default();
    name.to_string_lossy().starts_with("python")
}

/// One converter at work on one file.
struct Conversion<'a> {
    file: &'a Path,
    converter: &'a Path,
    /// The module that Python does it with.
    module: Option<&'static str>,
    options: &'a StepOptions,
}

impl Conversion<'_> {
    /// Its name in messages.
    fn name(&self) -> String {
        let program = self.converter.display();
        match self.module {
            Some(module) => format!("{program} with {module}"),
            None => program.to_string(),
        }
    }

    /// Runs in a folder of its own.
    fn run(&self) -> Result<(Vec<u8>, Ledger), ConversionError> {
        let converter = Converter {
            file: self.file,
            program: self.converter,
            time_limit: self.options.time_limit,
            memory_limit: self.options.memory_limit,
        };
        let finished = converter.execute(|command, folder| self.add_arguments(command, folder));
        let finished =
            finished.map_err(|[expected, found]| ConversionError::Broken(expected, found))?;
        if finished.status.code() == Some(NO_SOLID) && self.module.is_some() {
            return Err(ConversionError::NoSolid(finished.last_lines(1)));
        }
        if finished.messages.contains(NO_SOLID_SAID) {
            return Err(ConversionError::NoSolid(
                "nothing that bounds a solid".to_owned(),
            ));
        }
        if finished.is_not_installed() {
            return Err(ConversionError::Missing(finished.last_lines(1)));
        }
        let Some(stl) = finished.output(OUTPUT) else {
            return Err(ConversionError::Broken(
                "triangles".to_owned(),
                finished.describe(),
            ));
        };
        let listed = finished.output(LEDGER).unwrap_or_default();
        Ok((
            stl,
            ledger(std::str::from_utf8(&listed).unwrap_or_default()),
        ))
    }

    fn add_arguments(&self, command: &mut Command, folder: &Path) -> std::io::Result<()> {
        let segments = self.options.segments_per_turn.to_string();
        let output = folder.join(OUTPUT);
        if let Some(module) = self.module {
            let script = folder.join("step.py");
            std::fs::write(&script, SCRIPT)?;
            command
                .arg(script)
                .arg(module)
                .arg(self.file)
                .arg(output)
                .arg(segments);
        } else {
            let script = folder.join("step.geo");
            std::fs::write(&script, format!("Segments = {segments};\n{GEOMETRY}"))?;
            command
                .arg(self.file)
                .arg(script)
                .args(["-setstring", "Geometry.OCCTargetUnit", "M"])
                .args(["-setnumber", "Mesh.Binary", "1"])
                .args(["-2", "-format", "stl", "-o"])
                .arg(output);
        }
        Ok(())
    }
}

/// The ledger that [`SCRIPT`] writes beside the triangles.
fn ledger(text: &str) -> Ledger {
    let mut ledger = Ledger::default();
    for line in text.lines() {
        let columns: Vec<&str> = line.split('\t').collect();
        let [kind, item, count, reason] = columns[..] else {
            continue;
        };
        let kind = match kind {
            "ignored" => LedgerKind::Ignored,
            _ => LedgerKind::Assumed,
        };
        ledger.add_many(kind, item, reason, count.parse().unwrap_or(1));
    }
    ledger
}
