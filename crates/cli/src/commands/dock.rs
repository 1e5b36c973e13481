//! `pegfit dock`: where does the moving part belong?

use std::path::Path;
use std::sync::Arc;

use fft_correlate::dock::Ranking;
use fft_correlate::mating::{Joint, JointKind};
use fft_correlate::{
    DockingPose, DockingRequest, DockingResult, FieldNodes, Placement, ScoreModel, from_fit,
};
use glam::DVec3;
use pegfit_scene::SceneSetup;
use pegfit_scene::poses::{POSE_COLUMNS, pose_fields};
use sdf_grid::{RepairOptions, atomic, mesh_io};
use serde::Serialize;

use super::dock_export::write_exports;
use super::docked_pose::DockedPose;
use super::scenes::{self, parse_pose};

use crate::args::{DockArgs, RankChoice};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::{print_json, require_folder};
use crate::terminal::output::StandardOutput;
use crate::terminal::progress::interrupted;

/// More poses than anybody reads.
const MOST: usize = 100_000;

#[derive(Serialize)]
struct Summary {
    /// `contact` or `energy`.
    ranked_by: &'static str,
    /// Of a search by energy; none without one.
    #[serde(flatten)]
    energy_search: Option<EnergySummary>,
    /// Of the lattice whose energies are reported, metres.
    energy_spacing: Option<f64>,
    /// Nodes of that lattice: computed, since in reach of the poses, and in all.
    energy_nodes: Option<FieldNodes>,
    stages: Vec<fft_correlate::dock::SearchStage>,
    field_seconds: f64,
    seconds: f64,
    poses: Vec<DockedPose>,
}

#[derive(Serialize)]
struct EnergySummary {
    rotations: usize,
    /// By the sketch; all without one.
    rotations_chosen: usize,
    rotations_scored: usize,
    rotations_resumed: usize,
    displacements: usize,
    transform_size: [usize; 3],
    spacings: [f64; 2],
    docking_model: ScoreModel,
    milliseconds_per_rotation: f64,
}

pub(super) fn run(args: &DockArgs, context: &Context) -> Result<(), CommandError> {
    if args.top == 0 || args.top > MOST {
        let expected = format!("1 to {MOST}");
        return refuse("--top", expected, args.top);
    }
    let to_stdout = args.output == Path::new("-");
    for file in [
        (!to_stdout).then_some(&args.output),
        args.report.as_ref(),
        args.state.as_ref(),
        args.urdf.as_ref(),
        args.mjcf.as_ref(),
        args.mates.as_ref(),
    ] {
        file.map_or(Ok(()), |f| require_folder(f))?;
    }
    let scene = scenes::read(&args.scene.file, args.scene.fixed.as_deref())?;
    let setup = scenes::setup(scene, context)?;
    let options = request(args, &setup)?;
    let found = find_poses(&setup, options, context)?;
    if !to_stdout {
        atomic::write_with(&args.output, |out| {
            write(&found, setup.placement(), out)
                .map_err(|e| CommandError::failure(args.output.display().to_string(), e))
        })?;
    }
    let summary = summary(&found, setup.placement());
    if let Some(path) = &args.report {
        let text = serde_json::to_vec_pretty(&summary)
            .map_err(|e| CommandError::failure(path.display().to_string(), e))?;
        atomic::write(path, &text)?;
    }
    if let Some(best) = found.poses.first() {
        write_exports(args, &setup, best)?;
    }
    if context.json {
        print_json(&summary)?;
    } else if to_stdout {
        // Refused writes are reported at the end.
        let _ = write(&found, setup.placement(), StandardOutput);
    } else {
        print(&setup, &found);
    }
    // What was scored before Ctrl-C has been written; the exit code says that it is not all.
    match interrupted() {
        true => Err(CommandError::stopped("the poses found so far are written")),
        false => Ok(()),
    }
}

/// Docks the parts of a scene; the poses found are those of the shapes.
pub(super) fn find_poses(
    setup: &SceneSetup,
    options: DockingRequest,
    context: &Context,
) -> Result<DockingResult, CommandError> {
    let found = setup.dock(options, &context.progress);
    context.progress.finish();
    let report = found?;
    if let Some(search) = &report.energy_search {
        if let Some(reason) = &search.undecided {
            remark!("poses of nearly equal depth are not looked at closer: {reason}");
        }
        if let Some(reason) = &search.averaged {
            remark!("energies are of cell averages, without contact: {reason}");
        }
    }
    if let Some(reason) = &report.no_energies {
        remark!("no energies: {reason}");
    }
    Ok(report)
}

