//! `pegfit dock`: where does the moving part belong?

use std::path::Path;

use fft_correlate::{DockingPose, DockingRequest, DockingResult, Placement, ScoreModel, from_fit};
use pegfit_scene::SceneSetup;
use pegfit_scene::poses::{POSE_COLUMNS, pose_fields};
use sdf_grid::atomic;
use serde::Serialize;

use super::scenes;

use crate::args::DockArgs;
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::{print_json, require_folder};
use crate::terminal::output::StandardOutput;
use crate::terminal::progress::interrupted;

/// More poses than anybody reads.
const MOST: usize = 100_000;

#[derive(Serialize)]
struct Summary {
    rotations: usize,
    /// By the sketch; all without one.
    rotations_chosen: usize,
    rotations_scored: usize,
    rotations_resumed: usize,
    displacements: usize,
    transform_size: [usize; 3],
    spacings: [f64; 2],
    docking_model: ScoreModel,
    stages: Vec<fft_correlate::dock::SearchStage>,
    seconds: f64,
    milliseconds_per_rotation: f64,
    poses: Vec<DockedPose>,
}

#[derive(Clone, Serialize)]
struct DockedPose {
    position: [f64; 3],
    rotation: [f64; 4],
    /// Under the docking weights, joules: the order of the list.
    energy: f64,
    /// Of the best pose's depth.
    depth: f64,
    /// Area of the moving part's faces that lie against opposite faces of the fixed one, square
    /// metres.
    mating_area: f64,
    /// Under the scene's model, joules.
    model_energy: f64,
    half_width: Option<f64>,
    /// The score as a share of what the smaller part would score in a perfect mould of itself, 0 to 1.
    quality: f64,
    /// Share of the moving part's volume that the fixed part fills as well.
    overlap: f64,
    /// How deep a point of either part lies in the other at most, metres.
    penetration: f64,
    refined: bool,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses only.
    condition: Option<f64>,
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
    ] {
        file.map_or(Ok(()), |f| require_folder(f))?;
    }
    let scene = scenes::read(&args.scene.file, args.scene.fixed.as_deref())?;
    let setup = scenes::setup(scene, context)?;
    let options = DockingRequest {
        top: args.top,
        exhaustive: args.exhaustive,
        state: args.state.clone(),
        mating_clearance: (args.mating_clearance).map(|c| c * setup.scene.unit.in_metres()),
        ..setup.docking_options()
    };
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
        true => Err(CommandError::Interrupted),
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
    if let Some(reason) = &report.undecided {
        remark!("poses of nearly equal depth are not looked at closer: {reason}");
    }
    if let Some(reason) = &report.averaged {
        remark!("poses are ranked by cell averages, without contact: {reason}");
    }
    Ok(report)
}

fn summary(report: &DockingResult, placement: &Placement) -> Summary {
    Summary {
        rotations: report.rotations,
        rotations_chosen: report.chosen,
        rotations_scored: report.scored,
        rotations_resumed: report.resumed,
        displacements: report.window.iter().product(),
        transform_size: report.transform_size,
        spacings: [report.lattices.coarse, report.lattices.fine],
        docking_model: report.model,
        stages: report.stages.clone(),
        seconds: report.seconds(),
        milliseconds_per_rotation: 1e3 * report.seconds_per_rotation,
        poses: report
            .poses
            .iter()
            .map(|pose| DockedPose::new(pose, placement))
            .collect(),
    }
}

impl DockedPose {
    fn new(pose: &DockingPose, placement: &Placement) -> Self {
        let found = &pose.found;
        let at = placement.to_scene(&found.pose);
        Self {
            position: at.translation.to_array(),
            rotation: at.rotation.to_array(),
            energy: found.energy,
            depth: pose.depth,
            mating_area: pose.mating_area,
            model_energy: pose.model_energy,
            half_width: found.half_width,
            quality: pose.quality,
            overlap: pose.overlap,
            penetration: pose.interference.depth,
            refined: found.refined,
            condition: pose.condition,
        }
    }
}

/// The poses in the scene that places the shapes so.
fn write(
    report: &DockingResult,
    placement: &Placement,
    out: impl std::io::Write,
) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    let more = [
        "energy",
        "depth",
        "mating_area",
        "model_energy",
        "half_width",
        "overlap",
        "refined",
        "condition",
        "quality",
        "penetration",
    ];
    rows.write_record(POSE_COLUMNS.iter().chain(&more))?;
    for pose in &report.poses {
        let found = &pose.found;
        let mut numbers = pose_fields(&placement.to_scene(&found.pose)).to_vec();
        let width = found.half_width.unwrap_or(f64::INFINITY);
        numbers.extend([found.energy, pose.depth, pose.mating_area]);
        numbers.extend([pose.model_energy, width, pose.overlap]);
        let mut row: Vec<String> = numbers.iter().map(f64::to_string).collect();
        row.push(found.refined.to_string());
        row.push(pose.condition.map_or(String::new(), |c| c.to_string()));
        row.extend([pose.quality, pose.interference.depth].map(|v| v.to_string()));
        rows.write_record(&row)?;
    }
    Ok(rows.flush()?)
}

fn print(setup: &SceneSetup, report: &DockingResult) {
    let sketch = report.stages.iter().find(|s| s.name == "sketch");
    if let Some(stage) = sketch {
        say!(
            "sketched {} rotations, {:.2} ms each: {} chosen",
            stage.items,
            1e3 * stage.seconds / stage.items as f64,
            report.chosen
        );
    }
    say!(
        "scored {} of {} rotations x {} displacements, {:.2} ms each; {:.2} s in all",
        report.scored,
        report.chosen,
        report.window.iter().product::<usize>(),
        1e3 * report.seconds_per_rotation,
        report.seconds()
    );
    let unit = setup.display_unit();
    let metre = unit.in_metres();
    say!(
        "  depth   quality   mating (mm²)   energy (mJ), docking and scene's   overlap, deep (mm)   \
         condition   from the fit ({unit}, degrees)"
    );
    for pose in report.poses.iter().take(10) {
        let (fit, pivot) = (&setup.parts.assembled, report.lattices.pivot);
        let (shift, turn) = from_fit(&pose.found.pose, fit, pivot, &report.symmetries);
        say!(
            "  {:>5.3}   {:>7.3}   {:>12.1}   {:>12.4}   {:>17.4}   {:>7.3}%  {:>8.4}   {:>9}   \
             {:>9.4}  {:>8.3}",
            pose.depth,
            pose.quality,
            1e6 * pose.mating_area,
            1e3 * pose.found.energy,
            1e3 * pose.model_energy,
            100.0 * pose.overlap,
            1e3 * pose.interference.depth,
            pose.condition.map_or("-".to_owned(), |c| format!("{c:.2}")),
            shift / metre,
            turn.to_degrees()
        );
    }
}
