//! The page of `pegfit feel --report`: one file that needs no other.

use std::fmt::Write;
use std::path::Path;

use haptic::scene::{SceneChange, SceneEvent};
use haptic::{DeviceSpec, HapticConfig, LoopReport, Outcome, Sample, flags};
use hdrhistogram::Histogram;

use crate::memory::display_bytes;
use crate::svg::{self, Curve, Mark};

const STYLE: &str = include_str!("demo/page.css");

/// What the charts need beside the demo's style.
const CHARTS: &str = "svg{width:100%;height:auto;font:12px system-ui,sans-serif}\
.grid{stroke:#8884;stroke-width:.6}.mark{stroke:#c0392b88;stroke-width:1}.bar{fill:#1f5fa8}\
text{fill:currentColor}.axis,.below{text-anchor:middle}.left{text-anchor:end}\
td.num{text-align:right}";

/// Events listed; the rest is counted.
const LISTED: usize = 200;

/// Seconds over which the rate is a mean.
const RATE_WINDOW: f64 = 0.1;

/// What the page is about.
pub(super) struct Run<'a> {
    pub(super) title: String,
    pub(super) scene: &'a Path,
    pub(super) spec: &'a DeviceSpec,
    pub(super) config: &'a HapticConfig,
    pub(super) outcome: &'a Outcome,
    pub(super) samples: &'a [Sample],
    pub(super) events: &'a [SceneEvent],
    pub(super) pairs: Vec<(String, &'static str)>,
}

/// The page's text.
pub(super) fn page(run: &Run<'_>) -> String {
    let mut html = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0}</title>\n<style>\n{STYLE}\n{CHARTS}</style>\n<main>\n<h1>{0}</h1>\n",
        svg::escaped(&run.title)
    );
    let report = &run.outcome.report;
    let _ = writeln!(
        html,
        "<p>Scene <code>{}</code>. {} ticks in {:.2} s, {:.1} per second; peak force {:.3} N, peak \
         torque {:.4} N·m.</p>",
        svg::escaped(&run.scene.display().to_string()),
        report.ticks,
        report.seconds,
        report.rate_hz,
        report.peak_force,
        report.peak_torque
    );
    if report.dropped_samples > 0 {
        let _ = writeln!(
            html,
            "<p><strong>{} ticks are missing below: they could not be written in time.</strong></p>",
            report.dropped_samples
        );
    }
    html += &charts(run);
    html += &timing(run.outcome);
    html += &events(run);
    html += &conditions(run);
    html + "</main>\n</html>\n"
}

