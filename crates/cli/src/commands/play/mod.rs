//! `pegfit play`: the loop on a page.

mod browser;

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use fft_correlate::Pose;
use haptic::{GuidedJoint, LoopReport, TimedPath};
use pegfit_play::{Content, Options, PlaySession, PlayedScene, SceneContent, Server, start_pose};
use pegfit_scene::poses::PoseReader;
use pegfit_scene::{LivePairs, Scene};
use sdf_grid::Monitor;
use sdf_grid::shapes::PegInHole;
use serde_json::json;

use crate::args::PlayArgs;
use crate::commands::play::browser::Signpost;
use crate::commands::{demo, joint, scenes};
use crate::context::Context;
use crate::error::CommandError;
use crate::terminal::progress::{Hold, Progress, cancel_flag, check_interrupt, interrupted};

pub(in crate::commands) fn run(args: &PlayArgs, context: &Context) -> Result<(), CommandError> {
    // Deleted when the command ends.
    let folder = tempfile::tempdir().map_err(|e| CommandError::failure("temporary folder", e))?;
    let pairs = match &args.scene {
        Some(path) => {
            let name = path.file_stem().unwrap_or_default();
            vec![(name.to_string_lossy().into_owned(), Scene::read(path)?)]
        }
        None => PegInHole::ALL
            .into_iter()
            .map(|shape| {
                let scene = demo::write_scene(shape, folder.path())?;
                Ok((shape.name().to_owned(), scene))
            })
            .collect::<Result<_, CommandError>>()?,
    };
    let poses = args.path.as_deref().map(read_path).transpose()?;
    let joints = joint::read(args.joint.as_deref())?;
    let options = Options {
        bind: args.bind,
        port: args.port,
        embed: args.embed,
    };
    let titles = pairs.iter().map(|(title, _)| title.clone()).collect();
    let server = Server::start(&options, titles)?;
    // Taken away when the command ends.
    let _signpost = announce(&server, args, context);
    loop {
        let (_, scene) = &pairs[server.wanted()];
        let known = (poses.as_deref(), joints.as_slice());
        let report = play(&server, scene, args, known, context)?;
        print_report(&report, context);
        if interrupted() {
            return Ok(());
        }
    }
}

/// Says where the page is, and to whom it is open; what shows a browser the way.
fn announce(server: &Server, args: &PlayArgs, context: &Context) -> Option<Signpost> {
    let url = server.url();
    match context.json {
        true => say!("{}", json!({ "url": url })),
        false => say!("{url}"),
    }
    if !args.bind.is_loopback() {
        context.progress.note(&format!(
            "listening on {}: whoever in this network learns the address above, which goes over it \
             unencrypted, can watch, and move the simulated hand while nobody else does; they see \
             both surfaces and their densities, and reach no other file",
            server.address()
        ));
    }
    let mut signpost = None;
    if !args.no_open {
        match browser::open(&url) {
            Ok(shown) => signpost = Some(shown),
            Err(why) => context.progress.note(&format!(
                "no browser could be opened ({why}): open the address above"
            )),
        }
    }
    context.progress.note("Ctrl-C ends it");
    signpost
}

/// Plays one scene until another is wanted, or nothing any more.
fn play(
    server: &Server,
    scene: &Scene,
    args: &PlayArgs,
    (poses, joints): (Option<&[Pose]>, &[GuidedJoint]),
    context: &Context,
) -> Result<LoopReport, CommandError> {
    let first = scene.clone().only(Some(&scene.fixed.name))?;
    let assembly = scenes::load_for_hand(first, args.table.as_deref(), context)?;
    // The thread that loads hears of Ctrl-C and shows no bars.
    let quiet: Arc<dyn Monitor + Send> = Arc::new(Progress::new(true));
    let pairs = LivePairs::start(scene, assembly, args.table.as_deref(), &quiet)?;
    scenes::print_warnings(&pairs.warnings, context);
    check_interrupt()?;
    let source = pairs.live.source();
    let (workspace, geometry) = (pairs.assembly.workspace(), pairs.assembly.geometry(source));
    let played = PlayedScene {
        scene,
        assembly: &pairs.assembly,
        names: &pairs.names,
        source,
        geometry,
        table: args.table.as_deref(),
    };
    let content = Arc::new(SceneContent::new(&played, quiet)?);
    let session = PlaySession {
        source,
        config: scene.device.clone(),
        workspace,
        start: start_pose(&geometry, workspace.grip),
        geometry,
        joints: joints.to_vec(),
        path: poses.and_then(|poses| TimedPath::new(poses, &workspace)),
        content: Arc::clone(&content) as Arc<dyn Content>,
    };
    let _held = Hold::begin();
    let report = server.run_session(&session, cancel_flag());
    content.end();
    Ok(report?)
}

/// What the loop was like.
fn print_report(report: &LoopReport, context: &Context) {
    let (latency, lateness) = (&report.latency_us, &report.lateness_us);
    context.progress.note(&format!(
        "{:.1} Hz over {:.1} s; computing p50 {:.0} µs, p99 {:.0} µs; late p50 {:.0} µs, p99 {:.0} \
         µs; {} of {} ticks missed",
        report.rate_hz,
        report.seconds,
        latency.p50,
        latency.p99,
        lateness.p50,
        lateness.p99,
        report.missed,
        report.ticks + report.missed
    ));
}

/// Most poses of a path: many more than `pegfit path` writes.
const MOST: usize = 100_000;

/// The poses of a path, as `pegfit path` writes them.
fn read_path(path: &Path) -> Result<Vec<Pose>, CommandError> {
    let file = File::open(path).map_err(|e| CommandError::read(path, e))?;
    let name = path.display().to_string();
    let reader = PoseReader::new(&name, file)?;
    let poses = reader.take(MOST + 1).collect::<Result<Vec<Pose>, _>>()?;
    match poses.len() {
        2..=MOST => Ok(poses),
        found => {
            let found = match found > MOST {
                true => "more".into(),
                false => found.to_string(),
            };
            let expected = format!("2 to {MOST} poses");
            Err(CommandError::input(name, "rows", expected, found))
        }
    }
}
