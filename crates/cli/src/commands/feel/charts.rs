//! The page's curves over time.

use std::fmt::Write;

use fft_correlate::Pose;
use glam::DVec3;
use haptic::{Sample, flags};

use super::subject::{LISTED, Run, names, starts};
use crate::report::svg::{self, Curve, Mark};

/// Seconds over which the rate is a mean.
const RATE_WINDOW: f64 = 0.1;

pub(super) fn charts(run: &Run<'_>) -> String {
    let events: Vec<(f64, String)> = starts(run.samples, flags::CHANGED | flags::OVERRUN)
        .map(|s| (s.time, names(s.flags)))
        .collect();
    let marks: Vec<Mark<'_>> = events
        .iter()
        .take(LISTED)
        .map(|(at, label)| Mark { at: *at, label })
        .collect();
    let mut html = String::new();
    let mut chart = |heading: &str, words: &str, vertical: &str, curves: &[Curve<'_>]| {
        let svg = svg::lines("time (s)", vertical, curves, &marks);
        let _ = writeln!(html, "<h2>{heading}</h2>\n<p>{words}</p>\n{svg}");
    };
    let s = run.samples;
    chart(
        "Force",
        "On the hand. Red lines: a part was exchanged, or ticks were left out.",
        "force (N)",
        &with_size(s, |s| s.wrench.force),
    );
    chart(
        "Torque",
        "On the hand, about the grip.",
        "torque (N·m)",
        &with_size(s, |s| s.wrench.torque),
    );
    chart(
        "Position of the moving part",
        "In the scene's frame.",
        "position (mm)",
        &components(s, |s| 1e3 * s.object.translation),
    );
    chart(
        "Rotation of the moving part",
        "Rotation vector in the scene's frame.",
        "rotation (degrees)",
        &components(s, turned),
    );
    chart(
        "Energy of the scene",
        "Summed over the pairs in reach, at the virtual object.",
        "energy (J)",
        &[curve(s, "energy", |s| s.energy)],
    );
    chart(
        "Energy bookkeeping",
        "Work of the hand through force and torque, energy made by sampling and lag, taken back by \
         the passivity controller, and brought by exchanged parts.",
        "energy (J)",
        &[
            curve(s, "work, force", |s| s.account.work_force),
            curve(s, "work, torque", |s| s.account.work_torque),
            curve(s, "made", |s| s.account.made),
            curve(s, "taken", |s| s.account.taken),
            curve(s, "exchanged", |s| s.account.exchanged),
        ],
    );
    chart(
        "Passivity balance",
        "Below zero the controller damps.",
        "balance (mJ)",
        &[curve(s, "balance", |s| 1e3 * s.account.balance)],
    );
    chart(
        "Rate",
        "Mean over a tenth of a second, on the loop's clock.",
        "ticks per second",
        &[Curve {
            label: "rate",
            points: rate(s),
        }],
    );
    chart(
        "Strength and coverage",
        "The ramp's share of the force, and how far the energy is known: below one, a pair in reach \
         is not loaded, or the edge of a table is near.",
        "share",
        &[
            curve(s, "strength", |s| s.gain),
            curve(s, "coverage", |s| s.coverage),
        ],
    );
    chart(
        "Evaluations",
        "How often a tick asked for the energy.",
        "per tick",
        &[curve(s, "evaluations", |s| f64::from(s.evaluations))],
    );
    html
}

fn curve<'a>(samples: &[Sample], label: &'a str, value: impl Fn(&Sample) -> f64) -> Curve<'a> {
    Curve {
        label,
        points: samples.iter().map(|s| (s.time, value(s))).collect(),
    }
}

/// One curve per component of a vector.
fn components(samples: &[Sample], vector: impl Fn(&Sample) -> DVec3) -> Vec<Curve<'static>> {
    let one = |(axis, label)| curve(samples, label, |s| vector(s)[axis]);
    ["x", "y", "z"].into_iter().enumerate().map(one).collect()
}

/// Its length first.
fn with_size(samples: &[Sample], vector: impl Fn(&Sample) -> DVec3) -> Vec<Curve<'static>> {
    let mut curves = vec![curve(samples, "size", |s| vector(s).length())];
    curves.extend(components(samples, vector));
    curves
}

/// The moving part's rotation vector, degrees.
fn turned(sample: &Sample) -> DVec3 {
    let twist = Pose::IDENTITY.twist_to(&sample.object);
    twist.angular.map(f64::to_degrees)
}

fn rate(samples: &[Sample]) -> Vec<(f64, f64)> {
    let mut points = Vec::new();
    let mut first = 0;
    for (index, sample) in samples.iter().enumerate() {
        let span = sample.time - samples[first].time;
        if span >= RATE_WINDOW {
            let ticks = sample.tick.saturating_sub(samples[first].tick);
            points.push((sample.time, ticks as f64 / span));
            first = index;
        }
    }
    points
}
