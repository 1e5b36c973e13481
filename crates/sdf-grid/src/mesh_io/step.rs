//! STEP, through an external converter.
//!
//! Boundary representations need a CAD kernel to become triangles. The converter runs as a process
//! of its own, with limits, because kernels hang and crash on files that people have.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::soup::Soup;
use super::stl;
use super::unit::LengthUnit;
use crate::mesh::error::MeshError;

/// What Python runs: Gmsh, or else Open CASCADE, through their Python modules.
const SCRIPT: &str = include_str!("step.py");

/// Looked for on the PATH, in this order, when no converter is given.
const CONVERTERS: [&str; 3] = ["python3", "python", "gmsh"];

/// Exit codes that say that a converter is not installed: the shell's, and that of [`SCRIPT`]
/// without a module.
const NOT_INSTALLED: [i32; 2] = [127, 69];

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
        let run = Conversion {
            file,
            converter,
            options,
        };
        match run.run()? {
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

/// One converter at work on one file.
struct Conversion<'a> {
    file: &'a Path,
    converter: &'a Path,
    options: &'a StepOptions,
}

impl Conversion<'_> {
    fn failure(&self, expected: impl Into<String>, found: impl Into<String>) -> MeshError {
        MeshError::Converter {
            path: self.file.to_owned(),
            converter: self.converter.to_owned(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    /// Runs in a folder of its own; `Ok(Err(why))` if the converter is not installed.
    fn run(&self) -> Result<Result<Vec<u8>, String>, MeshError> {
        let no_room = |e: std::io::Error| self.failure("a temporary folder", e.to_string());
        let folder = tempfile::tempdir().map_err(no_room)?;
        let output = folder.path().join("converted.stl");
        let said = folder.path().join("messages.txt");
        let messages = File::create(&said).map_err(no_room)?;
        let mut command = self.command(folder.path(), &output).map_err(no_room)?;
        command
            .stdin(Stdio::null())
            .stdout(messages.try_clone().map_err(no_room)?)
            .stderr(messages)
            .current_dir(folder.path());
        // A group of its own, so that what the converter starts is stopped with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .spawn()
            .map_err(|e| self.failure("a process to run it in", e.to_string()))?;
        let Some(status) = wait(&mut child, self.options.time_limit) else {
            let limit = format!("an end within {} s", self.options.time_limit.as_secs_f64());
            return Err(self.failure(limit, "a process that still ran: stopped"));
        };
        let text = std::fs::read(&said).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let last = |lines: usize| {
            let skipped = text.lines().count().saturating_sub(lines);
            text.lines().skip(skipped).collect::<Vec<_>>().join(" / ")
        };
        if status
            .code()
            .is_some_and(|code| NOT_INSTALLED.contains(&code))
        {
            return Ok(Err(last(1)));
        }
        match std::fs::read(&output) {
            Ok(bytes) if status.success() => Ok(Ok(bytes)),
            _ => Err(self.failure("triangles", format!("{status}, {:?}", last(3)))),
        }
    }

    /// The shell limits itself and then becomes the converter; it exits with 127 if there is none.
    fn command(&self, folder: &Path, output: &Path) -> std::io::Result<Command> {
        let limit = self.options.memory_limit;
        let segments = self.options.segments_per_turn.to_string();
        let mut command = Command::new("sh");
        command
            .arg("-c")
            .arg("ulimit -v \"$1\" && ulimit -f \"$2\" && shift 2 && exec \"$@\"")
            .arg("sh")
            .arg((limit / 1024).to_string())
            .arg((limit / 512).to_string())
            .arg(self.converter);
        let name = self.converter.file_name().unwrap_or_default();
        if name.to_string_lossy().starts_with("python") {
            let script = folder.join("step.py");
            std::fs::write(&script, SCRIPT)?;
            command.arg(script).arg(self.file).arg(output).arg(segments);
        } else {
            command
                .arg(self.file)
                .args(["-setstring", "Geometry.OCCTargetUnit", "M"])
                .args(["-setnumber", "Mesh.MeshSizeFromCurvature", &segments])
                .args(["-setnumber", "Mesh.Binary", "1"])
                .args(["-2", "-format", "stl", "-o"])
                .arg(output);
        }
        Ok(command)
    }
}

/// Waits for the child until the limit, then stops it and all it started and returns `None`.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if start.elapsed() < limit => std::thread::sleep(Duration::from_millis(10)),
            _ => {
                stop(child);
                // It may have ended in between; either way it must be reaped.
                let _ = child.wait();
                return None;
            }
        }
    }
}

#[cfg(unix)]
fn stop(child: &mut Child) {
    let group = rustix::process::Pid::from_child(child);
    if rustix::process::kill_process_group(group, rustix::process::Signal::KILL).is_err() {
        let _ = child.kill();
    }
}

#[cfg(not(unix))]
fn stop(child: &mut Child) {
    let _ = child.kill();
}
