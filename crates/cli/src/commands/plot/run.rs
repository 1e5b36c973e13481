//! Which figure, of what, to which file.

use std::path::Path;

use pegfit_pictures::Slice;
use pegfit_scene::Assembly;
use sdf_grid::atomic;

use super::curve::{Along, curve};
use super::density::{densities, overlap};
use super::surface::score_surface;
use super::well::{analyse, print_well};
use super::{force, surface};
use crate::args::{PlotArgs, PlotKind};
use crate::commands::scenes;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::require_folder;

pub(in crate::commands) fn run(args: &PlotArgs, context: &Context) -> Result<(), CommandError> {
    refuse_unused(args)?;
    let scene = scenes::read(&args.scene, args.fixed.as_deref())?;
    let slice = match &args.slice {
        Some(text) => Some(Slice::parse(text, scene.unit).map_err(CommandError::slice)?),
        None => None,
    };
    let along = args.along.as_deref();
    let plane = surface::parse_plane(along.filter(|_| args.kind == PlotKind::Score))?;
    let motion = Along::parse(along.filter(|_| args.kind == PlotKind::Energy))?;
    let assembly = scenes::load(scene, context)?;
    let slice = slice.unwrap_or_else(|| middle(&assembly));
    let picture = match args.kind {
        PlotKind::Density => densities(&assembly, &slice, context)?,
        PlotKind::Overlap => overlap(&assembly, &slice, context)?,
        PlotKind::Score => score_surface(&assembly, plane)?,
        PlotKind::Energy => curve(&assembly, motion)?,
        PlotKind::Force => force::both_tests(&assembly, context)?,
        PlotKind::Well => {
            return print_well(&assembly, &analyse(&assembly)?, context);
        }
    };
    let output = output(args)?;
    atomic::write(output, &picture)?;
    if !context.json {
        crate::say!("wrote {}", output.display());
    }
    Ok(())
}

fn output(args: &PlotArgs) -> Result<&Path, CommandError> {
    args.output
        .as_deref()
        .ok_or_else(|| CommandError::option("--output", "a picture file", "none"))
}

/// Options that the kind would ignore are mistakes to report, before anything is computed.
fn refuse_unused(args: &PlotArgs) -> Result<(), CommandError> {
    let kind = args.kind;
    let unused =
        |option: &str| CommandError::option(option, "no such option for this figure", "one");
    if args.slice.is_some() && !matches!(kind, PlotKind::Density | PlotKind::Overlap) {
        return Err(unused("--slice"));
    }
    if args.along.is_some() && !matches!(kind, PlotKind::Score | PlotKind::Energy) {
        return Err(unused("--along"));
    }
    match (kind, &args.output) {
        (PlotKind::Well, Some(_)) => Err(unused("--output")),
        (PlotKind::Well, None) => Ok(()),
        _ => require_folder(output(args)?),
    }
}

/// The plane y = constant through the middle of the assembled moving part.
fn middle(assembly: &Assembly) -> Slice {
    Slice {
        axis: 1,
        at: assembly.assembled().apply(assembly.pivot()).y,
    }
}
