//! `pegfit score`: score, energy, force and torque at listed poses.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};

use fft_correlate::{
    Condition, DirectEvaluator, DirectOptions, EnergyTable, Pair, Placement, Pose, Response,
};
use pegfit_scene::poses::{PoseError, PoseReader, ScoredPose, append_score, score_header};
use pegfit_scene::{Scene, SceneSetup};
use rayon::prelude::*;
use sdf_grid::atomic;

use super::{scenes, stored, tolerance};
use crate::args::ScoreArgs;
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::require_folder;
use crate::terminal::output::StandardOutput;
use crate::terminal::progress::check_interrupt;

/// Rows read before any of them is evaluated.
const CHUNK: usize = 16384;

/// Chunks of poses, read ahead by a thread of their own.
type Chunks = Receiver<Result<Vec<Pose>, PoseError>>;

pub(super) fn run(args: &ScoreArgs, context: &Context) -> Result<(), CommandError> {
    let to_stdout = args.output == Path::new("-");
    if !to_stdout {
        require_folder(&args.output)?;
    }
    let poses = read_ahead(open(&args.poses)?);
    // The first of them tell what a tolerance asks for; the others follow.
    let first = poses.recv().unwrap_or_else(|_| Ok(Vec::new()))?;
    let scorer = Scorer::new(args, &first, context)?;
    let mut poses = std::iter::once(Ok(first)).chain(poses);
    if to_stdout {
        return stream(&mut poses, &scorer, &mut StandardOutput, None);
    }
    let name = args.output.display().to_string();
    atomic::write_with(&args.output, |out| {
        stream(&mut poses, &scorer, out, Some(&name))
    })
}

type AnyReader = PoseReader<Box<dyn Read + Send>>;

fn open(path: &Path) -> Result<AnyReader, CommandError> {
    let (name, input): (String, Box<dyn Read + Send>) = match path == Path::new("-") {
        true => ("standard input".to_owned(), Box::new(std::io::stdin())),
        false => {
            let file = File::open(path).map_err(|e| CommandError::read(path, e))?;
            (path.display().to_string(), Box::new(file))
        }
    };
    Ok(PoseReader::new(&name, input)?)
}

/// Reads in a thread of its own, which ends with the input or when nobody takes its chunks.
fn read_ahead(mut poses: AnyReader) -> Chunks {
    let (sender, chunks) = sync_channel(2);
    std::thread::spawn(move || {
        loop {
            let chunk: Result<Vec<Pose>, _> = poses.by_ref().take(CHUNK).collect();
            let last = chunk.as_ref().map_or(true, Vec::is_empty);
            if sender.send(chunk).is_err() || last {
                return;
            }
        }
    });
    chunks
}

/// Evaluates and writes chunk by chunk, in order. Writes that standard output,
/// which has no name, refuses are reported at the end of the run.
fn stream(
    poses: &mut dyn Iterator<Item = Result<Vec<Pose>, PoseError>>,
    scorer: &Scorer,
    out: &mut dyn Write,
    name: Option<&str>,
) -> Result<(), CommandError> {
    let mut write = |text: &str| match (out.write_all(text.as_bytes()), name) {
        (Ok(()), _) => Ok(true),
        (Err(e), Some(name)) => Err(CommandError::write(name.as_ref(), e)),
        (Err(_), None) => Ok(false),
    };
    if !write(&score_header(scorer.condition))? {
        return Ok(());
    }
    let mut first = 0;
    for chunk in poses {
        check_interrupt()?;
        let (chunk, size) = (chunk?, scorer.piece());
        let pieces = chunk.par_chunks(size).enumerate();
        let pieces: Vec<String> = pieces
            .map(|(i, piece)| scorer.rows(first + i * size, piece))
            .collect();
        first += chunk.len();
        for text in pieces {
            if !write(&text)? {
                return Ok(());
            }
        }
    }
    match (out.flush(), name) {
        (Err(e), Some(name)) => Err(CommandError::write(name.as_ref(), e)),
        _ => Ok(()),
    }
}

/// Where scores come from, and what their condition is found from if it is asked for.
struct Scorer {
    /// Of the shapes.
    source: Source,
    /// Poses are those of the scene that puts the shapes there.
    placement: Placement,
    /// Whether condition numbers are asked for.
    condition: bool,
}

enum Source {
    Direct(DirectSources),
    Table(Box<EnergyTable>),
}

/// Evaluators, with their pairs where condition numbers are asked for.
struct DirectSources {
    sources: Vec<(DirectEvaluator, Option<Pair>)>,
    /// Which of them answers each pose, in the order of the poses; the only one if empty.
    of_pose: Vec<usize>,
}

impl DirectSources {
    fn one(evaluator: DirectEvaluator, pair: Option<Pair>) -> Self {
        Self {
            sources: vec![(evaluator, pair)],
            of_pose: Vec::new(),
        }
    }

