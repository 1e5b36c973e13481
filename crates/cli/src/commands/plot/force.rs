//! Force against time in the paper's two tests (figure 7).

use fft_correlate::DirectOptions;
use haptic::{Clock, Sample, Script};
use pegfit_pictures::{LineChart, Series};
use pegfit_scene::Assembly;

use crate::commands::hand;
use crate::context::Context;
use crate::error::CommandError;

/// Seconds of each test.
const SECONDS: f64 = 8.0;

/// Runs the collision and the snap test in simulated time and draws both.
pub(super) fn both_tests(assembly: &Assembly, context: &Context) -> Result<Vec<u8>, CommandError> {
    let source = assembly.source(&DirectOptions::REAL_TIME)?;
    let mut charts = Vec::new();
    for (script, title) in [
        (
            Script::Collision,
            "Collision test: pushed against the walls",
        ),
        (Script::Snap, "Snap test: let go near the fit"),
    ] {
        context.progress.note(&format!("{title} ..."));
        let run = hand::run_simulated(assembly, &source, script, SECONDS, Clock::Simulated)?;
        charts.push(force_chart(title.to_owned(), &run.samples));
    }
    let picture = pegfit_pictures::png("force against time", (1300, 1100), |sheet| {
        for (panel, chart) in sheet.split_evenly((2, 1)).iter().zip(&charts) {
            chart.draw(panel)?;
        }
        Ok(())
    })?;
    Ok(picture)
}

/// The force on the hand, its size and components.
pub(in crate::commands) fn force_chart(title: String, samples: &[Sample]) -> LineChart {
    let series = |label: &str, value: &dyn Fn(&Sample) -> f64| Series {
        label: label.to_owned(),
        points: samples.iter().map(|s| (s.time, value(s))).collect(),
        ..Series::default()
    };
    LineChart {
        title,
        horizontal: "time (s)".to_owned(),
        vertical: "force on the hand (N)".to_owned(),
        series: vec![
            series("size", &|s| s.wrench.force.length()),
            series("x", &|s| s.wrench.force.x),
            series("y", &|s| s.wrench.force.y),
            series("z", &|s| s.wrench.force.z),
        ],
        ..LineChart::default()
    }
}
