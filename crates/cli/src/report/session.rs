//! Report of a haptic session: a page with the parts in space, curves, times, events and settings.

use fft_correlate::Pose;
use glam::DVec3;
use haptic::scene::{SceneChange, SceneEvent};
use haptic::{Clock, DeviceSpec, HapticConfig, LoopReport, Outcome, Sample, Script, flags};
use hdrhistogram::Histogram;
use pegfit_pictures::{LineChart, Mark, PictureError, Quantity, Series, number, reduced};
use sdf_grid::TriangleMesh;

use crate::bytes::display_bytes;
use crate::report::page::{CHART, Page, chart, escaped};
use crate::report::player::{Act, Player, run_poses};
use crate::report::screen::{Figure, SCRIPT, Screen, grouped};

/// Events listed; the rest is counted.
const LISTED: usize = 200;

/// Seconds over which the rate is a mean.
const RATE_WINDOW: f64 = 0.1;

/// A report of a run of the haptic loop: forces, timing, events and conditions.
#[derive(Debug)]
pub struct SessionReport<'a> {
    /// What the run is called.
    pub title: String,
    /// The scene's file, or the pair.
    pub subject: String,
    /// The device.
    pub spec: &'a DeviceSpec,
    /// Settings of the loop.
    pub config: &'a HapticConfig,
    /// The run, its samples kept ([`haptic::Session::keep_samples`]).
    pub outcome: &'a Outcome,
    /// Events of the scene.
    pub events: &'a [SceneEvent],
    /// Parts and the final state of each.
    pub pairs: Vec<(String, String)>,
    /// Surfaces in the scene, metres, the moving part's last, at the pose of its own frame; none
    /// shows no picture.
    pub parts: Vec<TriangleMesh>,
}

impl SessionReport<'_> {
    /// Title of a run: the script, if an operator followed one, and the device's name.
    #[must_use]
    pub fn title(script: Option<Script>, device: &str) -> String {
        match script {
            Some(Script::Collision) => format!("Collision test, {device}"),
            Some(Script::Snap) => format!("Snap test, {device}"),
            Some(Script::Free) => format!("Free wandering, {device}"),
            None => {
                let mut letters = device.chars();
                let first = letters.next().into_iter().flat_map(char::to_uppercase);
                first.chain(letters.clone()).collect()
            }
        }
    }
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

/// What a flag means to people, and what to do about it; flags that are the loop's usual work have no
/// words.
const WARNINGS: [(u16, &str, &str); 10] = [
    (
        flags::BAD_INPUT,
        "the device gave a pose that is none",
        "<code>pegfit devices --probe</code> shows what it gives.",
    ),
    (
        flags::STALE,
        "the device was silent for too long, so the force decayed",
        "Check its cable, and close what keeps this machine busy.",
    ),
    (
        flags::JUMP,
        "the device moved faster than a hand can",
        "<code>pegfit devices --probe</code> shows what it gives.",
    ),
    (
        flags::LATE | flags::OVERRUN,
        "the loop was late",
        "Close what keeps this machine busy, or bake a table (<code>pegfit bake</code>) and pass it \
         with <code>--table</code>.",
    ),
    (
        flags::BAD_SOURCE | flags::NOT_FINITE,
        "there was no energy at the pose, or the force was no number, and was left out",
        "Check the parts: <code>pegfit check</code>.",
    ),
    (
        flags::CLAMPED,
        "the force or torque was at its limit",
        "Walls feel softer there. If the device bears more, raise <code>force</code> or \
         <code>torque</code> under <code>[device.limits]</code> in the scene.",
    ),
    (
        flags::NOT_SENT,
        "the device did not take the force",
        "Check its cable and power: <code>pegfit devices</code>.",
    ),
    (
        flags::NOT_LOADED,
        "a part in reach was not in memory and pushed nothing",
        "Raise <code>memory_mib</code> or <code>ahead</code> under <code>[loading]</code> in the scene.",
    ),
    (
        flags::OUTSIDE,
        "the part was outside the table, where forces fade",
        "Bake the table with a larger <code>half_extent</code> under <code>[window]</code>.",
    ),
    (
        flags::NO_INPUT,
        "the device gave nothing",
        "Check its cable and power: <code>pegfit devices</code>.",
    ),
];

