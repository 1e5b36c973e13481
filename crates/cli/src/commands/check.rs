//! `pegfit check`: can these meshes, or those of a scene, be used, and what had to be repaired?

use std::path::PathBuf;

use glam::{DQuat, DVec3};
use pegfit_scene::{FitSolids, Scene};
use sdf_grid::mesh_io::{ReadOptions, Solid, examine};
use sdf_grid::text::shown;
use sdf_grid::{
    Interference, InterferenceQuery, Ledger, LengthUnit, MeshError, RepairReport, SymmetryAxis,
    SymmetryOrder,
};
use serde::Serialize;

use crate::args::CheckArgs;
use crate::context::Context;
use crate::error::{CommandError, Exit};
use crate::report::ledger;

/// Components and solids listed one by one.
const MOST_LISTED: usize = 12;

/// Metres across: parts outside are rare, and files in another unit are not.
const LEAST: f64 = 5e-4;
const MOST: f64 = 20.0;

/// What to do about open edges that are tolerated.
const OPEN: &str = "it can be used as it is; export a closed solid for exact signs, and for shorter \
                    computations";

/// The verdict on one file.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Verdict {
    Usable {
        #[serde(flatten)]
        report: Box<RepairReport>,
        solids: Vec<String>,
        stated_unit: Option<LengthUnit>,
        symmetry: Vec<SymmetryAxis>,
        ledger: Ledger,
        warnings: Vec<String>,
        usable: bool,
    },
    Unusable {
        name: String,
        error: String,
        next: Option<&'static str>,
        usable: bool,
    },
}

/// The result for programs; its shape does not depend on the inputs.
#[derive(Debug, Serialize)]
struct Findings {
    /// Every mesh, in the order in which it was named.
    meshes: Vec<Verdict>,
    /// Every fixed part of the scenes with the moving one; none without a scene.
    pairs: Vec<Fit>,
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
                pairs.extend(fits_of(&scene));
            }
            false => inputs.push(MeshInput {
                path: path.clone(),
                options: args.choice.options(args.unit),
            }),
        }
    }
    let meshes = inputs.iter().map(judge).collect();
    let findings = Findings { meshes, pairs };
    context.show(&findings, || {
        for (verdict, input) in findings.meshes.iter().zip(&inputs) {
            print(verdict, input.options.unit);
        }
        for pair in &findings.pairs {
            print_fit(pair);
        }
    })?;
    let unusable = findings
        .meshes
        .iter()
        .filter(|v| matches!(v, Verdict::Unusable { .. }))
        .count();
    match unusable {
        0 => Ok(()),
        count => Err(CommandError::Verdict(
            format!("{count} of {} meshes cannot be used", findings.meshes.len()),
            Exit::UnusableMesh,
        )),
    }
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

fn judge(input: &MeshInput) -> Verdict {
    match examine(&input.path, &input.options) {
        Ok(found) => Verdict::Usable {
            symmetry: found.symmetry,
            ledger: found.ledger,
            warnings: found.report.warnings(),
            report: Box::new(found.report),
            solids: listed(&found.solids),
            stated_unit: found.stated_unit,
            usable: true,
        },
        Err(error) => Verdict::Unusable {
            name: input.path.display().to_string(),
            next: next_for(&error),
            error: error.to_string(),
            usable: false,
        },
    }
}

/// What to do about a mesh that cannot be used.
fn next_for(error: &MeshError) -> Option<&'static str> {
    Some(match error {
        MeshError::Open { .. } => {
            "close the surface in the program that made it (\"make solid\", \"fill holes\"), or \
             export the solid anew as STL, 3MF or STEP; a surface without thickness is no part"
        }
        MeshError::Empty { .. } => "export the part as triangles: curves and points are not read",
        MeshError::Format { .. } => "export it in one of these formats",
        MeshError::Converter { .. } => "pip install gmsh, or export STL or 3MF instead",
        MeshError::NoSolid { .. } => "pegfit reads solids: sew the faces together and export again",
        MeshError::Unread { .. } => {
            "export the part as one solid without it, or ask for the rest with --lossy"
        }
        MeshError::Solid { .. } => "pegfit check FILE lists its solids",
        MeshError::NonFiniteVertex { .. } => "export the part near the origin, or give its unit",
        _ => return None,
    })
}

