//! Ways in, found in every frame: `path [--quick] [--out DIR] [--frames N] [--only PAIR]
//! [--seconds S] [--scenes DIR] [PARTS_DIR]`.
//!
//! Both parts of pairs whose way is known are turned and shifted by themselves, with clearances from
//! 0.02 to 0.5 mm: pegs of all kinds (`shapes::random_fit`), the paper's, a dovetail, a spool round a
//! corner, a bayonet, nuts of both hands, a ball that cannot leave, and the parts of a folder. Prints
//! how often the answer was the right one, the time it took, and what was looked at. With `--scenes`
//! nothing is looked for: a scene of each pair in each frame is written there, for other tools.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use fft_correlate::Pose;
use glam::DVec3;
use pegfit_benches::assemblies::{modelled, random_rotation};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome};
use pegfit_path::{Outcome as Found, PathAnswer, PathOptions, PathSearch};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::{Silent, TriangleMesh, mesh_io, shapes};

/// Clearances, metres: of the pairs that are made for one, and of nuts, whose facets take some of it.
const CLEARANCES: [f64; 4] = [2e-5, 6e-5, 2e-4, 5e-4];
const OF_NUTS: [f64; 3] = [4e-5, 1e-4, 3e-4];

const ABOUT: &str = "Ways found by `pegfit path` without energies, both parts turned and shifted by \
    themselves; overlap of the solids along the way at points twice as dense as those of the search.";

const COLUMNS: [&str; 8] = [
    "pair",
    "frames",
    "right",
    "seconds",
    "longest",
    "looked",
    "nodes",
    "overlap, mm",
];

/// Two parts whose assembled pose is the identity, and whether they come apart.
struct Known {
    name: String,
    parts: (TriangleMesh, TriangleMesh),
    free: bool,
}

struct Wanted {
    frames: u64,
    only: Option<String>,
    seconds: f64,
    scenes: Option<PathBuf>,
}

fn main() -> Outcome<()> {
    let mut arguments = Arguments::parse_known()?;
    let wanted = wanted(&mut arguments)?;
    let mut table = Table::new("path", "Ways in", ABOUT, &COLUMNS);
    for known in all(arguments.rest.first().map(Path::new))? {
        let chosen = wanted
            .only
            .as_ref()
            .is_none_or(|part| known.name.contains(part.as_str()));
        if !chosen {
            continue;
        }
        if let Some(folder) = &wanted.scenes {
            write_scenes(&known, wanted.frames, folder)?;
        } else {
            table.push(row(&known, &wanted)?);
            println!("{}", table.to_text().lines().last().unwrap_or_default());
        }
    }
    match wanted.scenes {
        Some(_) => Ok(()),
        None => arguments.publish(&table, None),
    }
}

fn wanted(arguments: &mut Arguments) -> Outcome<Wanted> {
    let usage = "usage: path [--quick] [--out DIR] [--frames N] [--only PAIR] [--seconds S] \
                 [--scenes DIR] [PARTS_DIR]";
    let mut wanted = Wanted {
        frames: if arguments.quick { 1 } else { 20 },
        only: None,
        seconds: 60.0,
        scenes: None,
    };
    let rest = &mut arguments.rest;
    while let Some(at) = rest.iter().position(|a| a.starts_with("--")) {
        let option = rest.remove(at);
        if at >= rest.len() {
            return Err(usage.into());
        }
        let value = rest.remove(at);
        match option.as_str() {
            "--frames" => wanted.frames = value.parse()?,
            "--only" => wanted.only = Some(value),
            "--seconds" => wanted.seconds = value.parse()?,
            "--scenes" => wanted.scenes = Some(value.into()),
            _ => return Err(usage.into()),
        }
    }
    Ok(wanted)
}

fn all(folder: Option<&Path>) -> Outcome<Vec<Known>> {
    let mut all = Vec::new();
    let mut add = |name: String, parts, free| all.push(Known { name, parts, free });
    for pair in modelled(folder)? {
        add(
            pair.name,
            ((*pair.fixed).clone(), (*pair.moving).clone()),
            true,
        );
    }
    for seed in 0..8 {
        let fit = shapes::random_fit(seed)?;
        let way = if fit.through { "through" } else { "blind" };
        let name = format!(
            "peg {seed}, {}, {way}, {} mm",
            fit.kind,
            millimetres(fit.clearance)
        );
        add(name, (fit.fixed, fit.moving), true);
    }
    for c in CLEARANCES {
        let mm = millimetres(c);
        add(format!("dovetail, {mm} mm"), shapes::dovetail(c)?, true);
        add(format!("spool, {mm} mm"), shapes::spool_in_slot(c)?, true);
        add(format!("bayonet, {mm} mm"), shapes::bayonet(c)?, true);
        add(
            format!("captive ball, {mm} mm"),
            shapes::captive_ball(c, 5e-4)?,
            false,
        );
    }
    for (pitch, right_handed) in [(0.001, true), (0.002, false), (0.003, true)] {
        let thread = shapes::Thread {
            pitch,
            radius: 0.005,
            depth: 0.4 * pitch,
            right_handed,
            segments: 64,
        };
        for c in OF_NUTS {
            let hand = if right_handed { "right" } else { "left" };
            let (pitch, mm) = (millimetres(pitch), millimetres(c));
            let bolt = thread.bolt(4.0 * thread.pitch, [0.008, 0.003])?;
            let nut = thread.nut([0.2 * thread.pitch, 2.2 * thread.pitch], 0.016, c)?;
            add(
                format!("nut, {pitch} mm, {hand}, {mm} mm"),
                (bolt, nut),
                true,
            );
        }
    }
    Ok(all)
}

