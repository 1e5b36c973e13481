//! `pegfit scene`: from a file of solids, or a robot's description, to a scene.

use std::path::{Path, PathBuf};
use std::time::Duration;

use glam::{DQuat, DVec3};
use pegfit_scene::{
    FACETS, SceneDraft, SolidOptions, SolidSet, TOUCHING, ledger_lines, shell_word,
};
use rayon::prelude::*;
use sdf_grid::text::shown;
use sdf_grid::{InterferenceQuery, Ledger, LengthUnit};
use serde::Serialize;

use crate::args::SceneArgs;
use crate::context::Context;
use crate::error::CommandError;
use crate::report::output::{print_json, require_folder};

/// Summary of a solid.
#[derive(Debug, Serialize)]
struct SolidSummary {
    /// Of its solid, link or body, from 1.
    number: usize,
    name: String,
    triangles: usize,
    /// Metres.
    size: [f64; 3],
    role: Role,
    /// Cubic metres that it shares with what moves; only of solids that stay.
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_volume: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Role {
    Listed,
    Moving,
    Fixed,
    LeftOut,
}

/// Summary for programs.
#[derive(Debug, Serialize)]
struct Summary {
    solids: Vec<SolidSummary>,
    /// Cubic metres of what moves; 0 if nothing does.
    moving_volume: f64,
    scene: Option<PathBuf>,
    meshes: Vec<PathBuf>,
    /// What was read of the file, what was ignored and what was assumed.
    ledger: Ledger,
}

pub(super) fn run(args: &SceneArgs, context: &Context) -> Result<(), CommandError> {
    if let Some(output) = &args.output {
        require_folder(output)?;
    }
    let options = SolidOptions {
        unit: args.unit,
        segments_per_turn: args.reading.segments_per_turn,
        step_time_limit: Duration::from_secs(args.reading.step_time_limit),
        lossy: args.reading.lossy,
        visual: args.visual,
        ..SolidOptions::default()
    };
    let set = SolidSet::read(&args.file, &options)?;
    if args.moving.is_empty() {
        let summary = Summary {
            solids: (0..set.solids.len())
                .map(|i| describe_solid(&set, i, Role::Listed))
                .collect(),
            moving_volume: 0.0,
            scene: None,
            meshes: Vec::new(),
            ledger: set.ledger.clone(),
        };
        return print(&summary, &args.file, context);
    }
    let draft = set.draft(&args.moving, &args.fixed, args.separate)?;
    let mut summary = describe(&draft);
    if let Some(output) = &args.output {
        summary.meshes = draft.write(output)?;
        summary.scene = Some(output.clone());
    }
    print(&summary, &args.file, context)
}

fn describe_solid(set: &SolidSet, index: usize, role: Role) -> SolidSummary {
    let solid = &set.solids[index];
    let groups = set.groups();
    let number = groups
        .iter()
        .position(|(g, _)| *g == solid.group)
        .unwrap_or(0)
        + 1;
    SolidSummary {
        number,
        name: set.called(index),
        triangles: solid.mesh.triangles().len(),
        size: solid.placed().bounds().size().to_array(),
        role,
        shared_volume: None,
    }
}

/// Every solid, and what those that stay share with those that move.
fn describe(draft: &SceneDraft<'_>) -> Summary {
    let set = draft.set;
    let moving: Vec<_> = draft
        .moving
        .iter()
        .map(|&i| set.solids[i].placed())
        .collect();
    let shared = |i: usize| -> f64 {
        let fixed = set.solids[i].placed();
        let shared = |m| InterferenceQuery::new(&fixed, m).at(DQuat::IDENTITY, DVec3::ZERO);
        moving.iter().map(|m| shared(m).volume).sum()
    };
    let mut solids: Vec<SolidSummary> = (draft.fixed.par_iter())
        .map(|&i| SolidSummary {
            shared_volume: Some(shared(i)),
            ..describe_solid(set, i, Role::Fixed)
        })
        .collect();
    solids.extend(
        draft
            .moving
            .iter()
            .map(|&i| describe_solid(set, i, Role::Moving)),
    );
    solids.extend(
        draft
            .left_out
            .iter()
            .map(|&i| describe_solid(set, i, Role::LeftOut)),
    );
    solids.sort_by_key(|s| s.number);
    Summary {
        solids,
        moving_volume: moving.iter().map(|m| m.volume()).sum(),
        scene: None,
        meshes: Vec::new(),
        ledger: set.ledger.clone(),
    }
}

fn print(summary: &Summary, file: &Path, context: &Context) -> Result<(), CommandError> {
    if context.json {
        return print_json(summary);
    }
    let longest = summary
        .solids
        .iter()
        .flat_map(|s| s.size)
        .fold(0.0, f64::max);
    let unit = if longest < 0.5 {
        LengthUnit::Mm
    } else {
        LengthUnit::M
    };
    let metre = unit.in_metres();
    for solid in &summary.solids {
        let [x, y, z] = solid.size.map(|side| side / metre);
        let role = match solid.role {
            Role::Listed => "",
            Role::Moving => ", moves",
            Role::Fixed => ", stays",
            Role::LeftOut => ", left out: out of reach, or not asked for",
        };
        say!(
            "{:>4}  {:<24} {:>9} triangles  {x:.3} x {y:.3} x {z:.3} {unit}{role}",
            solid.number,
            shown(&solid.name),
            solid.triangles
        );
    }
    for line in ledger_lines(&summary.ledger) {
        say!("{line}");
    }
    for solid in &summary.solids {
        if let Some(volume) = solid
            .shared_volume
            .filter(|v| *v > TOUCHING * summary.moving_volume)
        {
            say_overlap(solid, volume / summary.moving_volume, volume / 1e-9);
        }
    }
    say_next(summary, file);
    Ok(())
}

/// That solids cut into each other where they are, and what to do about it.
fn say_overlap(solid: &SolidSummary, share: f64, cubic_millimetres: f64) {
    let advice = match share <= FACETS {
        true => "facets, or a press fit",
        false => "more than facets do: look whether the file shows the fit (pegfit plot overlap)",
    };
    say!(
        "overlap: {} and what moves share {cubic_millimetres:.4} mm³, {:.3} % of what moves: {advice}",
        shown(&solid.name),
        100.0 * share
    );
}

/// The command to go on with.
fn say_next(summary: &Summary, file: &Path) {
    let Some(scene) = &summary.scene else {
        let wanted = match summary.moving_volume > 0.0 {
            true => "-o scene.toml to write the scene",
            false => "--moving NAME -o scene.toml to make a scene",
        };
        return say!("next: pegfit scene {} ... {wanted}", shell_word(file));
    };
    if let Some(first) = summary.meshes.first() {
        let folder = first.parent().unwrap_or(Path::new(""));
        say!("meshes: {} in {}", summary.meshes.len(), folder.display());
    }
    say!("scene:  {}", scene.display());
    let scene = shell_word(scene);
    say!("next:   pegfit check {scene}; pegfit plot well {scene}; pegfit play {scene}");
}
