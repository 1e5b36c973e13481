//! An assembly for viewers (GLB), robots (URDF) and MuJoCo (MJCF).

use std::path::{Path, PathBuf};

use pegfit_assemble::{Assembly, AssemblyLink, LoosePart, PlacedPart};
use pegfit_scene::{GlbPart, JointedPart, PartTree, write_glb, write_tree_mjcf, write_tree_urdf};

use crate::args::AssembleArgs;
use crate::error::CommandError;

/// Refuses a file that would replace one of those that are read.
pub(super) fn require_other(output: &Path, read: &[PathBuf]) -> Result<(), CommandError> {
    let whole = |path: &Path| path.canonicalize().ok();
    let Some(place) = whole(output) else {
        return Ok(());
    };
    match read.iter().any(|file| whole(file).as_ref() == Some(&place)) {
        true => Err(CommandError::input(
            output.display().to_string(),
            "output",
            "another name than that of a part",
            "a file that is read",
        )),
        false => Ok(()),
    }
}

/// Writes the files that were asked for; `read` are the files of the parts, which are not replaced.
pub(super) fn write_exports(
    args: &AssembleArgs,
    assembly: &Assembly,
    parts: &[LoosePart],
    read: &[PathBuf],
) -> Result<(), CommandError> {
    if let Some(path) = &args.glb {
        write_placed(path, &assembly.placed, parts)?;
    }
    if let Some(path) = &args.exploded {
        write_placed(path, &assembly.exploded(parts), parts)?;
    }
    if args.urdf.is_none() && args.mjcf.is_none() {
        return Ok(());
    }
    let name = args.output.file_stem().unwrap_or_default();
    let name = name.to_string_lossy();
    let jointed = |link: AssemblyLink| JointedPart {
        name: parts[link.part].name.clone(),
        mesh: &parts[link.part].mesh,
        parent: link.parent,
        pose: link.pose,
        joint: link.joint,
    };
    let tree = PartTree {
        name: &name,
        parts: assembly.links().into_iter().map(jointed).collect(),
        kept: read.to_vec(),
    };
    if let Some(path) = &args.urdf {
        write_tree_urdf(&tree, path)?;
    }
    if let Some(path) = &args.mjcf {
        write_tree_mjcf(&tree, path)?;
    }
    Ok(())
}

fn write_placed(
    path: &Path,
    placed: &[PlacedPart],
    parts: &[LoosePart],
) -> Result<(), CommandError> {
    let part = |p: &PlacedPart| GlbPart {
        name: &parts[p.part].name,
        mesh: &parts[p.part].mesh,
        pose: p.pose,
    };
    let placed: Vec<GlbPart> = placed.iter().map(part).collect();
    Ok(write_glb(&placed, path)?)
}
