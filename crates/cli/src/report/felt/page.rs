//! The text of the page: one file that needs no other.

use std::fmt::Write;

use haptic::{Outcome, flags};
use hdrhistogram::Histogram;
use pegfit_pictures::PictureError;

use super::charts::charts;
use super::subject::{FeltPage, LISTED, names, starts};
use super::words::{privileges, told};
use crate::report::html::{STYLE, escaped};

/// What the charts need beside the demo's style.
const CHARTS: &str = "svg{width:100%;height:auto}\
svg text{fill:currentColor;font-family:system-ui,sans-serif}\
table{margin-bottom:1.5rem}th,td{text-align:left}td.num,th.num{text-align:right}";

impl FeltPage<'_> {
    /// The page as HTML, in one file that needs no other.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        page(self)
    }
}

fn page(run: &FeltPage<'_>) -> Result<String, PictureError> {
    let mut html = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{0}</title>\n<style>\n{STYLE}\n{CHARTS}</style>\n<main>\n<h1>{0}</h1>\n",
        escaped(&run.title)
    );
    let report = &run.outcome.report;
    let _ = writeln!(
        html,
        "<p><code>{}</code>. {} ticks in {:.2} s, {:.1} per second; peak force {:.3} N, peak \
         torque {:.4} N·m.</p>",
        escaped(&run.subject),
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
    html += &charts(run)?;
    html += &timing(run.outcome)?;
    html += &events(run);
    html += &conditions(run);
    Ok(html + "</main>\n</html>\n")
}

fn timing(outcome: &Outcome) -> Result<String, PictureError> {
    let report = &outcome.report;
    let mut html = String::from("<h2>Time</h2>\n<table><tr><th></th>");
    for quantile in ["p50", "p99", "p99.9", "max"] {
        let _ = write!(html, "<th class='num'>{quantile}</th>");
    }
    html += "</tr>";
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
        let drawn = pegfit_pictures::Histogram {
            horizontal: title.to_owned(),
            vertical: "ticks".to_owned(),
            bins: bins(histogram),
        };
        html += &pegfit_pictures::svg(title, (960, 220), |sheet| drawn.draw(sheet))?;
    }
    Ok(html)
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

fn events(run: &FeltPage<'_>) -> String {
    let report = &run.outcome.report;
    let mut html =
        String::from("<h2>Events</h2>\n<table><tr><th>what</th><th class='num'>ticks</th></tr>");
    for (bit, name) in flags::NAMES.iter().enumerate() {
        let count = run
            .outcome
            .samples
            .iter()
            .filter(|s| s.flags & (1 << bit) != 0);
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
    let mut list: Vec<(f64, String)> = starts(&run.outcome.samples, u16::MAX)
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
        let _ = write!(html, "<tr><td>{at:.3}</td><td>{}</td></tr>", escaped(what));
    }
    html += "</table>\n";
    if list.len() > LISTED {
        let _ = writeln!(html, "<p>and {} more.</p>", list.len() - LISTED);
    }
    html
}

fn conditions(run: &FeltPage<'_>) -> String {
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
        row(&format!("part {name}"), state.clone());
    }
    let mut html = String::from("<h2>Conditions</h2>\n<table>");
    for (key, value) in rows {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td></tr>",
            escaped(&key),
            escaped(&value)
        );
    }
    html + "</table>\n"
}
