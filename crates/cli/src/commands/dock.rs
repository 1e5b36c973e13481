//! `pegfit dock`: where does the moving part belong?

use std::path::Path;

use fft_correlate::{
    Condition, DirectEvaluator, DirectOptions, DockError, FoundPose, ScoreModel, SearchError,
    SearchLattices, SearchOptions, SearchPairs, SearchReport, TranslationWindow, wants_sketch,
};
use rayon::prelude::*;
use sdf_grid::Aabb;
use serde::Serialize;

use crate::context::Context;
use crate::report::output::{print_json, require_folder};
use crate::args::DockArgs;
use crate::scene::Assembly;
use crate::report::atomic;
use crate::error::CommandError;
use crate::memory;
use crate::report::poses::{POSE_COLUMNS, pose_fields};
use crate::terminal::progress::interrupted;
use crate::scene::Scene;
use super::dock_builder::{self as builder, Builder};

/// More poses than anybody reads.
const MOST: usize = 100_000;

/// How many of the best poses have the condition number of their score found, cell by cell.
const CONDITION_POSES: usize = 16;

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
    poses: Vec<Found>,
}

#[derive(Clone, Serialize)]
struct Found {
    position: [f64; 3],
    rotation: [f64; 4],
    /// Under the docking weights, joules: the order of the list.
    energy: f64,
    /// Of the best pose's depth.
    depth: f64,
    /// Under the scene's model, joules.
    model_energy: f64,
    half_width: Option<f64>,
    overlap: f64,
    refined: bool,
    /// The sum of the absolute terms of the score under the docking weights over the score: how far
    /// they cancel. Of the best poses only.
    condition: Option<f64>,
}

/// A search and what it was done on.
struct Searched {
    report: SearchReport,
    lattices: SearchLattices,
    poses: Vec<Found>,
}

pub(super) fn run(args: &DockArgs, context: &Context) -> Result<(), CommandError> {
    if args.top == 0 || args.top > MOST {
        let expected = format!("1 to {MOST}");
        return Err(CommandError::option("--top", expected, args.top));
    }
    let to_stdout = args.output == Path::new("-");
    for file in [
        (!to_stdout).then_some(&args.output),
        args.report.as_ref(),
        args.state.as_ref(),
    ] {
        file.map_or(Ok(()), |f| require_folder(f))?;
    }
    let scene = Scene::read(&args.scene)?.only(args.fixed.as_deref())?;
    let assembly = Assembly::load_on(scene, builder::choose_lattice, context)?;
    let how = How {
        top: args.top,
        exhaustive: args.exhaustive,
        state: args.state.as_deref(),
    };
    let found = look(&assembly, &how, context)?;
    if !to_stdout {
        atomic::write_with(&args.output, |out| {
            write(&found, out)
                .map_err(|e| CommandError::failure(args.output.display().to_string(), e))
        })?;
    }
    let summary = found.summary();
    if let Some(path) = &args.report {
        let text = serde_json::to_vec_pretty(&summary)
            .map_err(|e| CommandError::failure(path.display().to_string(), e))?;
        atomic::write(path, &text)?;
    }
    if context.json {
        print_json(&summary)?;
    } else if to_stdout {
        write(&found, std::io::stdout().lock())
            .map_err(|e| CommandError::failure("writing standard output", e))?;
    } else {
        say(&assembly, &found);
    }
    // What was scored before Ctrl-C has been written; the exit code says that it is not all.
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// The best poses of a scene, without a state file.
pub(super) fn search(
    assembly: &Assembly,
    top: usize,
    context: &Context,
) -> Result<SearchReport, CommandError> {
    let how = How {
        top,
        exhaustive: false,
        state: None,
    };
    Ok(look(assembly, &how, context)?.report)
}

/// What a search is asked for.
struct How<'a> {
    top: usize,
    exhaustive: bool,
    state: Option<&'a Path>,
}

/// Searches the scene's rotations and window, or everywhere if it names none.
fn look(assembly: &Assembly, how: &How, context: &Context) -> Result<Searched, CommandError> {
    let top = how.top;
    let builder = Builder::new(assembly, context)?;
    let lattices = builder.lattices;
    let domain = builder.domain()?;
    let [sketch, coarse, fine] = builder.plans()?;
    let sketch = (!how.exhaustive && wants_sketch(domain.rotations.len())).then_some(sketch);
    let sketch = sketch.map(|plan| builder.build(&plan)).transpose()?;
    let (coarse, mut finest) = (builder.build(&coarse)?, builder.build(&fine)?);
    require_memory(assembly, &lattices, &domain.places, context)?;
    let options = SearchOptions {
        top,
        coarse_poses: (10 * top).max(100),
        fine_poses: (3 * top / 2).max(16),
        ..SearchOptions::default()
    };
    let progress = &context.progress;
    let pairs = SearchPairs {
        sketch: sketch.as_ref(),
        coarse: &coarse,
        fine: &finest,
    };
    let found = fft_correlate::search(&pairs, &domain, &options, how.state, progress);
    let mut report = found.map_err(|e| match e {
        SearchError::Dock(DockError::Cancelled) => CommandError::Interrupted,
        other => builder.bad(other),
    })?;
    if report.close() > 1
        && !interrupted()
        && let Some(finer) = builder.deciding()?
    {
        fft_correlate::decide(&mut report, &finer, &domain, &options, progress)
            .map_err(|e| builder.bad(e))?;
        finest = finer;
    }
    context.progress.finish();
    let weights = assembly.context("docking weights");
    finest = finest
        .with_model(report.model)
        .map_err(|e| CommandError::bad_input(weights, e))?;
    let conditions: Vec<f64> = report
        .poses
        .par_iter()
        .take(CONDITION_POSES)
        .map(|p| Condition::at(&finest, &p.pose).number())
        .collect();
    let finest = finest
        .with_model(*assembly.pair.model())
        .map_err(|e| CommandError::bad_input(assembly.context("model"), e))?;
    let source = DirectEvaluator::new(&finest, &DirectOptions::FULL).map_err(|e| builder.bad(e))?;
    let energies: Vec<f64> = report
        .poses
        .iter()
        .map(|p| source.evaluate_full(&p.pose).response.energy)
        .collect();
    // From here on in the fixed part's own frame.
    for p in &mut report.poses {
        p.pose = builder.own(&p.pose);
    }
    let deepest = report.poses.iter().map(|p| p.energy).fold(0.0, f64::min);
    let told = |(index, p): (usize, &FoundPose)| Found {
        position: p.pose.translation.to_array(),
        rotation: p.pose.rotation.to_array(),
        energy: p.energy,
        depth: if deepest < 0.0 {
            p.energy / deepest
        } else {
            0.0
        },
        model_energy: energies[index],
        half_width: p.half_width,
        overlap: p.overlap,
        refined: p.refined,
        condition: conditions.get(index).copied(),
    };
    Ok(Searched {
        poses: report.poses.iter().enumerate().map(told).collect(),
        report,
        lattices,
    })
}

