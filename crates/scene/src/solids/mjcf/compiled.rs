//! Models as MuJoCo compiles them.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use sdf_grid::mesh_io::Converter;
use sdf_grid::text::quoted;
use sdf_grid::{Ledger, LedgerKind};
use serde::Deserialize;

use crate::solids::error::ImportError;
use crate::solids::geometry;
use crate::solids::geometry::{Geometry, Shape, Triangles};
use crate::solids::mjcf::geom::MujocoOptions;
use crate::solids::mjcf::geom::{Geom, HEIGHT_FIELD, PLANE, STANDS};

/// What Python runs.
const SCRIPT: &str = include_str!("compile.py");

/// Looked for on the PATH, in this order, when no interpreter is given.
const INTERPRETERS: [&str; 2] = ["python3", "python"];

/// Parts of a metre, or of a turn, that are the rounding of the way into a mesh's own frame and back.
const ROUNDING: f64 = 1e-14;

/// What the script writes.
#[derive(Debug, Deserialize)]
struct Model {
    version: String,
    bodies: Vec<String>,
    meshes: Vec<Mesh>,
    geoms: Vec<CompiledGeom>,
    joints: u64,
    keys: u64,
    flexes: u64,
    skins: u64,
    sites: u64,
}

#[derive(Debug, Deserialize)]
struct Mesh {
    name: String,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    /// Vertices that no triangle uses.
    spare: u64,
}

#[derive(Debug, Deserialize)]
struct CompiledGeom {
    kind: String,
    /// Number of its mesh.
    mesh: Option<usize>,
    body: usize,
    /// Half lengths, as MuJoCo has them.
    size: [f64; 3],
    position: [f64; 3],
    /// w first.
    quaternion: [f64; 4],
    visual: bool,
}

/// Every geom of the model; or why there is no MuJoCo.
pub(super) fn geoms(
    path: &Path,
    options: &MujocoOptions,
    ledger: &mut Ledger,
) -> Result<Result<Vec<Geom>, String>, ImportError> {
    let candidates = match &options.interpreter {
        Some(interpreter) => vec![interpreter.clone()],
        None => INTERPRETERS.map(PathBuf::from).to_vec(),
    };
    // The folder that the model is read from, not that of a link's target, is where its files are.
    let whole = std::path::absolute(path).map_err(|source| ImportError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut missing = Vec::new();
    for interpreter in &candidates {
        let converter = Converter {
            file: path,
            program: interpreter,
            time_limit: options.time_limit,
            memory_limit: options.memory_limit,
        };
        let outcome =
            converter.run("a model that MuJoCo compiles", |command, folder, output| {
                let script = folder.join("compile.py");
                std::fs::write(&script, SCRIPT)?;
                command.arg(script).arg(&whole).arg(output);
                Ok(())
            })?;
        match outcome {
            Ok(bytes) => return understood(&converter, &bytes, ledger).map(Ok),
            Err(why) => missing.push(format!("{}: {why}", interpreter.display())),
        }
    }
    Ok(Err(missing.join("; ")))
}

/// The geoms of what the script wrote.
fn understood(
    converter: &Converter<'_>,
    bytes: &[u8],
    ledger: &mut Ledger,
) -> Result<Vec<Geom>, ImportError> {
    let odd = |found: String| converter.failure("the geoms of a model", found);
    let model: Model = serde_json::from_slice(bytes).map_err(|e| odd(e.to_string()))?;
    let compiled = format!("model compiled by MuJoCo {}", model.version);
    ledger.add(LedgerKind::Read, &compiled, "");
    note(&model, ledger);
    let mut meshes = Vec::new();
    for mesh in model.meshes {
        meshes.push(Arc::new(Triangles {
            name: format!("{}: mesh {}", converter.file.display(), quoted(&mesh.name)),
            vertices: mesh.vertices.into_iter().map(DVec3::from).collect(),
            triangles: mesh.triangles,
        }));
    }
    let mut geoms = Vec::new();
    for found in model.geoms {
        let [a, b, c] = found.size;
        let geometry = match found.kind.as_str() {
            "box" => Geometry::Box(2.0 * DVec3::new(a, b, c)),
            "cylinder" => Geometry::Cylinder {
                radius: a,
                height: 2.0 * b,
            },
            "capsule" => Geometry::Capsule {
                radius: a,
                height: 2.0 * b,
            },
            "sphere" => Geometry::Sphere(a),
            "ellipsoid" => Geometry::Ellipsoid(DVec3::new(a, b, c)),
            "mesh" | "sdf" => match found.mesh.and_then(|i| meshes.get(i)) {
                Some(mesh) => Geometry::Triangles(mesh.clone()),
                None => {
                    return Err(odd(format!(
                        "a geom of {}",
                        (found.mesh).map_or("no mesh".to_owned(), |i| format!("mesh {i}"))
                    ))
                    .into());
                }
            },
            "plane" | "hfield" => continue,
            other => return Err(odd(format!("a geom of type {other}")).into()),
        };
        let name = match model.bodies.get(found.body).map(String::as_str) {
            Some("") => format!("body {}", found.body),
            Some(name) => name.to_owned(),
            None => return Err(odd(format!("a geom of body {}", found.body)).into()),
        };
        let [w, x, y, z] = found.quaternion.map(rounded);
        geoms.push(Geom {
            visual: found.visual,
            shape: Shape {
                name,
                group: found.body,
                pose: geometry::pose(DQuat::from_xyzw(x, y, z, w), found.position.map(rounded)),
                geometry,
            },
        });
    }
    Ok(geoms)
}

/// What is in the model and is no solid, and what was assumed.
fn note(model: &Model, ledger: &mut Ledger) {
    for found in &model.geoms {
        match found.kind.as_str() {
            "plane" => ledger.add(LedgerKind::Ignored, "plane geom", PLANE),
            "hfield" => ledger.add(LedgerKind::Ignored, "hfield geom", HEIGHT_FIELD),
            "sdf" => {
                let reason = "the surface that MuJoCo draws of its function";
                ledger.add(LedgerKind::Assumed, "sdf geom", reason);
            }
            _ => {}
        }
    }
    for mesh in &model.meshes {
        let item = format!("vertex of mesh {}", quoted(&mesh.name));
        let reason = "no triangle has it: MuJoCo reads the first object of an OBJ file alone";
        ledger.add_many(LedgerKind::Ignored, &item, reason, mesh.spare);
    }
    for (item, reason, count) in [
        ("flex", "it is soft", model.flexes),
        ("skin", "it is there to be looked at", model.skins),
        ("site", "it is a mark without substance", model.sites),
        ("key", "bodies are at the reference pose", model.keys),
    ] {
        ledger.add_many(LedgerKind::Ignored, item, reason, count);
    }
    ledger.add_many(LedgerKind::Assumed, "joint", STANDS, model.joints);
}

/// Without digits that are nothing but rounding.
fn rounded(x: f64) -> f64 {
    if x.abs() < ROUNDING { 0.0 } else { x }
}