/// A remark on a size that few parts have.
fn odd_size(report: &RepairReport, stated: bool) -> Option<String> {
    let longest = report.bounds.size().max_element();
    if stated || (LEAST..MOST).contains(&longest) {
        return None;
    }
    let (m, inch) = (LengthUnit::M, LengthUnit::Inch);
    Some(format!(
        "{longest:.3e} m across: if that is not its size, say its unit, as in --unit {m} or --unit \
         {inch} (unit = \"{m}\" in a scene)"
    ))
}

/// Number, name and size of each solid.
fn listed(solids: &[Solid]) -> Vec<String> {
    solids
        .iter()
        .enumerate()
        .map(|(i, s)| match s.name.as_str() {
            "" => format!("{}, no name, {} triangles", i + 1, s.triangles),
            name => format!("{}, {name:?}, {} triangles", i + 1, s.triangles),
        })
        .collect()
}

fn print(verdict: &Verdict, unit: LengthUnit) {
    match verdict {
        Verdict::Unusable {
            name, error, next, ..
        } => {
            say!("{}: cannot be used", shown(name));
            say!("  {error}");
            if let Some(next) = next {
                say!("  next         {next}");
            }
        }
        Verdict::Usable {
            report,
            solids,
            stated_unit,
            symmetry,
            ledger,
            warnings,
            ..
        } => {
            say!("{}: usable", shown(&report.name));
            if let Some(stated) = stated_unit {
                say!("  unit         {stated}, as the file says");
            }
            ledger::print(ledger);
            if solids.len() > 1 {
                print_list("solid", solids);
            }
            print_changes(report, unit);
            print_surface(report, unit);
            print_size(report, unit);
            for axis in symmetry {
                let [x, y, z] = axis.direction.to_array();
                let order = match axis.order {
                    SymmetryOrder::Continuous => "any turn".to_owned(),
                    SymmetryOrder::Finite(n) => format!("{n}-fold"),
                };
                say!("  symmetry     {order} about ({x:.4}, {y:.4}, {z:.4})");
            }
            for warning in warnings {
                say!("  note         {warning}");
            }
            if let Some(next) = odd_size(report, stated_unit.is_some()) {
                say!("  next         {next}");
            }
            if report.open_edges > 0 {
                say!("  next         {OPEN}");
            }
        }
    }
}

fn print_list(title: &str, lines: &[String]) {
    for line in lines.iter().take(MOST_LISTED) {
        say!("  {title:<12} {line}");
    }
    if let Some(more) = lines.len().checked_sub(MOST_LISTED + 1) {
        say!("  {title:<12} and {} more", more + 1);
    }
}

/// Prints what the repair changed to the triangles.
fn print_changes(report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    say!(
        "  triangles    {} of {} kept: {} without area, {} duplicate, {} edges cut at T-junctions",
        report.triangles,
        report.input_triangles,
        report.zero_area_faces,
        report.duplicate_faces,
        report.stitched_edges
    );
    say!(
        "  vertices     {} of {} kept: {} welded within {:.3e} {unit}, {} unused",
        report.vertices,
        report.input_vertices,
        report.welded_vertices,
        report.weld_distance / metre,
        report.unused_vertices
    );
}

/// How the surface hangs together.
fn print_surface(report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    say!("  components   {}", report.components);
    if report.components > 1 {
        let lines: Vec<String> = report
            .per_component
            .iter()
            .map(|c| {
                let mut text = format!(
                    "{} triangles, {} reversed, volume {:.6} {unit}³",
                    c.triangles,
                    c.flipped_faces,
                    c.volume / metre.powi(3)
                );
                if c.cavity {
                    text += ", a cavity";
                }
                text
            })
            .collect();
        print_list("component", &lines);
    }
    match (report.watertight, report.open_edges) {
        (true, _) => say!("  watertight   yes"),
        (false, 0) => say!("  watertight   no"),
        (false, n) => say!(
            "  watertight   no, {n} open edges, {:.3} % of the area missing",
            100.0 * report.open_area_fraction
        ),
    }
    match report.flipped_faces {
        0 => say!("  orientation  outwards"),
        n => say!("  orientation  outwards, after {n} faces were reversed"),
    }
}