/// Refuses a window whose correlation would not fit in memory: transforms cover the window and the
/// moving part; one field per product and a work space per thread, 8 bytes per point, lengths
/// rounded up by at most a tenth.
fn require_memory(
    assembly: &Assembly,
    lattices: &SearchLattices,
    places: &Aabb,
    context: &Context,
) -> Result<(), CommandError> {
    let window = TranslationWindow::new(
        places.min - lattices.pivot,
        places.max - lattices.pivot,
        lattices.coarse,
    )
    .map_err(|e| CommandError::bad_input(assembly.context("window"), e))?;
    let moving = 2.0 * (lattices.radius + lattices.halo) / lattices.coarse + 2.0;
    let lengths = window.shape().map(|w| 1.1 * (w as f64 + moving));
    let fields = 2.0 + 2.0 * rayon::current_num_threads() as f64;
    let bytes = 8.0 * lengths.iter().product::<f64>() * fields;
    let what = assembly.context("the correlation");
    memory::require(&what, bytes as u64, context.memory)
}

impl Searched {
    fn summary(&self) -> Summary {
        let report = &self.report;
        Summary {
            rotations: report.rotations,
            rotations_chosen: report.chosen,
            rotations_scored: report.scored,
            rotations_resumed: report.resumed,
            displacements: report.window.iter().product(),
            transform_size: report.transform_size,
            spacings: [self.lattices.coarse, self.lattices.fine],
            docking_model: report.model,
            stages: report.stages.clone(),
            seconds: report.seconds(),
            milliseconds_per_rotation: 1e3 * report.seconds_per_rotation(),
            poses: self.poses.clone(),
        }
    }
}

fn write(found: &Searched, out: impl std::io::Write) -> csv::Result<()> {
    let mut rows = csv::Writer::from_writer(out);
    let more = [
        "energy",
        "depth",
        "model_energy",
        "half_width",
        "overlap",
        "refined",
        "condition",
    ];
    rows.write_record(POSE_COLUMNS.iter().chain(&more))?;
    for (pose, told) in found.report.poses.iter().zip(&found.poses) {
        for value in pose_fields(&pose.pose) {
            rows.write_field(value.to_string())?;
        }
        let width = told.half_width.unwrap_or(f64::INFINITY);
        for value in [
            told.energy,
            told.depth,
            told.model_energy,
            width,
            told.overlap,
        ] {
            rows.write_field(value.to_string())?;
        }
        rows.write_field(told.refined.to_string())?;
        rows.write_field(told.condition.map_or(String::new(), |c| c.to_string()))?;
        rows.write_record(None::<&[u8]>)?;
    }
    Ok(rows.flush()?)
}

fn say(assembly: &Assembly, found: &Searched) {
    let report = &found.report;
    let sketch = report.stages.iter().find(|s| s.name == "sketch");
    if let Some(stage) = sketch {
        crate::say!(
            "sketched {} rotations, {:.2} ms each: {} chosen",
            stage.items,
            1e3 * stage.seconds / stage.items as f64,
            report.chosen
        );
    }
    crate::say!(
        "scored {} of {} rotations x {} displacements, {:.2} ms each; {:.2} s in all",
        report.scored,
        report.chosen,
        report.window.iter().product::<usize>(),
        1e3 * report.seconds_per_rotation(),
        report.seconds()
    );
    let unit = assembly.display_unit();
    let metre = unit.in_metres();
    crate::say!(
        "  depth   energy (mJ), docking and scene's   overlap   condition   from the fit ({unit}, degrees)"
    );
    for (pose, told) in report.poses.iter().zip(&found.poses).take(10) {
        let (shift, turn) = assembly.from_fit(&pose.pose);
        crate::say!(
            "  {:>5.3}   {:>12.4}   {:>17.4}   {:>6.1}%   {:>9}   {:>9.4}  {:>8.3}",
            told.depth,
            1e3 * told.energy,
            1e3 * told.model_energy,
            100.0 * told.overlap,
            told.condition.map_or("-".to_owned(), |c| format!("{c:.2}")),
            shift / metre,
            turn.to_degrees()
        );
    }
}
