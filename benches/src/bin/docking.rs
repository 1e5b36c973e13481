//! Docking from random starts:
//! `docking [--quick] [--out DIR] [--starts N] [--only PAIR] [--exhaustive] [PARTS_DIR]`.
//!
//! The moving part of every pair is turned by a random rotation of SO(3) and shifted before
//! anything is computed, so that its frame gives nothing away; then docking looks everywhere, as
//! `pegfit dock` does for parts that it has never seen. The
//! paper's three pairs, and, if a folder is given, the IndustReal parts in it (`docs/docking.md`).
//! Prints how often the best pose is the true fit (up to the part's symmetry and the play of the
//! fit), by how much the best false pose is shallower, and the times; writes `docking.csv` (a line
//! per pair) and `starts.csv` (a line per start).

use std::path::Path;
use std::sync::Arc;

use fft_correlate::{Docking, DockingRequest, DockingResult};
use fft_correlate::{PairSetup, Pose};
use glam::DVec3;
use pegfit_benches::assemblies::{Assembly, in_own_frame, modelled, random_rotation};
use pegfit_benches::table::{Table, significant};
use pegfit_benches::{Arguments, Outcome};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use sdf_grid::{Silent, SymmetryAxis, SymmetryOrder};

/// A pose this far from a true one is the true one: angle, radians.
const SAME_ANGLE: f64 = 0.07;

/// And distance of the pivots beyond the play, metres.
const SAME_PLACE: f64 = 1e-3;

fn main() -> Outcome<()> {
    let (mut arguments, mut starts, mut only) = (Arguments::parse_known()?, None, None);
    let mut exhaustive = false;
    while let Some(at) = arguments.rest.iter().position(|a| a.starts_with("--")) {
        let option = arguments.rest.remove(at);
        if option == "--exhaustive" {
            exhaustive = true;
            continue;
        }
        let value = (at < arguments.rest.len()).then(|| arguments.rest.remove(at));
        match (option.as_str(), value) {
            ("--starts", Some(n)) => starts = Some(n.parse::<u64>()?),
            ("--only", Some(name)) => only = Some(name),
            _ => {
                return Err(
                    "usage: docking [--quick] [--out DIR] [--starts N] [--only PAIR] \
                     [--exhaustive] [PARTS_DIR]"
                        .into(),
                );
            }
        }
    }
    let starts = starts.unwrap_or(if arguments.quick { 2 } else { 50 });
    let mut csv = csv::Writer::from_path(arguments.out.join("starts.csv"))?;
    csv.write_record([
        "pair",
        "start",
        "true_first",
        "margin",
        "true_distance_m",
        "true_angle_rad",
        "overlap",
        "rotations",
        "seconds_per_rotation",
        "fields_s",
        "sketch_s",
        "scoring_s",
        "coarse_descent_s",
        "fine_descent_s",
        "decision_s",
        "false_distance_m",
        "false_angle_rad",
    ])?;
    let mut table = Table::new("docking", "Docking from random starts", ABOUT, &COLUMNS);
    for task in modelled(arguments.rest.first().map(Path::new))? {
        if only
            .as_ref()
            .is_none_or(|name| task.name.contains(name.as_str()))
        {
            let found = run(&task, starts, exhaustive, &mut csv)?;
            table.push(summary(&task.name, &found));
        }
    }
    arguments.publish(&table, None)
}

const ABOUT: &str = "The moving part is turned by a random rotation of SO(3) and shifted before \
    anything is computed, then docked. `true first`: the best pose is the true one up to the \
    part's symmetry and the play of the fit, pivots within 1 mm and rotations within 4 degrees. \
    Margin: by how much the best false pose is shallower, the smallest of the starts where the \
    true one came first. Worst distance and angle of these from the modelled pose. Medians per \
    start: rotations scored by the sketch or, without one, in full, milliseconds for each of \
    them, seconds altogether and for fields (of the moving part alone after the first start).";

const COLUMNS: [&str; 9] = [
    "pair",
    "true first",
    "smallest margin",
    "off, mm",
    "off, degrees",
    "rotations",
    "ms per rotation",
    "s per start",
    "of which fields",
];

/// What one start came to.
struct Start {
    judged: Judged,
    rotations: usize,
    /// Seconds.
    per_rotation: f64,
    total: f64,
    fields: f64,
}