/// Lengths become metres, poses those of the shapes.
fn request(args: &DockArgs, setup: &SceneSetup) -> Result<DockingRequest, CommandError> {
    let placement = setup.placement();
    let near = match &args.near {
        Some(text) => {
            let pose = parse_pose("--near", "a pose", text)?;
            let distance = 0.25 * setup.parts.moving.bounds().diagonal();
            Some((placement.to_shapes(&pose), distance, 30f64.to_radians()))
        }
        None => None,
    };
    let axis = match &args.axis {
        Some(text) => {
            let (point, direction) = parse_axis(text)?;
            let back = placement.fixed.inverse();
            Some((back.apply(point), back.rotation * direction))
        }
        None => None,
    };
    let back = placement.fixed.inverse();
    let mut others = Vec::new();
    for path in &args.keep_apart {
        let options = RepairOptions::default();
        let (mesh, report) = mesh_io::read(path, setup.scene.unit, &options)?;
        for warning in report.warnings() {
            remark!("{warning}");
        }
        others.push(Arc::new(mesh.transformed(back.rotation, back.translation)));
    }
    Ok(DockingRequest {
        top: args.top,
        exhaustive: args.exhaustive,
        state: args.state.clone(),
        mating_clearance: (args.mating_clearance).map(|c| c * setup.scene.unit.in_metres()),
        ranking: match args.rank {
            RankChoice::Contact => Ranking::Contact,
            RankChoice::Energy => Ranking::Energy,
        },
        near,
        axis,
        others,
        ..setup.docking_options()
    })
}

/// A point, metres, and a direction.
fn parse_axis(text: &str) -> Result<(DVec3, DVec3), CommandError> {
    let numbers: Vec<f64> = text
        .split(',')
        .filter_map(|t| t.trim().parse().ok())
        .collect();
    match numbers[..] {
        [px, py, pz, dx, dy, dz] if numbers.iter().all(|v| v.is_finite()) => {
            let direction = DVec3::new(dx, dy, dz).try_normalize();
            direction.map(|d| (DVec3::new(px, py, pz), d))
        }
        _ => None,
    }
    .ok_or_else(|| {
        let expected = "px,py,pz,dx,dy,dz: a point in metres and a direction";
        CommandError::option("--axis", expected, text)
    })
}

fn summary(report: &DockingResult, placement: &Placement) -> Summary {
    let search = report.energy_search.as_ref();
    Summary {
        ranked_by: ranked_by(report.ranking),
        energy_search: search.map(|s| EnergySummary {
            rotations: s.rotations,
            rotations_chosen: s.chosen,
            rotations_scored: s.scored,
            rotations_resumed: s.resumed,
            displacements: s.window.iter().product(),
            transform_size: s.transform_size,
            spacings: [report.lattices.coarse, report.lattices.fine],
            docking_model: s.model,
            milliseconds_per_rotation: 1e3 * s.seconds_per_rotation,
        }),
        energy_spacing: report.energy_spacing,
        energy_nodes: report.energy_nodes,
        stages: report.stages.clone(),
        field_seconds: report.field_seconds,
        seconds: report.seconds(),
        poses: (report.poses.iter())
            .map(|pose| DockedPose::new(pose, placement))
            .collect(),
    }
}

/// How much of the lattices was computed, where that is not all.
fn in_reach(nodes: FieldNodes) -> String {
    match nodes {
        FieldNodes { computed, whole } if computed < whole => {
            format!(" ({computed} of {whole} nodes are in reach)")
        }
        _ => String::new(),
    }
}

fn ranked_by(ranking: Ranking) -> &'static str {
    match ranking {
        Ranking::Contact => "contact",
        Ranking::Energy => "energy",
    }
}

/// Columns behind those of the pose.
const COLUMNS: [&str; 29] = [
    "hold",
    "information",
    "mating_area",
    "mating_share",
    "escape",
    "overlap",
    "penetration",
    "quality",
    "energy",
    "model_energy",
    "alike",
    "joint",
    "freedoms",
    "axis_x",
    "axis_y",
    "axis_z",
    "point_x",
    "point_y",
    "point_z",
    "pitch",
    "slide_low",
    "slide_high",
    "turn_low",
    "turn_high",
    "moving_axis",
    "moving_point",
    "half_width",
    "refined",
    "condition",
];