/// Ticks at the beginning in which a device need not have given anything.
const BEGINS: usize = 100;

/// Size of a chart beside the parts.
const BESIDE: (u32, u32) = (720, 520);

impl SessionReport<'_> {
    /// The page as HTML, in one file that needs no other: what happened on the first screen, the
    /// rest folded below.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        let mut page = Page::new(&self.title);
        page.paragraph(&format!("<code>{}</code>", escaped(&self.subject)));
        for warning in self.warnings() {
            page.push(&format!("<p class=\"warning\">{warning}</p>"));
        }
        let samples = &self.outcome.samples;
        let charts = [motion(samples), energy(samples)].concat();
        let drawn = charts.iter().map(|c| c.html(samples, BESIDE));
        let drawn: Vec<String> = drawn.collect::<Result<_, _>>()?;
        let figures = charts.iter().zip(&drawn).map(|(chart, html)| Figure {
            kind: chart.kind,
            name: chart.name,
            caption: chart.caption,
            html,
        });
        let screen = Screen {
            id: "run",
            heading: String::new(),
            player: &self.player(),
            rows: self.numbers(),
            figures: figures.collect(),
            end: String::new(),
        };
        page.push(&screen.html());
        page.folded("The loop: delays, rate, energy balance", |page| {
            self.add_loop(page)
        })?;
        page.folded("Events", |page| self.add_events(page));
        page.folded("Settings", |page| self.add_settings(page));
        Ok(page.finish(SCRIPT))
    }

    /// The parts in space; nothing if they are not there.
    fn player(&self) -> String {
        let Some(moving) = self.parts.len().checked_sub(1) else {
            return String::new();
        };
        let act = Act {
            said: String::new(),
            moving: vec![moving],
            staying: (0..moving).collect(),
            poses: run_poses(&self.outcome.samples),
        };
        Player {
            towards: "",
            parts: &self.parts.iter().collect::<Vec<_>>(),
            acts: vec![act],
            start: 0,
        }
        .html()
    }

    /// What went wrong, in words, with what to do.
    fn warnings(&self) -> Vec<String> {
        let samples = &self.outcome.samples;
        let mut said = Vec::new();
        let dropped = self.outcome.report.dropped_samples as usize;
        if dropped > 0 {
            said.push(format!(
                "{} ticks are missing here: they could not be written in time. Write the log to a \
                 faster disk.",
                grouped(dropped)
            ));
        }
        for (bits, what, help) in WARNINGS {
            let skipped = if bits == flags::NO_INPUT { BEGINS } else { 0 };
            let ticks = samples.iter().skip(skipped);
            let count = ticks.filter(|s| s.flags & bits != 0).count();
            if count > 0 {
                let (count, all) = (grouped(count), grouped(samples.len()));
                said.push(format!("In {count} of {all} ticks {what}. {help}"));
            }
        }
        said
    }

    /// The few numbers that matter.
    fn numbers(&self) -> Vec<(String, String)> {
        let (report, limits) = (&self.outcome.report, &self.config.limits);
        let energies = self.outcome.samples.iter().map(|s| 1e3 * s.energy);
        let (low, high) = energies
            .filter(|e| e.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), e| {
                (a.min(e), b.max(e))
            });
        let period = 1e6 / self.config.rate_hz;
        let mut rows = vec![
            (
                "greatest force",
                format!(
                    "{} N, limit {} N",
                    number(report.peak_force, 3),
                    number(limits.force.min(self.spec.max_force), 3)
                ),
            ),
            (
                "greatest torque",
                format!(
                    "{} N·m, limit {} N·m",
                    number(report.peak_torque, 3),
                    number(limits.torque.min(self.spec.max_torque), 3)
                ),
            ),
            (
                "time",
                format!(
                    "{} s, {} ticks",
                    number(report.seconds, 3),
                    grouped(report.ticks as usize)
                ),
            ),
            (
                "computing a tick",
                format!(
                    "{:.0} µs, 99 % within {:.0} µs; a tick has {period:.0} µs",
                    report.latency_us.p50, report.latency_us.p99
                ),
            ),
        ];
        if low <= high {
            let text = format!("{} to {} mJ", number(low, 3), number(high, 3));
            rows.insert(2, ("energy", text));
        }
        if report.clock == Clock::Real {
            rows.push((
                "rate",
                format!(
                    "{:.0} Hz of {:.0} Hz, {} ticks late",
                    report.rate_hz,
                    self.config.rate_hz,
                    grouped(report.overruns as usize)
                ),
            ));
        }
        rows.into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }

    fn add_loop(&self, page: &mut Page) -> Result<(), PictureError> {
        let (outcome, samples) = (self.outcome, &self.outcome.samples);
        let report = &outcome.report;
        let mut measures = vec![("computing a tick", report.latency_us, &outcome.latency)];
        // In simulated time every tick starts when it is due.
        if report.clock == Clock::Real {
            let late = ("start after the deadline", report.lateness_us);
            measures.push((late.0, late.1, &outcome.lateness));
        }
        let rows = measures.iter().map(|(name, q, _)| {
            let values = [q.p50, q.p99, q.p999, q.max].map(|value| number(value, 3));
            [vec![format!("{name} (µs)")], values.to_vec()].concat()
        });
        page.table(true, &["", "50 %", "99 %", "99.9 %", "most"], rows);
        for (name, _, histogram) in measures {
            let drawn = pegfit_pictures::Histogram {
                horizontal: format!("{name} (µs)"),
                vertical: "ticks".to_owned(),
                bins: bins(histogram),
            };
            page.push(&chart((CHART.0, 220), |size| {
                pegfit_pictures::svg(name, size, |sheet| drawn.draw(sheet))
            })?);
        }
        for figure in loop_state(samples) {
            page.push(&format!("<h3>{}</h3>", figure.name));
            page.paragraph(figure.caption);
            page.push(&figure.html(samples, CHART)?);
        }
        Ok(())
    }

    fn add_events(&self, page: &mut Page) {
        let (samples, began) = (&self.outcome.samples, self.outcome.began);
        let count = |bit: usize| samples.iter().filter(|s| s.flags & (1 << bit) != 0).count();
        let counts = flags::NAMES.iter().enumerate();
        let counts = counts.map(|(bit, name)| (name.replace('_', " "), count(bit)));
        let missed = self.outcome.report.missed as usize;
        let counts = counts.chain([("deadlines left out".to_owned(), missed)]);
        let there = counts.filter(|(_, count)| *count > 0);
        let rows = there.map(|(name, count)| vec![name, grouped(count)]);
        page.table(true, &["what", "ticks"], rows);
        let mut list: Vec<(f64, String)> = starts(samples, u16::MAX)
            .map(|s| (s.time, names(s.flags)))
            .collect();
        list.extend(self.events.iter().map(|e| {
            let before = began.saturating_duration_since(e.at);
            let after = e.at.saturating_duration_since(began);
            let what = format!("{}: {}", e.pair, event_text(&e.what));
            (after.as_secs_f64() - before.as_secs_f64(), what)
        }));
        list.sort_by(|a, b| a.0.total_cmp(&b.0));
        let listed = list.iter().take(LISTED);
        let rows = listed.map(|(at, what)| vec![format!("{at:.3}"), escaped(what)]);
        page.table(false, &["time (s)", "what began"], rows);
        if list.len() > LISTED {
            page.paragraph(&format!("and {} more.", list.len() - LISTED));
        }
    }

    fn add_settings(&self, page: &mut Page) {
        let (report, spec, config) = (&self.outcome.report, self.spec, self.config);
        let limits = &config.limits;
        let number = |value| number(value, 3);
        let both = |[a, b]: [f64; 2], [in_a, in_b]: [&str; 2]| {
            format!("{} {in_a}, {} {in_b}", number(a), number(b))
        };
        let mut rows: Vec<(String, String)> = privileges(report)
            .into_iter()
            .map(|(k, v)| (k.to_owned(), v))
            .collect();
        let greatest = [spec.max_force, spec.max_torque];
        let rates = [limits.force_rate, limits.torque_rate];
        let coupling = [report.stiffness, report.rotational_stiffness];
        let fixed = [
            ("device", spec.name.clone()),
            (
                "degrees of freedom in, out",
                format!("{}, {}", spec.input_dof, spec.output_dof),
            ),
            (
                "device's greatest force, torque",
                both(greatest, ["N", "N·m"]),
            ),
            (
                "limits on force, torque",
                both([limits.force, limits.torque], ["N", "N·m"]),
            ),
            ("limits on their rates", both(rates, ["N/s", "N·m/s"])),
            ("coupling in use", both(coupling, ["N/m", "N·m/rad"])),
            ("rate asked for", format!("{} Hz", number(config.rate_hz))),
            (
                "ramp, decay, stale after",
                [config.ramp_s, config.decay_s, config.stale_s]
                    .map(|seconds| format!("{} s", number(seconds)))
                    .join(", "),
            ),
        ];
        rows.extend(fixed.map(|(key, value)| (key.to_owned(), value)));
        let parts = self.pairs.iter();
        rows.extend(parts.map(|(name, state)| (format!("part {name}"), state.clone())));
        let rows = rows
            .iter()
            .map(|(key, value)| vec![escaped(key), escaped(value)]);
        page.table(false, &[], rows);
    }
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