fn summary(name: &str, starts: &[Start]) -> [String; 9] {
    let good = || starts.iter().map(|s| &s.judged).filter(|j| j.first);
    let worst = |of: fn(&Judged) -> f64| good().map(of).fold(0.0, f64::max);
    let median = |of: fn(&Start) -> f64| {
        let mut values: Vec<f64> = starts.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    [
        name.to_owned(),
        format!("{} of {}", good().count(), starts.len()),
        significant(good().map(|j| j.margin).fold(f64::INFINITY, f64::min), 2),
        significant(worst(|j| 1e3 * j.distance), 2),
        significant(worst(|j| j.angle.to_degrees()), 2),
        format!("{:.0}", median(|s| s.rotations as f64)),
        significant(1e3 * median(|s| s.per_rotation), 2),
        significant(median(|s| s.total), 2),
        significant(median(|s| s.fields), 2),
    ]
}

/// All starts of one pair.
fn run(
    task: &Assembly,
    starts: u64,
    exhaustive: bool,
    csv: &mut csv::Writer<std::fs::File>,
) -> Outcome<Vec<Start>> {
    println!("\n== {}: symmetry {:?}", task.name, orders(&task.axes));
    let mut done = Vec::new();
    for start in 0..starts {
        let off = random_start(start);
        let moving = task.moving.transformed(off.rotation, off.translation);
        let setup = PairSetup::new(task.fixed.clone(), Arc::new(moving));
        let options = DockingRequest {
            exhaustive,
            ..DockingRequest::default()
        };
        let report = Docking::new(&setup, options).run(&Silent)?;
        let judged = judge(task, &off, &report);
        print(start, &off, &report, &judged);
        write(csv, &task.name, start, &report, &judged)?;
        done.push(Start {
            rotations: report.scored,
            per_rotation: report.seconds_per_rotation,
            total: report.field_seconds + report.seconds(),
            fields: report.field_seconds,
            judged,
        });
    }
    Ok(done)
}

/// Where the moving part is before anything is computed.
fn random_start(seed: u64) -> Pose {
    let mut rng = SmallRng::seed_from_u64(seed);
    Pose::new(
        random_rotation(&mut rng),
        0.05 * DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0))),
    )
}

fn print(start: u64, off: &Pose, report: &DockingResult, judged: &Judged) {
    let seconds: Vec<String> = report
        .stages
        .iter()
        .map(|s| format!("{:.1}", s.seconds))
        .collect();
    println!(
        "   start {start}: {} margin {:.3}, off by {:.2} mm {:.2}°, overlap {:.3}, {} close; {} rotations x {:?}, \
         {:?} points, {:.2} ms each; {:.1} + {} = {:.1} s",
        if judged.first {
            "true fit first,"
        } else {
            "FALSE POSE FIRST,"
        },
        judged.margin,
        1e3 * judged.distance,
        judged.angle.to_degrees(),
        report.poses[0].overlap,
        report.close,
        report.scored,
        report.window,
        report.transform_size,
        1e3 * report.seconds_per_rotation,
        report.field_seconds,
        seconds.join(" + "),
        report.field_seconds + report.seconds(),
    );
    println!(
        "      best false pose: {:.2} mm {:.2}° from a true one",
        1e3 * judged.next.0,
        judged.next.1.to_degrees()
    );
    if judged.first {
        return;
    }
    for docked in report.poses.iter().take(4) {
        let p = &docked.found;
        let seen = p.pose * *off;
        println!(
            "      {:.4e} J overlap {:.3} at {:?} turn {:?}",
            p.energy,
            docked.overlap,
            seen.translation * 1e3,
            seen.rotation
        );
    }
}

fn write(
    csv: &mut csv::Writer<std::fs::File>,
    name: &str,
    start: u64,
    report: &DockingResult,
    judged: &Judged,
) -> Outcome<()> {
    let mut row = vec![
        name.to_owned(),
        start.to_string(),
        judged.first.to_string(),
        judged.margin.to_string(),
        judged.distance.to_string(),
        judged.angle.to_string(),
        report.poses[0].overlap.to_string(),
        report.scored.to_string(),
        report.seconds_per_rotation.to_string(),
        report.field_seconds.to_string(),
    ];
    let names = [
        "sketch",
        "scoring",
        "coarse descent",
        "fine descent",
        "decision",
    ];
    row.extend(names.map(|name| {
        let stage = report.stages.iter().find(|s| s.name == name);
        stage.map_or(0.0, |s| s.seconds).to_string()
    }));
    row.extend([judged.next.0.to_string(), judged.next.1.to_string()]);
    csv.write_record(row)?;
    Ok(csv.flush()?)
}

fn orders(axes: &[SymmetryAxis]) -> Vec<SymmetryOrder> {
    axes.iter().map(|a| a.order).collect()
}

struct Judged {
    first: bool,
    /// How much shallower the best false pose is, of the best true one's depth; negative if deeper.
    margin: f64,
    /// From the best pose to the nearest true one.
    distance: f64,
    angle: f64,
    /// The same from the best false one.
    next: (f64, f64),
}

fn judge(task: &Assembly, off: &Pose, report: &DockingResult) -> Judged {
    let poses = || report.poses.iter().map(|p| &p.found);
    let group = in_own_frame(&report.symmetries, off);
    let pivot = off.inverse().apply(report.lattices.pivot);
    let miss = |pose: &Pose| task.miss(&(*pose * *off), &group, pivot);
    let is_true = |pose: &Pose| {
        let (distance, angle) = miss(pose);
        distance < SAME_PLACE && angle < SAME_ANGLE
    };
    let lowest = |wanted: bool| {
        let energies = poses().filter(|p| is_true(&p.pose) == wanted);
        energies.map(|p| p.energy).fold(0.0, f64::min)
    };
    let (distance, angle) = miss(&report.poses[0].found.pose);
    let next = poses().filter(|p| !is_true(&p.pose));
    let next = next.min_by(|a, b| a.energy.total_cmp(&b.energy));
    Judged {
        next: next.map_or((f64::NAN, f64::NAN), |p| miss(&p.pose)),
        first: is_true(&report.poses[0].found.pose),
        margin: 1.0 - lowest(false) / lowest(true),
        distance,
        angle,
    }
}