fn millimetres(length: f64) -> String {
    significant(1e3 * length, 2)
}

/// The pair in its frames.
fn row(known: &Known, wanted: &Wanted) -> Outcome<Vec<String>> {
    let mut times = Vec::new();
    let (mut right, mut looked, mut nodes, mut overlap) = (0, 0, 0, 0f64);
    for frame in 0..wanted.frames {
        let (answer, seconds) = find(known, frame, wanted.seconds)?;
        times.push(seconds);
        right += u64::from(is_right(known, &answer));
        looked += answer.effort.looked;
        nodes += answer.effort.nodes;
        if known.free {
            overlap = overlap.max(answer.deepest().1);
        }
    }
    times.sort_by(f64::total_cmp);
    let frames = wanted.frames as usize;
    Ok(vec![
        known.name.clone(),
        frames.to_string(),
        right.to_string(),
        significant(times[frames / 2], 2),
        significant(times[frames - 1], 2),
        (looked / frames).to_string(),
        (nodes / frames).to_string(),
        if known.free {
            significant(1e3 * overlap, 2)
        } else {
            "-".to_owned()
        },
    ])
}

/// Whether the answer is the known one: a way without overlap, or none after everything was tried.
fn is_right(known: &Known, answer: &PathAnswer) -> bool {
    match answer.outcome {
        Found::Free => known.free && answer.is_free(),
        Found::Blocked { exhausted, .. } => !known.free && exhausted,
    }
}

/// The answer in one frame, and how long it took.
fn find(known: &Known, frame: u64, limit: f64) -> Outcome<(PathAnswer, f64)> {
    let ([fixed, moving], goal) = placed(known, frame);
    let options = PathOptions {
        time_limit: Duration::from_secs_f64(limit),
        others: 0.0,
        ..PathOptions::default()
    };
    let began = Instant::now();
    let search = PathSearch::new(Arc::new(fixed), Arc::new(moving), options)?;
    let answer = search.find(&goal, None, &Silent)?;
    Ok((answer, began.elapsed().as_secs_f64()))
}

/// Both parts in a frame, each turned and shifted by itself, and the pose in which they fit.
fn placed(known: &Known, frame: u64) -> ([TriangleMesh; 2], Pose) {
    let mut random = SmallRng::seed_from_u64(frame);
    let mut put = |mesh: &TriangleMesh| {
        let shift = DVec3::from_array(std::array::from_fn(|_| random.random_range(-0.05..0.05)));
        let pose = Pose::new(random_rotation(&mut random), shift);
        (mesh.transformed(pose.rotation, pose.translation), pose)
    };
    let ((fixed, place), (moving, own)) = (put(&known.parts.0), put(&known.parts.1));
    ([fixed, moving], place * own.inverse())
}

/// A scene for each frame, its first line the pair's name.
fn write_scenes(known: &Known, frames: u64, folder: &Path) -> Outcome<()> {
    let plain = |c: char| {
        if c.is_alphanumeric() || c == '.' {
            c
        } else {
            '-'
        }
    };
    for frame in 0..frames {
        let ([fixed, moving], goal) = placed(known, frame);
        let name: String = known.name.chars().map(plain).collect();
        let folder = folder.join(format!("{name}-{frame:02}"));
        std::fs::create_dir_all(&folder)?;
        mesh_io::write_obj(folder.join("fixed.obj"), &fixed)?;
        mesh_io::write_obj(folder.join("moving.obj"), &moving)?;
        let text = format!(
            "# {}\nunit = \"m\"\nfixed = \"fixed.obj\"\nmoving = \"moving.obj\"\n[fit]\n\
             position = {:?}\nrotation = {:?}\n",
            known.name,
            goal.translation.to_array(),
            goal.rotation.to_array()
        );
        std::fs::write(folder.join("scene.toml"), text)?;
    }
    Ok(())
}