/// Curves over time.
#[derive(Clone)]
struct Curves {
    kind: &'static str,
    name: &'static str,
    caption: &'static str,
    vertical: &'static str,
    series: Vec<Series>,
}

impl Curves {
    /// The chart; red lines mark where a part was exchanged or ticks were left out.
    fn html(&self, samples: &[Sample], size: (u32, u32)) -> Result<String, PictureError> {
        let marks = starts(samples, flags::CHANGED | flags::OVERRUN).take(LISTED);
        let marks = marks.map(|s| Mark {
            at: s.time,
            label: String::new(),
        });
        let lines = LineChart {
            horizontal: "time (s)".to_owned(),
            vertical: self.vertical.to_owned(),
            series: self.series.clone(),
            marks: marks.collect(),
            ..LineChart::default()
        };
        chart(size, |size| {
            pegfit_pictures::svg(self.name, size, |sheet| lines.draw(sheet))
        })
    }
}

/// Forces and motion.
fn motion(s: &[Sample]) -> Vec<Curves> {
    vec![
        Curves {
            kind: "force",
            name: "force",
            caption: "On the hand. Red lines: a part was loaded or exchanged, or ticks were left out.",
            vertical: "force (N)",
            series: with_size(s, Quantity::Force, |s| s.wrench.force),
        },
        Curves {
            kind: "torque",
            name: "torque",
            caption: "On the hand, about the grip.",
            vertical: "torque (N·m)",
            series: with_size(s, Quantity::Torque, |s| s.wrench.torque),
        },
        Curves {
            kind: "position",
            name: "position",
            caption: "Of the moving part, in the scene's frame.",
            vertical: "position (mm)",
            series: components(s, |s| 1e3 * s.object.translation),
        },
        Curves {
            kind: "rotation",
            name: "rotation",
            caption: "Of the moving part: rotation vector in the scene's frame.",
            vertical: "rotation (degrees)",
            series: components(s, |s| {
                Pose::IDENTITY
                    .twist_to(&s.object)
                    .angular
                    .map(f64::to_degrees)
            }),
        },
    ]
}

