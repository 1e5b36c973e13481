//! Report of a haptic session: a page with curves, times, events and conditions.

use fft_correlate::Pose;
use glam::DVec3;
use haptic::scene::{SceneChange, SceneEvent};
use haptic::{DeviceSpec, HapticConfig, LoopReport, Outcome, Sample, Script, flags};
use hdrhistogram::Histogram;
use pegfit_pictures::{LineChart, Mark, PictureError, Quantity, Series, reduced};

use crate::bytes::display_bytes;
use crate::report::page::{CHART, Page, chart, escaped};

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

impl SessionReport<'_> {
    /// The page as HTML, in one file that needs no other.
    ///
    /// # Errors
    /// If a chart cannot be drawn.
    pub fn html(&self) -> Result<String, PictureError> {
        let report = &self.outcome.report;
        let mut page = Page::new(&self.title);
        page.paragraph(&format!(
            "<code>{}</code>. {} ticks in {:.2} s, {:.1} per second; peak force {:.3} N, peak \
             torque {:.4} N·m.",
            escaped(&self.subject),
            report.ticks,
            report.seconds,
            report.rate_hz,
            report.peak_force,
            report.peak_torque
        ));
        if report.dropped_samples > 0 {
            page.paragraph(&format!(
                "<strong>{} ticks are missing below: they could not be written in time.</strong>",
                report.dropped_samples
            ));
        }
        self.add_charts(&mut page)?;
        self.add_timing(&mut page)?;
        self.add_events(&mut page);
        self.add_conditions(&mut page);
        Ok(page.finish(""))
    }

    fn add_charts(&self, page: &mut Page) -> Result<(), PictureError> {
        let samples = &self.outcome.samples;
        let marks: Vec<Mark> = starts(samples, flags::CHANGED | flags::OVERRUN)
            .take(LISTED)
            .map(|s| Mark {
                at: s.time,
                label: String::new(),
            })
            .collect();
        let figures = [motion(samples), energies(samples), loop_state(samples)];
        for (heading, words, vertical, series) in figures.into_iter().flatten() {
            let lines = LineChart {
                horizontal: "time (s)".to_owned(),
                vertical: vertical.to_owned(),
                series,
                marks: marks.clone(),
                ..LineChart::default()
            };
            page.heading(heading);
            page.paragraph(words);
            page.push(&chart(CHART, |size| {
                pegfit_pictures::svg(heading, size, |sheet| lines.draw(sheet))
            })?);
        }
        Ok(())
    }

    fn add_timing(&self, page: &mut Page) -> Result<(), PictureError> {
        let (report, outcome) = (&self.outcome.report, self.outcome);
        let measures = [
            ("computing a tick (µs)", report.latency_us),
            ("start after the deadline (µs)", report.lateness_us),
        ];
        page.heading("Time");
        let rows = measures.map(|(name, q)| {
            let values = [q.p50, q.p99, q.p999, q.max].map(|value| format!("{value:.1}"));
            [vec![name.to_owned()], values.to_vec()].concat()
        });
        page.table(true, &["", "p50", "p99", "p99.9", "max"], rows);
        for (title, histogram) in [
            ("computing time of a tick (µs)", &outcome.latency),
            ("start after the deadline (µs)", &outcome.lateness),
        ] {
            let drawn = pegfit_pictures::Histogram {
                horizontal: title.to_owned(),
                vertical: "ticks".to_owned(),
                bins: bins(histogram),
            };
            page.push(&chart((CHART.0, 220), |size| {
                pegfit_pictures::svg(title, size, |sheet| drawn.draw(sheet))
            })?);
        }
        Ok(())
    }

    fn add_events(&self, page: &mut Page) {
        let (samples, began) = (&self.outcome.samples, self.outcome.began);
        page.heading("Events");
        let count = |bit: usize| samples.iter().filter(|s| s.flags & (1 << bit) != 0).count();
        let counts = flags::NAMES.iter().enumerate();
        let counts = counts.map(|(bit, name)| vec![name.replace('_', " "), count(bit).to_string()]);
        let missed = vec![
            "deadlines left out".to_owned(),
            self.outcome.report.missed.to_string(),
        ];
        page.table(true, &["what", "ticks"], counts.chain([missed]));
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

    fn add_conditions(&self, page: &mut Page) {
        let (report, spec, config) = (&self.outcome.report, self.spec, self.config);
        let limits = &config.limits;
        let mut rows: Vec<(String, String)> = privileges(report)
            .into_iter()
            .map(|(k, v)| (k.to_owned(), v))
            .collect();
        let fixed = [
            ("device", spec.name.clone()),
            (
                "degrees of freedom in, out",
                format!("{}, {}", spec.input_dof, spec.output_dof),
            ),
            (
                "device's greatest force, torque",
                format!("{} N, {} N·m", spec.max_force, spec.max_torque),
            ),
            (
                "limits on force, torque",
                format!("{} N, {} N·m", limits.force, limits.torque),
            ),
            (
                "limits on their rates",
                format!("{} N/s, {} N·m/s", limits.force_rate, limits.torque_rate),
            ),
            (
                "coupling in use",
                format!(
                    "{} N/m, {} N·m/rad",
                    report.stiffness, report.rotational_stiffness
                ),
            ),
            ("rate asked for", format!("{} Hz", config.rate_hz)),
            (
                "ramp, decay, stale after",
                format!(
                    "{} s, {} s, {} s",
                    config.ramp_s, config.decay_s, config.stale_s
                ),
            ),
        ];
        rows.extend(fixed.map(|(key, value)| (key.to_owned(), value)));
        let parts = self.pairs.iter();
        rows.extend(parts.map(|(name, state)| (format!("part {name}"), state.clone())));
        page.heading("Conditions");
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

/// Heading, explanation, vertical axis and curves of a chart.
type Figure = (&'static str, &'static str, &'static str, Vec<Series>);

/// Forces and motion.
fn motion(s: &[Sample]) -> Vec<Figure> {
    vec![
        (
            "Force",
            "On the operator. Red lines: a part was exchanged, or ticks were left out.",
            "force (N)",
            with_size(s, Quantity::Force, |s| s.wrench.force),
        ),
        (
            "Torque",
            "On the operator, about the grip.",
            "torque (N·m)",
            with_size(s, Quantity::Torque, |s| s.wrench.torque),
        ),
        (
            "Position of the moving part",
            "In the scene's frame.",
            "position (mm)",
            components(s, |s| 1e3 * s.object.translation),
        ),
        (
            "Rotation of the moving part",
            "Rotation vector in the scene's frame.",
            "rotation (degrees)",
            components(s, |s| {
                Pose::IDENTITY
                    .twist_to(&s.object)
                    .angular
                    .map(f64::to_degrees)
            }),
        ),
    ]
}

/// Energy and its bookkeeping.
fn energies(s: &[Sample]) -> Vec<Figure> {
    vec![
        (
            "Energy of the scene",
            "Summed over the pairs in reach, at the virtual object.",
            "energy (J)",
            vec![Series {
                quantity: Some(Quantity::Energy),
                ..curve(s, "energy", |s| s.energy)
            }],
        ),
        (
            "Energy bookkeeping",
            "Work of the operator through force and torque, energy made by sampling and lag, taken \
             back by the passivity controller, and brought by exchanged parts.",
            "energy (J)",
            vec![
                curve(s, "work, force", |s| s.account.work_force),
                curve(s, "work, torque", |s| s.account.work_torque),
                curve(s, "made", |s| s.account.made),
                curve(s, "taken", |s| s.account.taken),
                curve(s, "exchanged", |s| s.account.exchanged),
            ],
        ),
        (
            "Passivity balance",
            "Below zero the controller damps.",
            "balance (mJ)",
            vec![curve(s, "balance", |s| 1e3 * s.account.balance)],
        ),
    ]
}

/// Rate, ramp and cost of the loop.
fn loop_state(s: &[Sample]) -> Vec<Figure> {
    vec![
        (
            "Rate",
            "Mean over a tenth of a second, on the loop's clock.",
            "ticks per second",
            vec![series("rate", rate(s))],
        ),
        (
            "Strength and coverage",
            "The ramp's share of the force, and how far the energy is known: below one, a pair in \
             reach is not loaded, or the part is outside a table.",
            "share",
            vec![
                curve(s, "strength", |s| s.gain),
                curve(s, "coverage", |s| s.coverage),
            ],
        ),
        (
            "Evaluations",
            "Energy evaluations in a tick.",
            "per tick",
            vec![curve(s, "evaluations", |s| f64::from(s.evaluations))],
        ),
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
