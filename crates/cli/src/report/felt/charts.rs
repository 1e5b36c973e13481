//! The page's curves over time.

use std::fmt::Write;

use fft_correlate::Pose;
use glam::DVec3;
use haptic::{Sample, flags};
use pegfit_pictures::{LineChart, Mark, PictureError, Series, reduced};

use super::subject::{FeltPage, LISTED, starts};

/// Seconds over which the rate is a mean.
const RATE_WINDOW: f64 = 0.1;

/// Width and height of a chart.
const SIZE: (u32, u32) = (960, 310);

pub(super) fn charts(run: &FeltPage<'_>) -> Result<String, PictureError> {
    let marks: Vec<Mark> = starts(&run.outcome.samples, flags::CHANGED | flags::OVERRUN)
        .take(LISTED)
        .map(|s| Mark {
            at: s.time,
            label: String::new(),
        })
        .collect();
    let mut html = String::new();
    for figure in figures(&run.outcome.samples) {
        let chart = LineChart {
            horizontal: "time (s)".to_owned(),
            vertical: figure.vertical.to_owned(),
            series: figure.curves,
            marks: marks.clone(),
            ..LineChart::default()
        };
        let svg = pegfit_pictures::svg(figure.heading, SIZE, |sheet| chart.draw(sheet))?;
        let (heading, words) = (figure.heading, figure.words);
        // Writing to a string cannot fail.
        let _ = writeln!(html, "<h2>{heading}</h2>\n<p>{words}</p>\n{svg}");
    }
    Ok(html)
}

/// A chart of the page.
struct Figure {
    heading: &'static str,
    words: &'static str,
    vertical: &'static str,
    curves: Vec<Series>,
}

fn figures(s: &[Sample]) -> Vec<Figure> {
    let mut figures = motion(s);
    figures.extend(energies(s));
    figures.extend(loop_state(s));
    figures
}

/// What the hand feels and where the part is.
fn motion(s: &[Sample]) -> Vec<Figure> {
    vec![
        Figure {
            heading: "Force",
            words: "On the hand. Red lines: a part was exchanged, or ticks were left out.",
            vertical: "force (N)",
            curves: with_size(s, |s| s.wrench.force),
        },
        Figure {
            heading: "Torque",
            words: "On the hand, about the grip.",
            vertical: "torque (N·m)",
            curves: with_size(s, |s| s.wrench.torque),
        },
        Figure {
            heading: "Position of the moving part",
            words: "In the scene's frame.",
            vertical: "position (mm)",
            curves: components(s, |s| 1e3 * s.object.translation),
        },
        Figure {
            heading: "Rotation of the moving part",
            words: "Rotation vector in the scene's frame.",
            vertical: "rotation (degrees)",
            curves: components(s, turned),
        },
    ]
}

/// Energy and its bookkeeping.
fn energies(s: &[Sample]) -> Vec<Figure> {
    vec![
        Figure {
            heading: "Energy of the scene",
            words: "Summed over the pairs in reach, at the virtual object.",
            vertical: "energy (J)",
            curves: vec![curve(s, "energy", |s| s.energy)],
        },
        Figure {
            heading: "Energy bookkeeping",
            words: "Work of the hand through force and torque, energy made by sampling and lag, taken back by \
         the passivity controller, and brought by exchanged parts.",
            vertical: "energy (J)",
            curves: vec![
                curve(s, "work, force", |s| s.account.work_force),
                curve(s, "work, torque", |s| s.account.work_torque),
                curve(s, "made", |s| s.account.made),
                curve(s, "taken", |s| s.account.taken),
                curve(s, "exchanged", |s| s.account.exchanged),
            ],
        },
        Figure {
            heading: "Passivity balance",
            words: "Below zero the controller damps.",
            vertical: "balance (mJ)",
            curves: vec![curve(s, "balance", |s| 1e3 * s.account.balance)],
        },
    ]
}

/// How the loop fared.
fn loop_state(s: &[Sample]) -> Vec<Figure> {
    vec![
        Figure {
            heading: "Rate",
            words: "Mean over a tenth of a second, on the loop's clock.",
            vertical: "ticks per second",
            curves: vec![series("rate", rate(s))],
        },
        Figure {
            heading: "Strength and coverage",
            words: "The ramp's share of the force, and how far the energy is known: below one, a pair in reach \
         is not loaded, or the part is outside a table.",
            vertical: "share",
            curves: vec![
                curve(s, "strength", |s| s.gain),
                curve(s, "coverage", |s| s.coverage),
            ],
        },
        Figure {
            heading: "Evaluations",
            words: "How often a tick asked for the energy.",
            vertical: "per tick",
            curves: vec![curve(s, "evaluations", |s| f64::from(s.evaluations))],
        },
    ]
}

fn series(label: &str, points: Vec<(f64, f64)>) -> Series {
    Series {
        label: label.to_owned(),
        points: reduced(&points),
        thin: true,
        ..Series::default()
    }
}

fn curve(samples: &[Sample], label: &str, value: impl Fn(&Sample) -> f64) -> Series {
    series(label, samples.iter().map(|s| (s.time, value(s))).collect())
}

/// One curve per component of a vector.
fn components(samples: &[Sample], vector: impl Fn(&Sample) -> DVec3) -> Vec<Series> {
    let one = |(axis, label)| curve(samples, label, |s| vector(s)[axis]);
    ["x", "y", "z"].into_iter().enumerate().map(one).collect()
}

/// Its length first.
fn with_size(samples: &[Sample], vector: impl Fn(&Sample) -> DVec3) -> Vec<Series> {
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
