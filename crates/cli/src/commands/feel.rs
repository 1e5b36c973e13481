//! `pegfit feel`: the haptic loop.

use std::path::Path;
use std::sync::Arc;

use fft_correlate::Pose;
use haptic::scene::PairState;
use haptic::{Clock, Device, DeviceSpec, LoopReport, Outcome, Replay, Sample, Script};
use pegfit_scene::{LivePairs, Scene};
use sdf_grid::{Monitor, atomic};
use serde::Serialize;

use crate::args::device_choice::DeviceChoice;
use crate::args::{FeelArgs, ScriptChoice};
use crate::commands::devices::Chosen;
use crate::commands::plot::force_chart;
use crate::commands::{devices, haptic_session, joint, scenes};
use crate::context::Context;
use crate::error::{CommandError, refuse};
use crate::report::output::require_folder;
use crate::report::parquet_log;
use crate::report::session::{SessionReport, event_text, privileges};
use crate::terminal::progress::{Hold, Progress, interrupted};

/// Default length of a run, seconds.
const SECONDS: f64 = 5.0;

/// The report for programs.
#[derive(serde::Serialize)]
struct JsonReport<'a> {
    #[serde(flatten)]
    report: &'a LoopReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    replay: Option<&'a ReplayComparison>,
}

/// The result of a run.
struct SessionResult {
    title: String,
    spec: DeviceSpec,
    outcome: Outcome,
    comparison: Option<ReplayComparison>,
}

pub(in crate::commands) fn run(args: &FeelArgs, context: &Context) -> Result<(), CommandError> {
    check_outputs(args)?;
    let script = match args.script {
        ScriptChoice::Collision => Script::Collision,
        ScriptChoice::Snap => Script::Snap,
        ScriptChoice::Free => Script::Free,
    };
    let (scene, pairs) = load(args, context)?;
    let SessionResult {
        title,
        spec,
        outcome,
        comparison,
    } = run_session(args, script, &pairs, context)?;
    if let Some(path) = &args.png {
        draw(path, &outcome.samples, title.clone())?;
    }
    if let Some(path) = &args.report {
        let page = report(title, &spec, &scene, &pairs, &outcome)?;
        atomic::write(path, page.as_bytes())?;
    }
    let summary = JsonReport {
        report: &outcome.report,
        replay: comparison.as_ref(),
    };
    context.show(&summary, || {
        print(&outcome.report, &pairs);
        comparison.iter().for_each(ReplayComparison::print);
    })?;
    // The log and the picture of an interrupted run are whole: it only ended early.
    match interrupted() {
        true => Err(CommandError::Interrupted),
        false => Ok(()),
    }
}

/// Refuses what could not be done or written, before anything is loaded.
fn check_outputs(args: &FeelArgs) -> Result<(), CommandError> {
    if let Some(seconds) = args.seconds.filter(|s| !(s.is_finite() && *s > 0.0)) {
        return refuse("--seconds", "a positive number", seconds);
    }
    for output in [&args.log, &args.png, &args.report].into_iter().flatten() {
        require_folder(output)?;
    }
    args.log.as_deref().map_or(Ok(()), parquet_log::require)
}

/// Reads the scene and loads what is in reach of the fit.
fn load(args: &FeelArgs, context: &Context) -> Result<(Scene, LivePairs), CommandError> {
    let mut scene = Scene::read(&args.scene)?;
    if matches!(args.device, DeviceChoice::Replay(_)) {
        // A replay waits for nobody, so that all rotations of a table have to be there before.
        scene.loading.turn_ahead = std::f64::consts::TAU;
    }
    let first = scene.clone().only(Some(&scene.fixed.name))?;
    let table = args.table.as_deref();
    let assembly = match (&args.device, table.or(first.fixed.table.as_deref())) {
        // Runs without a hand are to be the same every time.
        (DeviceChoice::Simulated | DeviceChoice::Replay(_), None) => scenes::load(first, context)?,
        _ => scenes::load_for_hand(first, table, context)?,
    };
    // The thread that loads hears of Ctrl-C and shows no bars.
    let quiet: Arc<dyn Monitor + Send> = Arc::new(Progress::new(true));
    let pairs = LivePairs::start(&scene, assembly, args.table.as_deref(), &quiet)?;
    scenes::print_warnings(&pairs.warnings, context);
    Ok((scene, pairs))
}

