//! `pegfit check`: can these meshes, or those of a scene, be used, and what had to be repaired?

use std::path::PathBuf;

use pegfit_scene::{FitVerdict, MeshVerdict, Scene};
use sdf_grid::mesh_io::ReadOptions;
use serde::Serialize;

use crate::args::CheckArgs;
use crate::context::Context;
use crate::error::{CommandError, Exit};

/// The result for programs; its shape does not depend on the inputs.
#[derive(Debug, Serialize)]
struct Findings {
    /// Every mesh, in the order in which it was named.
    meshes: Vec<MeshVerdict>,
    /// Every fixed part of the scenes with the moving one; none without a scene.
    pairs: Vec<FitVerdict>,
}

/// A mesh to look at, and how to read it.
#[derive(Debug, Clone, PartialEq)]
struct MeshInput {
    path: PathBuf,
    options: ReadOptions,
}

pub(super) fn run(args: &CheckArgs, context: &Context) -> Result<(), CommandError> {
    let (mut inputs, mut pairs) = (Vec::new(), Vec::new());
    for path in &args.meshes {
        match path.extension().is_some_and(|e| e == "toml") {
            true => {
                let scene = Scene::read(path)?;
                inputs.extend(meshes_of(&scene));
                pairs.extend(FitVerdict::all(&scene));
            }
            false => inputs.push(MeshInput {
                path: path.clone(),
                options: args.choice.options(args.unit),
            }),
        }
    }
    let judge = |input: &MeshInput| MeshVerdict::of_file(&input.path, &input.options);
    let meshes = inputs.iter().map(judge).collect();
    let findings = Findings { meshes, pairs };
    context.show(&findings, || {
        let meshes = findings.meshes.iter().zip(&inputs);
        let meshes = meshes.flat_map(|(verdict, input)| verdict.lines(input.options.unit));
        let pairs = findings.pairs.iter().flat_map(FitVerdict::lines);
        for line in meshes.chain(pairs) {
            say!("{line}");
        }
    })?;
    let verdicts = findings.meshes.iter().zip(&inputs);
    let unusable: Vec<&MeshInput> = verdicts
        .filter(|(verdict, _)| !verdict.is_usable())
        .map(|(_, input)| input)
        .collect();
    if unusable.is_empty() {
        return Ok(());
    }
    // A file that is not there is a wrong argument, as everywhere.
    let exit = match unusable.iter().any(|input| input.path.exists()) {
        true => Exit::UnusableMesh,
        false => Exit::BadInput,
    };
    let (count, all) = (unusable.len(), findings.meshes.len());
    Err(CommandError::Verdict(
        format!("{count} of {all} meshes cannot be used"),
        exit,
    ))
}

/// Every mesh of a scene once, however often it stands there.
fn meshes_of(scene: &Scene) -> Vec<MeshInput> {
    let mut inputs = Vec::new();
    for part in scene.fixed_parts().chain([&scene.moving]) {
        for mesh in &part.meshes {
            let input = MeshInput {
                path: mesh.path.clone(),
                options: mesh.options(scene.unit),
            };
            if !inputs.contains(&input) {
                inputs.push(input);
            }
        }
    }
    inputs
}