fn charts(run: &Run<'_>) -> String {
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
        &[
            curve(s, "size", |s| s.wrench.force.length()),
            curve(s, "x", |s| s.wrench.force.x),
            curve(s, "y", |s| s.wrench.force.y),
            curve(s, "z", |s| s.wrench.force.z),
        ],
    );
    chart(
        "Torque",
        "On the hand, about the grip.",
        "torque (N·m)",
        &[
            curve(s, "size", |s| s.wrench.torque.length()),
            curve(s, "x", |s| s.wrench.torque.x),
            curve(s, "y", |s| s.wrench.torque.y),
            curve(s, "z", |s| s.wrench.torque.z),
        ],
    );
    chart(
        "Position of the moving part",
        "In the scene's frame.",
        "position (mm)",
        &[
            curve(s, "x", |s| 1e3 * s.object.translation.x),
            curve(s, "y", |s| 1e3 * s.object.translation.y),
            curve(s, "z", |s| 1e3 * s.object.translation.z),
        ],
    );
    chart(
        "Rotation of the moving part",
        "Rotation vector in the scene's frame.",
        "rotation (degrees)",
        &rotations(s),
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

fn rotations(samples: &[Sample]) -> Vec<Curve<'static>> {
    let vector = |s: &Sample| {
        fft_correlate::Pose::IDENTITY
            .twist_to(&s.object)
            .angular
            .map(f64::to_degrees)
    };
    ["x", "y", "z"]
        .into_iter()
        .enumerate()
        .map(|(k, label)| curve(samples, label, |s| vector(s)[k]))
        .collect()
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

fn timing(outcome: &Outcome) -> String {
    let report = &outcome.report;
    let mut html = String::from(
        "<h2>Time</h2>\n<table><tr><th></th><th>p50</th><th>p99</th><th>p99.9</th><th>max</th></tr>",
    );
    for (name, q) in [
        ("computing a tick (µs)", report.latency_us),
        ("start after the deadline (µs)", report.lateness_us),
    ] {
        let _ = write!(html, "<tr><td>{name}</td>");
        for value in [q.p50, q.p99, q.p999, q.max] {
            let _ = write!(html, "<td class='num'>{value:.1}</td>");
        }
        html += "</tr>";
    }
    html += "</table>\n";
    for (title, histogram) in [
        ("computing time of a tick (µs)", &outcome.latency),
        ("start after the deadline (µs)", &outcome.lateness),
    ] {
        html += &svg::histogram(title, &bins(histogram));
    }
    html
}

/// Ten bins per factor of ten, microseconds.
fn bins(histogram: &Histogram<u64>) -> Vec<(f64, f64, u64)> {
    const PER_DECADE: f64 = 10.0;
    let bin = |ns: u64| ((ns.max(10) as f64).log10() * PER_DECADE).floor() as i32;
    let mut counts = std::collections::BTreeMap::new();
    for value in histogram.iter_recorded() {
        *counts.entry(bin(value.value_iterated_to())).or_insert(0) +=
            value.count_since_last_iteration();
    }
    let edge = |k: i32| 10f64.powf(f64::from(k) / PER_DECADE) * 1e-3;
    counts
        .into_iter()
        .map(|(k, n)| (edge(k), edge(k + 1), n))
        .collect()
}

/// Samples at which one of `bits` comes on.
fn starts(samples: &[Sample], bits: u16) -> impl Iterator<Item = &Sample> {
    let mut last = 0;
    samples.iter().filter(move |s| {
        let new = s.flags & bits & !last;
        last = s.flags;
        new != 0
    })
}

fn names(set: u16) -> String {
    let named = flags::NAMES.iter().enumerate();
    let on = named.filter(|(bit, _)| set & (1 << bit) != 0);
    on.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}

fn events(run: &Run<'_>) -> String {
    let report = &run.outcome.report;
    let mut html = String::from("<h2>Events</h2>\n<table><tr><th>what</th><th>ticks</th></tr>");
    for (bit, name) in flags::NAMES.iter().enumerate() {
        let count = run.samples.iter().filter(|s| s.flags & (1 << bit) != 0);
        let _ = write!(
            html,
            "<tr><td>{}</td><td class='num'>{}</td></tr>",
            name.replace('_', " "),
            count.count()
        );
    }
    let _ = writeln!(
        html,
        "<tr><td>deadlines left out</td><td class='num'>{}</td></tr></table>",
        report.missed
    );
    let mut list: Vec<(f64, String)> = starts(run.samples, u16::MAX)
        .map(|s| (s.time, names(s.flags)))
        .collect();
    list.extend(run.events.iter().map(|e| {
        let before = run.outcome.began.saturating_duration_since(e.at);
        let after = e.at.saturating_duration_since(run.outcome.began);
        (
            after.as_secs_f64() - before.as_secs_f64(),
            format!("{}: {}", e.pair, told(&e.what)),
        )
    }));
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    html += "<table><tr><th>time (s)</th><th>what began</th></tr>";
    for (at, what) in list.iter().take(LISTED) {
        let _ = write!(
            html,
            "<tr><td class='num'>{at:.3}</td><td>{}</td></tr>",
            svg::escaped(what)
        );
    }
    html += "</table>\n";
    if list.len() > LISTED {
        let _ = writeln!(html, "<p>and {} more.</p>", list.len() - LISTED);
    }
    html
}

/// A scene event in words.
pub(super) fn told(what: &SceneChange) -> String {
    match what {
        SceneChange::Loaded { seconds, bytes } => {
            format!("loaded in {seconds:.2} s, {}", display_bytes(*bytes))
        }
        SceneChange::Reloaded { seconds, bytes } => {
            format!(
                "changed and loaded again in {seconds:.2} s, {}",
                display_bytes(*bytes)
            )
        }
        SceneChange::Unloaded => "unloaded to make room".to_owned(),
        SceneChange::Failed(why) => format!("cannot be loaded: {why}"),
        SceneChange::NoRoom { needed, free } => format!(
            "needs {} but only {} of the scene's memory can be made free",
            display_bytes(*needed),
            display_bytes(*free)
        ),
    }
}

fn conditions(run: &Run<'_>) -> String {
    let report = &run.outcome.report;
    let (spec, limits) = (run.spec, &run.config.limits);
    let mut rows: Vec<(String, String)> = privileges(report)
        .into_iter()
        .map(|(k, v)| (k.to_owned(), v))
        .collect();
    let mut row = |key: &str, value: String| rows.push((key.to_owned(), value));
    row("device", spec.name.clone());
    row(
        "degrees of freedom in, out",
        format!("{}, {}", spec.input_dof, spec.output_dof),
    );
    row(
        "device's greatest force, torque",
        format!("{} N, {} N·m", spec.max_force, spec.max_torque),
    );
    row(
        "limits on force, torque",
        format!("{} N, {} N·m", limits.force, limits.torque),
    );
    row(
        "limits on their rates",
        format!("{} N/s, {} N·m/s", limits.force_rate, limits.torque_rate),
    );
    row(
        "coupling in use",
        format!(
            "{} N/m, {} N·m/rad",
            report.stiffness, report.rotational_stiffness
        ),
    );
    row("rate asked for", format!("{} Hz", run.config.rate_hz));
    row(
        "ramp, decay, stale after",
        format!(
            "{} s, {} s, {} s",
            run.config.ramp_s, run.config.decay_s, run.config.stale_s
        ),
    );
    for (name, state) in &run.pairs {
        row(&format!("part {name}"), (*state).to_owned());
    }
    let mut html = String::from("<h2>Conditions</h2>\n<table>");
    for (key, value) in rows {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td></tr>",
            svg::escaped(&key),
            svg::escaped(&value)
        );
    }
    html + "</table>\n"
}

/// What the operating system granted, in words.
pub(super) fn privileges(report: &LoopReport) -> Vec<(&'static str, String)> {
    let yes = |granted: bool| if granted { "granted" } else { "not granted" };
    let mut rows = vec![
        ("SCHED_FIFO", yes(report.granted.fifo).to_owned()),
        ("locked memory", yes(report.granted.locked).to_owned()),
    ];
    rows.extend(report.granted.notes.iter().map(|n| ("note", n.clone())));
    rows
}
