//! STEP, through an external converter.
//!
//! Boundary representations need a CAD kernel to become triangles. The converter runs as a process
//! of its own, with limits, because kernels hang and crash on files that people have.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use super::stl;
use crate::hygiene::{HygieneOptions, HygieneReport};
use crate::mesh::TriangleMesh;
use crate::mesh_error::MeshError;

/// How a STEP file becomes triangles.
#[derive(Debug, Clone, PartialEq)]
pub struct StepOptions {
    /// The program to run, [Gmsh](https://gmsh.info) 4.11 or later: a path, or a name on the PATH.
    pub converter: PathBuf,
    /// Edges around a full turn of a curved face, 6 .. 1000: the chord error is
    /// `r (1 - cos(pi / n))`.
    pub segments_per_turn: u32,
    /// Time after which the converter is stopped.
    pub time_limit: Duration,
    /// Address space the converter may use, bytes.
    pub memory_limit: u64,
}

impl Default for StepOptions {
    /// `gmsh` from the PATH, 64 segments per turn, 2 minutes, 4 GiB.
    fn default() -> Self {
        Self {
            converter: PathBuf::from("gmsh"),
            segments_per_turn: 64,
            time_limit: Duration::from_secs(120),
            memory_limit: 4 << 30,
        }
    }
}

/// Reads all solids of a STEP file as one mesh, metres. The file states its own unit.
///
/// # Errors
/// If the file cannot be read, the converter is not installed, fails or passes a limit, the
/// result is not watertight, or [`TriangleMesh::clean`] refuses it.
pub fn read_step(
    path: impl AsRef<Path>,
    step: &StepOptions,
    hygiene: &HygieneOptions,
) -> Result<(TriangleMesh, HygieneReport), MeshError> {
    let path = path.as_ref();
    let name = path.display().to_string();
    // An absolute name cannot be taken for an option of the converter.
    let file = path.canonicalize().map_err(|source| MeshError::Read {
        path: path.to_owned(),
        source,
    })?;
    if !(6..=1000).contains(&step.segments_per_turn) {
        return Err(MeshError::OutOfRange {
            part: name,
            item: "segments-per-turn",
            expected: "6 .. 1000",
            found: f64::from(step.segments_per_turn),
        });
    }
    let bytes = convert(&file, step)?;
    let soup = stl::parse(&name, &bytes)?;
    let (mesh, report) = TriangleMesh::clean(&name, soup.vertices, soup.triangles, hygiene)?;
    if report.watertight {
        return Ok((mesh, report));
    }
    let found = format!("{} open edges", report.open_edges);
    Err(failure(path, step, "closed solids", found))
}

fn failure(path: &Path, step: &StepOptions, expected: &str, found: String) -> MeshError {
    MeshError::Converter {
        path: path.to_owned(),
        converter: step.converter.clone(),
        expected: expected.to_owned(),
        found,
    }
}

/// Runs the converter in a folder of its own and returns the STL file that it writes.
fn convert(path: &Path, step: &StepOptions) -> Result<Vec<u8>, MeshError> {
    let fail = |expected: &str, found: String| failure(path, step, expected, found);
    let no_room = |e: std::io::Error| fail("a temporary folder", e.to_string());
    let folder = tempfile::tempdir().map_err(no_room)?;
    let output = folder.path().join("converted.stl");
    let said = folder.path().join("messages.txt");
    let messages = File::create(&said).map_err(no_room)?;
    let mut child = command(path, step, &output)
        .stdin(Stdio::null())
        .stdout(messages.try_clone().map_err(no_room)?)
        .stderr(messages)
        .spawn()
        .map_err(|e| fail("a process to run it in", e.to_string()))?;
    let Some(status) = wait(&mut child, step.time_limit) else {
        let limit = format!("an end within {} s", step.time_limit.as_secs_f64());
        return Err(fail(&limit, "a process that still ran: stopped".to_owned()));
    };
    if status.code() == Some(127) {
        let expected = "an installed converter (pip install gmsh)";
        return Err(fail(expected, "no such program".to_owned()));
    }
    match std::fs::read(&output) {
        Ok(bytes) if status.success() => Ok(bytes),
        _ => {
            let text = std::fs::read(&said).unwrap_or_default();
            let text = String::from_utf8_lossy(&text);
            let last: Vec<&str> = text.lines().rev().take(3).collect();
            let last = last.into_iter().rev().collect::<Vec<_>>().join(" / ");
            Err(fail("triangles", format!("{status}, {last:?}")))
        }
    }
}

/// The shell limits its own address space and then becomes the converter; it exits with 127 if
/// there is none.
fn command(path: &Path, step: &StepOptions, output: &Path) -> Command {
    let mut command = Command::new("sh");
    command
        .arg("-c")
        .arg("ulimit -v \"$1\" && shift && exec \"$@\"")
        .arg("sh")
        .arg((step.memory_limit / 1024).to_string())
        .arg(&step.converter)
        .arg(path)
        .args(["-setstring", "Geometry.OCCTargetUnit", "M"])
        .args(["-setnumber", "Mesh.MeshSizeFromCurvature"])
        .arg(step.segments_per_turn.to_string())
        .args(["-setnumber", "Mesh.Binary", "1"])
        .args(["-2", "-format", "stl", "-o"])
        .arg(output);
    command
}

/// Waits for the child until the limit, then kills it and returns `None`.
fn wait(child: &mut Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) if start.elapsed() < limit => std::thread::sleep(Duration::from_millis(10)),
            _ => {
                // It may have ended in between; either way it must be reaped.
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
        }
    }
}