/// Runs the loop with the device that was asked for.
fn run_session(
    args: &FeelArgs,
    script: Script,
    pairs: &LivePairs,
    context: &Context,
) -> Result<SessionResult, CommandError> {
    let (assembly, source) = (&pairs.assembly, pairs.live.source());
    let _held = Hold::begin();
    let options = haptic_session::LoopOptions {
        log: (args
            .log
            .as_deref()
            .map(|log| haptic_session::log(log, context)))
        .transpose()?,
        samples: args.png.is_some() || args.report.is_some(),
        joints: joint::read(args.joint.as_deref())?,
    };
    let seconds = args.seconds.unwrap_or(SECONDS);
    Ok(
        match devices::choose(&args.device, &assembly.scene().device, context)? {
            Chosen::Replay(recorded) => replay(recorded, args.seconds, pairs, options, context)?,
            Chosen::Attached(mut device) => {
                run_device(device.as_mut(), seconds, pairs, options, context)?
            }
            Chosen::Simulated => {
                let mut hand = haptic_session::simulated(assembly, source, script, seconds);
                SessionResult {
                    title: SessionReport::title(Some(script), &hand.spec().name),
                    ..run_device(&mut hand, seconds, pairs, options, context)?
                }
            }
        },
    )
}

/// A device holds the part.
fn run_device(
    device: &mut dyn Device,
    seconds: f64,
    pairs: &LivePairs,
    options: haptic_session::LoopOptions,
    context: &Context,
) -> Result<SessionResult, CommandError> {
    let (assembly, source) = (&pairs.assembly, pairs.live.source());
    context.progress.note(&format!(
        "the {} holds {} for {seconds} s",
        device.spec().name,
        assembly.scene().moving.name,
    ));
    let outcome = haptic_session::run(assembly, source, device, seconds, Clock::Real, options)?;
    if let Some(fault) = device.last_fault() {
        context
            .progress
            .note(&format!("the device's last fault: {fault}"));
    }
    Ok(SessionResult {
        title: SessionReport::title(None, &device.spec().name),
        spec: device.spec().clone(),
        outcome,
        comparison: None,
    })
}

/// The recording holds the part again, at its own times and without waiting.
fn replay(
    mut recorded: Replay,
    seconds: Option<f64>,
    pairs: &LivePairs,
    options: haptic_session::LoopOptions,
    context: &Context,
) -> Result<SessionResult, CommandError> {
    let (assembly, source) = (&pairs.assembly, pairs.live.source());
    let seconds = seconds.unwrap_or(f64::INFINITY);
    context.progress.note(&format!(
        "the {} holds {}: {:.2} s, in simulated time",
        recorded.spec().name,
        assembly.scene().moving.name,
        recorded.duration().min(seconds),
    ));
    let options = haptic_session::LoopOptions {
        samples: true,
        ..options
    };
    let outcome = haptic_session::replay(assembly, source, &mut recorded, seconds, options)?;
    Ok(SessionResult {
        title: SessionReport::title(None, &recorded.spec().name),
        spec: recorded.spec().clone(),
        comparison: Some(ReplayComparison::compare(
            recorded.samples(),
            &outcome.samples,
        )),
        outcome,
    })
}

fn draw(png: &Path, samples: &[Sample], title: String) -> Result<(), CommandError> {
    let chart = force_chart(title, samples);
    let bytes = pegfit_pictures::png("force against time", (1300, 700), |sheet| chart.draw(sheet))?;
    Ok(atomic::write(png, &bytes)?)
}