/// The poses in the scene that places the shapes so; what is not known or does not apply is empty.
fn write(
    report: &DockingResult,
    placement: &Placement,
    out: impl std::io::Write,
) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    rows.write_record(POSE_COLUMNS.iter().chain(&COLUMNS))?;
    for pose in &report.poses {
        let docked = DockedPose::new(pose, placement);
        let joint = &docked.joint;
        let at = placement.to_scene(&pose.found.pose);
        let number = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
        let three = |v: Option<[f64; 3]>| [0, 1, 2].map(|k| number(v.map(|v| v[k])));
        let joined =
            |v: Option<[f64; 3]>| v.map_or(String::new(), |v| v.map(|x| x.to_string()).join(" "));
        let two = |v: Option<[f64; 2]>| [0, 1].map(|k| number(v.map(|v| v[k])));
        let mut row: Vec<String> = pose_fields(&at).iter().map(f64::to_string).collect();
        let numbers = [
            docked.hold,
            docked.information,
            docked.mating_area,
            docked.mating_share,
            docked.escape,
            docked.overlap,
            docked.penetration,
        ];
        row.extend(numbers.map(|v| v.to_string()));
        row.extend([docked.quality, docked.energy, docked.model_energy].map(number));
        row.push(docked.alike.len().to_string());
        row.push(joint.kind.to_string());
        row.push(joint.freedoms.to_string());
        row.extend(three(joint.axis));
        row.extend(three(joint.point));
        row.push(number(joint.pitch));
        row.extend(two(joint.slide));
        row.extend(two(joint.turn));
        row.extend([joined(joint.moving_axis), joined(joint.moving_point)]);
        row.push(number(docked.half_width));
        row.push(docked.refined.to_string());
        row.push(number(docked.condition));
        rows.write_record(&row)?;
    }
    Ok(rows.flush()?)
}

fn print(setup: &SceneSetup, report: &DockingResult) {
    if let Some(search) = &report.energy_search {
        say!(
            "scored {} of {} rotations x {} displacements, {:.2} ms each",
            search.scored,
            search.rotations,
            search.window.iter().product::<usize>(),
            1e3 * search.seconds_per_rotation,
        );
    }
    say!(
        "ranked by {}; {:.1} s, of which {:.1} s for fields{}",
        ranked_by(report.ranking),
        report.seconds() + report.field_seconds,
        report.field_seconds,
        report.energy_nodes.map_or(String::new(), in_reach)
    );
    let unit = setup.display_unit();
    let metre = unit.in_metres();
    say!(
        "   hold   information   mating (mm², %)   overlap   quality   energy (mJ)   places   \
         from the fit ({unit}, degrees)   joint"
    );
    for pose in report.poses.iter().take(10) {
        let (fit, pivot) = (&setup.parts.assembled, report.lattices.pivot);
        let (shift, turn) = from_fit(&pose.found.pose, fit, pivot, &report.symmetries);
        let known = |v: f64, digits: usize| match v.is_finite() {
            true => format!("{v:.digits$}"),
            false => "-".to_owned(),
        };
        say!(
            "  {:>5.1}   {:>11.1}   {:>9.1}  {:>4.1}   {:>6.3}%   {:>7}   {:>11}   {:>6}   {:>12.4}  \
             {:>8.3}   {}",
            pose.rank,
            pose.hold.information,
            1e6 * pose.mating_area,
            100.0 * pose.hold.share,
            100.0 * pose.overlap,
            known(pose.quality, 3),
            known(1e3 * pose.model_energy, 4),
            1 + pose.alike.len(),
            shift / metre,
            turn.to_degrees(),
            describe(&pose.joint, metre, unit.name())
        );
    }
    if let Some(best) = report.poses.first() {
        say!("{}", conclusion(best));
    }
}

/// A joint in a few words.
fn describe(joint: &Joint, metre: f64, unit: &str) -> String {
    let mut text = joint.kind.name().to_owned();
    if let Some(slide) = joint.slide {
        let [low, high] = slide.range.map(|v| v / metre);
        text += &format!(", {low:.3} to {high:.3} {unit}");
    }
    if joint.kind == JointKind::Screw {
        text += &format!(", {:.3} {unit} a turn", joint.pitch / metre);
    }
    if let Some(turn) = joint.turn {
        let [low, high] = turn.range.map(f64::to_degrees);
        text += &format!(", {low:.0} to {high:.0} degrees");
    }
    text
}

/// What contact says about the best pose.
fn conclusion(best: &DockingPose) -> String {
    let free = best.joint.kind.freedoms();
    match best.joint.kind {
        JointKind::Undetermined(_) => format!(
            "Contact does not determine this pair: {free} motions are free; the poses are some of many."
        ),
        JointKind::Planar => "Contact does not determine this pair: the part slides on a plane; \
             the poses are some of many."
            .to_owned(),
        kind => format!("Contact holds the part as a {} joint does.", kind.name()),
    }
}
