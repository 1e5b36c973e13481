//! `pegfit feel`: the haptic loop.

use std::path::Path;

use fft_correlate::{DirectOptions, EnergySource};
use haptic::{Clock, LoopReport, Outcome, Sample, Script, read_log};

use super::plot::force_chart;
use super::{Context, bake, devices, hand, print_json, require_folder};
use crate::args::{FeelArgs, ScriptChoice};
use crate::assembly::Assembly;
use crate::error::CommandError;
use crate::progress::interrupted;
use crate::scene::Scene;
use crate::{atomic, picture};

pub(super) fn run(args: &FeelArgs, context: &Context) -> Result<(), CommandError> {
    if !(args.seconds.is_finite() && args.seconds > 0.0) {
        return Err(CommandError::option(
            "--seconds",
            "a positive number",
            args.seconds,
        ));
    }
    for output in [&args.log, &args.png].into_iter().flatten() {
        require_folder(output)?;
    }
    let script = match args.script {
        ScriptChoice::Collision => Script::Collision,
        ScriptChoice::Snap => Script::Snap,
        ScriptChoice::Free => Script::Free,
    };
    let assembly = Assembly::load(Scene::read(&args.scene)?, context)?;
    let source = source(args, &assembly, context)?;
    let mut device = match devices::choose(&args.device, context)? {
        Some(device) => device,
        None => Box::new(hand::simulated(
            &assembly,
            source.as_ref(),
            script,
            args.seconds,
        )),
    };
    context.progress.note(&format!(
        "the {} holds {} for {} s",
        device.spec().name,
        assembly.scene.moving.name,
        args.seconds
    ));
    let outcome = hand::run(
        &assembly,
        source.as_ref(),
        device.as_mut(),
        args.seconds,
        Clock::Real,
        args.log.as_deref(),
    )?;
    if let Some(path) = &args.png {
        draw(path, args.log.as_deref(), &outcome, script)?;
    }
    if context.json {
        print_json(&outcome.report)?;
    } else {
        print(&outcome.report);
    }
    // The log and the picture of an interrupted run are whole: it only ended early.
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// The table if one is given and belongs to the scene, else a direct evaluator.
fn source(
    args: &FeelArgs,
    assembly: &Assembly,
    context: &Context,
) -> Result<Box<dyn EnergySource>, CommandError> {
    let Some(path) = &args.table else {
        return Ok(Box::new(assembly.direct(&DirectOptions::REAL_TIME)?));
    };
    let store = bake::open(path)?;
    let [fixed, moving] = assembly.mesh_hashes();
    store
        .expect_meshes(&fixed, &moving)
        .map_err(|e| CommandError::bad_input("table", e))?;
    if store.spec().model != *assembly.pair.model() {
        context.progress.note(&format!(
            "note: {} was baked with another model or energy scale than the scene's; the table's counts",
            path.display()
        ));
    }
    Ok(Box::new(bake::load(&store, context)?))
}

fn draw(
    png: &Path,
    log: Option<&Path>,
    outcome: &Outcome,
    script: Script,
) -> Result<(), CommandError> {
    let logged;
    let samples: &[Sample] = match log {
        Some(path) => {
            logged = read_log(path).map_err(|e| CommandError::failure("reading the log", e))?;
            &logged
        }
        None => &outcome.samples,
    };
    let chart = force_chart(
        format!("{script:?} test, {}", outcome.report.device),
        samples,
    );
    let bytes = picture::png("force against time", (1300, 700), |sheet| chart.draw(sheet))?;
    atomic::write(png, &bytes)
}

fn print(report: &LoopReport) {
    crate::say!("device      {}", report.device);
    crate::say!(
        "rate        {:.1} Hz over {:.2} s, {} ticks",
        report.rate_hz,
        report.seconds,
        report.ticks
    );
    crate::say!("                      p50       p99     p99.9       max");
    for (name, q) in [
        ("latency", report.latency_us),
        ("lateness", report.lateness_us),
    ] {
        crate::say!(
            "{name:<11} {:>10.1}{:>10.1}{:>10.1}{:>10.1} µs",
            q.p50,
            q.p99,
            q.p999,
            q.max
        );
    }
    crate::say!(
        "overruns    {} ({} ticks left out)",
        report.overruns,
        report.missed
    );
    crate::say!(
        "peak force  {:.3} N, peak torque {:.4} N·m",
        report.peak_force,
        report.peak_torque
    );
    for note in &report.granted.notes {
        crate::say!("note        {note}");
    }
}