fn report(
    title: String,
    spec: &DeviceSpec,
    scene: &Scene,
    pairs: &LivePairs,
    outcome: &Outcome,
) -> Result<String, CommandError> {
    let states = pairs.live.states().into_iter().map(|state| match state {
        PairState::Waiting => "not loaded: far away".to_owned(),
        PairState::Loaded => "loaded".to_owned(),
        PairState::Partly { rotations, of } => {
            format!("{rotations} of its table's {of} rotations loaded")
        }
        PairState::Failed => "could not be loaded".to_owned(),
        PairState::NoRoom => "not loaded: no room in the scene's memory".to_owned(),
    });
    let setup = &pairs.assembly.setup;
    let mut parts = setup.all_fixed(scene)?;
    parts.push(setup.moving_at(&Pose::IDENTITY));
    let page = SessionReport {
        title,
        subject: format!("Scene {}", scene.path.display()),
        spec,
        config: &scene.device,
        outcome,
        events: &pairs.live.events(),
        pairs: pairs.names.iter().cloned().zip(states).collect(),
        parts,
    };
    Ok(page.html()?)
}

fn print(report: &LoopReport, pairs: &LivePairs) {
    say!("device      {}", report.device);
    say!(
        "rate        {:.1} Hz over {:.2} s, {} ticks",
        report.rate_hz,
        report.seconds,
        report.ticks
    );
    say!("                      p50       p99     p99.9       max");
    for (name, q) in [
        ("latency", report.latency_us),
        ("lateness", report.lateness_us),
    ] {
        say!(
            "{name:<11} {:>10.1}{:>10.1}{:>10.1}{:>10.1} µs",
            q.p50,
            q.p99,
            q.p999,
            q.max
        );
    }
    say!(
        "overruns    {} ({} ticks left out)",
        report.overruns,
        report.missed
    );
    say!(
        "peak force  {:.3} N, peak torque {:.4} N·m",
        report.peak_force,
        report.peak_torque
    );
    if report.dropped_samples > 0 {
        say!(
            "log         {} ticks are missing: the disk was too slow",
            report.dropped_samples
        );
    }
    // In simulated time nothing is asked of the system.
    let asked = (report.clock == Clock::Real).then(|| privileges(report));
    for (what, said) in asked.into_iter().flatten() {
        say!("{what:<11} {said}");
    }
    if report.not_loaded > 0 {
        say!(
            "scene       {} ticks in which something in reach was not loaded",
            report.not_loaded
        );
    }
    if report.outside > 0 {
        let seconds = report.seconds * report.outside as f64 / report.ticks.max(1) as f64;
        say!(
            "outside     {seconds:.2} s outside the table, where its energy fades: up to {:.3} N",
            report.outside_force
        );
    }
    for event in pairs.live.events() {
        say!("scene       {}: {}", event.pair, event_text(&event.what));
    }
}

/// How the wrenches of a replay compare with the recorded ones, bit by bit.
#[derive(Debug, Serialize)]
pub(super) struct ReplayComparison {
    /// Ticks compared.
    ticks: usize,
    /// Ticks with another force or torque.
    different: usize,
    /// The first of these, as the log counts.
    first_different: Option<u64>,
}

impl ReplayComparison {
    pub(super) fn compare(recorded: &[Sample], samples: &[Sample]) -> Self {
        let pairs = || recorded.iter().zip(samples);
        let other = |(a, b): &(&Sample, &Sample)| bits(a) != bits(b);
        Self {
            ticks: pairs().count(),
            different: pairs().filter(other).count(),
            first_different: pairs().find(other).map(|(recorded, _)| recorded.tick),
        }
    }

    pub(super) fn print(&self) {
        match self.first_different {
            None => say!(
                "replay      all {} forces are the recorded ones, bit by bit",
                self.ticks
            ),
            Some(tick) => say!(
                "replay      {} of {} forces are not the recorded ones, from tick {tick} on: \
                 another scene, source, setting or device, or a log that began in the middle of a \
                 run",
                self.different,
                self.ticks
            ),
        }
    }
}

fn bits(sample: &Sample) -> [[u64; 3]; 2] {
    [sample.wrench.torque, sample.wrench.force].map(|v| v.to_array().map(f64::to_bits))
}