fn energy(s: &[Sample]) -> Vec<Curves> {
    vec![Curves {
        kind: "energy",
        name: "energy",
        caption: "Of the parts in reach, at the moving part's pose. Its slope is the force.",
        vertical: "energy (mJ)",
        series: vec![Series {
            quantity: Some(Quantity::Energy),
            ..curve(s, "energy", |s| 1e3 * s.energy)
        }],
    }]
}

/// Rate, ramp, cost and balance of the loop.
fn loop_state(s: &[Sample]) -> Vec<Curves> {
    vec![
        Curves {
            kind: "rate",
            name: "Rate",
            caption: "Mean over a tenth of a second, on the loop's clock.",
            vertical: "ticks per second",
            series: vec![series("rate", rate(s))],
        },
        Curves {
            kind: "strength",
            name: "Strength and coverage",
            caption: "The ramp's share of the force, and how far the energy is known: below one, a pair \
                      in reach is not loaded, or the part is outside a table.",
            vertical: "share",
            series: vec![
                curve(s, "strength", |s| s.gain),
                curve(s, "coverage", |s| s.coverage),
            ],
        },
        Curves {
            kind: "evaluations",
            name: "Evaluations",
            caption: "Energy evaluations in a tick.",
            vertical: "per tick",
            series: vec![curve(s, "evaluations", |s| f64::from(s.evaluations))],
        },
        Curves {
            kind: "bookkeeping",
            name: "Energy bookkeeping",
            caption: "Work of the hand through force and torque, energy made by sampling and lag, taken \
                      back by the passivity controller, and brought by exchanged parts.",
            vertical: "energy (mJ)",
            series: vec![
                curve(s, "work, force", |s| 1e3 * s.account.work_force),
                curve(s, "work, torque", |s| 1e3 * s.account.work_torque),
                curve(s, "made", |s| 1e3 * s.account.made),
                curve(s, "taken", |s| 1e3 * s.account.taken),
                curve(s, "exchanged", |s| 1e3 * s.account.exchanged),
            ],
        },
        Curves {
            kind: "balance",
            name: "Passivity balance",
            caption: "Below zero the controller damps.",
            vertical: "balance (mJ)",
            series: vec![curve(s, "balance", |s| 1e3 * s.account.balance)],
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

/// The length first, then the components.
fn with_size(
    samples: &[Sample],
    quantity: Quantity,
    vector: impl Fn(&Sample) -> DVec3,
) -> Vec<Series> {
    let mut curves = vec![Series {
        quantity: Some(quantity),
        ..curve(samples, "size", |s| vector(s).length())
    }];
    curves.extend(components(samples, vector));
    curves
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

/// Text of a scene event.
pub(crate) fn event_text(what: &SceneChange) -> String {
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
        SceneChange::Opened { rotations, each } => format!(
            "table opened, {rotations} rotations of {} each",
            display_bytes(*each)
        ),
        SceneChange::Complete { bytes } => {
            format!(
                "all rotations of the table loaded, {}",
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

/// Text of what the operating system granted.
pub(crate) fn privileges(report: &LoopReport) -> Vec<(&'static str, String)> {
    let yes = |granted: bool| if granted { "granted" } else { "not granted" };
    let mut rows = vec![
        ("SCHED_FIFO", yes(report.granted.fifo).to_owned()),
        ("locked memory", yes(report.granted.locked).to_owned()),
    ];
    rows.extend(report.granted.notes.iter().map(|n| ("note", n.clone())));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_flag_is_usual_work_or_has_words() {
        let told = WARNINGS.iter().fold(0, |all, (bits, ..)| all | bits);
        let usual = flags::SLEWED | flags::DAMPED | flags::CHANGED;
        assert_eq!(told & usual, 0);
        assert_eq!(told | usual, (1 << flags::NAMES.len()) - 1);
    }
}