fn print_size(report: &RepairReport, unit: LengthUnit) {
    let metre = unit.in_metres();
    let size = report.bounds.size() / metre;
    let low = report.bounds.min / metre;
    say!(
        "  volume       {:.6} {unit}³",
        report.volume / metre.powi(3)
    );
    say!("  area         {:.6} {unit}²", report.area / metre.powi(2));
    say!(
        "  bounds       {:.6} x {:.6} x {:.6} {unit}, from ({:.6}, {:.6}, {:.6})",
        size.x,
        size.y,
        size.z,
        low.x,
        low.y,
        low.z
    );
}

/// Share of the smaller part's volume up to which facets, or a press fit, may be all that overlaps.
pub(super) const FACETS: f64 = 2e-3;

/// Share up to which parts count as touching: what is shared then is rounding.
pub(super) const TOUCHING: f64 = 1e-6;

/// Interference of a fixed part and the moving one at the fit.
#[derive(Debug, Serialize)]
struct Fit {
    /// The scene that puts them there.
    scene: String,
    fixed: String,
    moving: String,
    /// Cubic metres.
    shared_volume: f64,
    /// Of the smaller part's volume.
    share: f64,
    /// How deep a point of either lies in the other at most, metres.
    depth: f64,
    /// Metres between their boxes along the axis on which they are farthest apart; 0 if they meet.
    apart: f64,
    /// What to do, if anything.
    next: Vec<String>,
}

/// Every pair of a scene; none if a mesh cannot be used: its own verdict says so.
fn fits_of(scene: &Scene) -> Vec<Fit> {
    let Ok(pairs) = scene.fit_solids() else {
        return Vec::new();
    };
    let path = scene.path.display().to_string();
    let fit = |pair: FitSolids| judge_fit(&pair, &scene.moving.name, &path);
    pairs.into_iter().map(fit).collect()
}

fn judge_fit(pair: &FitSolids, moving: &str, scene: &str) -> Fit {
    let (a, b) = (pair.fixed.bounds(), pair.moving.bounds());
    let gap = (a.min - b.max).max(b.min - a.max).max_element().max(0.0);
    let query = InterferenceQuery::new(&pair.fixed, &pair.moving);
    let Interference { volume, depth } = query.at(DQuat::IDENTITY, DVec3::ZERO);
    let share = volume / pair.fixed.volume().min(pair.moving.volume());
    let mut next: Vec<String> = pair.scale.iter().map(|w| w.to_string()).collect();
    if share > FACETS {
        next.push(format!(
            "they overlap by more than facets do: put them where they fit (position, rotation under \
             [moving], or [fit]); `pegfit plot overlap {scene} -o overlap.png` shows where"
        ));
        next.push(format!(
            "if the overlap is meant: `pegfit path {scene} --allow-overlap` says how deep it is"
        ));
    }
    if gap > 0.375 * b.diagonal() {
        next.push(
            "they are out of reach of each other: export both from one assembly, or put them where \
             they fit (position, rotation under [moving], or [fit])"
                .to_owned(),
        );
    }
    Fit {
        scene: scene.to_owned(),
        fixed: pair.name.clone(),
        moving: moving.to_owned(),
        shared_volume: volume,
        share,
        depth,
        apart: gap,
        next,
    }
}

/// For people.
fn print_fit(fit: &Fit) {
    let Fit { fixed, moving, .. } = fit;
    match (fit.share > TOUCHING, fit.apart > 0.0) {
        (true, _) => say!(
            "{moving} in {fixed}: they share {:.4} mm³, {:.3} % of the smaller, {:.4} mm deep",
            fit.shared_volume / 1e-9,
            100.0 * fit.share,
            1e3 * fit.depth
        ),
        (false, true) => {
            say!(
                "{moving} in {fixed}: {:.3} mm apart at the fit",
                1e3 * fit.apart
            )
        }
        (false, false) => say!("{moving} in {fixed}: they do not overlap"),
    }
    for next in &fit.next {
        say!("  next         {next}");
    }
}
