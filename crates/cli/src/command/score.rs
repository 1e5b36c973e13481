//! `pegfit score`: score, energy, force and torque at listed poses.

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

use fft_correlate::{DirectEvaluator, DirectOptions, EnergySource, EnergyTable, Pose};
use rayon::prelude::*;

use super::{Context, bake, require_folder};
use crate::args::ScoreArgs;
use crate::assembly::Assembly;
use crate::atomic;
use crate::error::CommandError;
use crate::poses::{PoseReader, ScoreWriter, ScoredPose};
use crate::progress::check_interrupt;
use crate::scene::Scene;

/// Rows evaluated together.
const CHUNK: usize = 1024;

pub(super) fn run(args: &ScoreArgs, context: &Context) -> Result<(), CommandError> {
    let to_stdout = args.output == Path::new("-");
    if !to_stdout {
        require_folder(&args.output)?;
    }
    let poses = open(&args.poses)?;
    let scorer = Scorer::new(args, context)?;
    if to_stdout {
        return stream(
            poses,
            &scorer,
            &mut std::io::stdout().lock(),
            "standard output",
        );
    }
    let name = args.output.display().to_string();
    atomic::write_with(&args.output, |out| stream(poses, &scorer, out, &name))
}

fn open(path: &Path) -> Result<PoseReader<Box<dyn Read>>, CommandError> {
    if path == Path::new("-") {
        return PoseReader::new("standard input", Box::new(std::io::stdin()));
    }
    let file = File::open(path).map_err(|e| CommandError::read(path, e))?;
    PoseReader::new(&path.display().to_string(), Box::new(file))
}

/// Reads, evaluates and writes chunk by chunk, in order.
fn stream(
    mut poses: PoseReader<Box<dyn Read>>,
    scorer: &Scorer,
    out: &mut dyn Write,
    name: &str,
) -> Result<(), CommandError> {
    let failed = |e: csv::Error| CommandError::failure(format!("writing {name}"), e);
    let mut writer = ScoreWriter::new(out).map_err(failed)?;
    loop {
        check_interrupt()?;
        let chunk: Vec<Pose> = poses.by_ref().take(CHUNK).collect::<Result<_, _>>()?;
        if chunk.is_empty() {
            break;
        }
        for scored in scorer.score(&chunk) {
            match writer.write(&scored) {
                Err(e) if nobody_reads(&e) => return Ok(()),
                other => other.map_err(failed)?,
            }
        }
    }
    match writer.flush().map_err(csv::Error::from) {
        Err(e) if nobody_reads(&e) => Ok(()),
        other => other.map_err(failed),
    }
}

/// True if the other end of a pipe was closed, as by `head`: no reason to complain.
fn nobody_reads(error: &csv::Error) -> bool {
    matches!(error.kind(), csv::ErrorKind::Io(e) if e.kind() == std::io::ErrorKind::BrokenPipe)
}

/// Where scores come from.
enum Scorer {
    Direct(Box<DirectEvaluator>),
    Table(Box<EnergyTable>),
}

impl Scorer {
    fn new(args: &ScoreArgs, context: &Context) -> Result<Self, CommandError> {
        match (&args.scene, &args.table) {
            (Some(scene), _) => {
                let scene = Scene::read(scene)?.only(args.fixed.as_deref())?;
                let assembly = Assembly::load(scene, context)?;
                let evaluator = assembly.direct(&DirectOptions::FULL)?;
                Ok(Self::Direct(Box::new(evaluator)))
            }
            (None, Some(table)) => {
                let table = bake::load(&bake::open(table)?, context)?;
                Ok(Self::Table(Box::new(table)))
            }
            (None, None) => Err(CommandError::option(
                "--scene, --table",
                "one of them",
                "none",
            )),
        }
    }

    fn score(&self, poses: &[Pose]) -> Vec<ScoredPose> {
        match self {
            Self::Direct(evaluator) => poses
                .par_iter()
                .map(|pose| {
                    let full = evaluator.evaluate_full(pose);
                    ScoredPose {
                        pose: *pose,
                        score_re: full.score.re,
                        score_im: Some(full.score.im),
                        response: full.response,
                    }
                })
                .collect(),
            Self::Table(table) => {
                let gamma = table.spec().model.gamma;
                poses
                    .par_iter()
                    .map_init(
                        || table.scratch(),
                        |scratch, pose| {
                            let response = table.evaluate(pose, scratch);
                            ScoredPose {
                                pose: *pose,
                                score_re: -response.energy / gamma,
                                score_im: None,
                                response,
                            }
                        },
                    )
                    .collect()
            }
        }
    }
}