    /// The source of the pose with an index.
    fn of(&self, index: usize) -> &(DirectEvaluator, Option<Pair>) {
        &self.sources[self.of_pose.get(index).copied().unwrap_or(0)]
    }
}

impl Scorer {
    /// For `poses` and more like them.
    fn new(args: &ScoreArgs, poses: &[Pose], context: &Context) -> Result<Self, CommandError> {
        match (&args.scene, &args.table) {
            (Some(scene), _) => {
                let scene = scenes::read(scene, args.fixed.as_deref())?;
                if let Some(tolerance) = args.tolerance {
                    return Self::tolerant(args, scene, (poses, tolerance), context);
                }
                let setup = scenes::setup(scene, context)?;
                let placement = *setup.placement();
                let shapes: Vec<Pose> = poses.iter().map(|p| placement.to_shapes(p)).collect();
                Ok(Self {
                    source: Source::Direct(direct(&setup, &shapes, args.condition, context)?),
                    placement,
                    condition: args.condition,
                })
            }
            (None, Some(table)) => {
                let table = stored::load(&stored::open(table)?, context)?;
                Ok(Self {
                    placement: table.spec().placement,
                    source: Source::Table(Box::new(table)),
                    condition: false,
                })
            }
            (None, None) => refuse("--scene, --table", "one of them", "none"),
        }
    }

    /// On a lattice as coarse as the tolerance allows at some poses.
    fn tolerant(
        args: &ScoreArgs,
        scene: Scene,
        (poses, tolerance): (&[Pose], f64),
        context: &Context,
    ) -> Result<Self, CommandError> {
        let setup = scenes::setup(scene, context)?;
        let placement = *setup.placement();
        let shapes: Vec<Pose> = poses.iter().map(|p| placement.to_shapes(p)).collect();
        let found = tolerance::choose_direct(&setup, &shapes, tolerance, context)?;
        context.progress.note(&format!(
            "error {:.3} %, as a lattice of {:.4} mm tells",
            100.0 * found.error,
            1e3 * found.reference_spacing
        ));
        let setup = SceneSetup {
            parts: found.setup,
            ..setup
        };
        Ok(Self {
            source: Source::Direct(direct(&setup, &shapes, args.condition, context)?),
            placement,
            condition: args.condition,
        })
    }

    /// Rows that one thread evaluates at a time.
    fn piece(&self) -> usize {
        match self.source {
            Source::Direct(_) => 4,
            Source::Table(_) => 512,
        }
    }

    /// Poses, the first of which has an index, and their scores as rows of text.
    fn rows(&self, first: usize, poses: &[Pose]) -> String {
        let mut text = String::with_capacity(300 * poses.len());
        let shapes: Vec<Pose> = poses.iter().map(|p| self.placement.to_shapes(p)).collect();
        let mut append = |at: usize, pair: Option<&Pair>, score: (f64, _), response: Response| {
            let (pose, (score_re, score_im)) = (poses[at], score);
            let wrench = self.placement.wrench_to_scene(&pose, &response.wrench);
            let scored = ScoredPose {
                pose,
                score_re,
                score_im,
                response: Response { wrench, ..response },
                condition: pair.map(|pair| Condition::at(pair, &shapes[at]).number()),
            };
            append_score(&mut text, &scored);
        };
        match &self.source {
            Source::Direct(direct) => {
                for (at, pose) in shapes.iter().enumerate() {
                    let (evaluator, pair) = direct.of(first + at);
                    let full = evaluator.evaluate_full(pose);
                    let score = (full.score.re, Some(full.score.im));
                    append(at, pair.as_ref(), score, full.response);
                }
            }
            Source::Table(table) => {
                let gamma = table.spec().model().gamma;
                let mut responses = vec![Response::default(); poses.len()];
                table.respond_each(&shapes, &mut responses);
                for (at, response) in responses.into_iter().enumerate() {
                    append(at, None, (-response.energy / gamma, None), response);
                }
            }
        }
        text
    }
}

/// Evaluators for poses of the shapes and more like them: of what these reach if they are all, else of
/// the whole pair.
fn direct(
    setup: &SceneSetup,
    shapes: &[Pose],
    condition: bool,
    context: &Context,
) -> Result<DirectSources, CommandError> {
    if shapes.len() == CHUNK {
        let pair = setup.pair(&context.progress)?;
        context.progress.finish();
        let evaluator = setup.direct(&pair, &DirectOptions::FULL)?;
        return Ok(DirectSources::one(evaluator, condition.then_some(pair)));
    }
    let mut direct = DirectSources {
        sources: Vec::new(),
        of_pose: vec![0; shapes.len()],
    };
    for (pair, indices) in setup.pairs_at(shapes, &context.progress)? {
        for index in indices {
            direct.of_pose[index] = direct.sources.len();
        }
        let evaluator = setup.direct(&pair, &DirectOptions::FULL)?;
        direct.sources.push((evaluator, condition.then_some(pair)));
    }
    context.progress.finish();
    Ok(direct)
}
