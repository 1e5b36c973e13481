//! Energy and force along a way.

use std::path::Path;

use pegfit_path::{PathAnswer, PathPose};
use pegfit_pictures::{LineChart, Series};
use pegfit_scene::SceneSetup;
use sdf_grid::atomic;

use crate::error::CommandError;

/// Width and height of a chart on a page.
const SIZE: (u32, u32) = (960, 310);

/// The energy, and the sizes of force and torque, against the way gone; none without energies.
fn charts(answer: &PathAnswer, setup: &SceneSetup) -> Option<[LineChart; 2]> {
    let unit = setup.display_unit();
    let metre = unit.in_metres();
    answer.poses.first()?.response?;
    let curve = |label: &str, value: fn(&PathPose) -> f64| Series {
        label: label.to_owned(),
        points: answer
            .poses
            .iter()
            .map(|p| (p.length / metre, value(p)))
            .collect(),
        ..Series::default()
    };
    let energy = curve("", |p| 1e3 * p.response.unwrap_or_default().energy);
    let force = curve("force (N)", |p| {
        p.response.unwrap_or_default().wrench.force.length()
    });
    let torque = curve("torque (N cm)", |p| {
        100.0 * p.response.unwrap_or_default().wrench.torque.length()
    });
    let chart = |vertical: &str, series: Vec<Series>| LineChart {
        horizontal: format!("way in ({unit})"),
        vertical: vertical.to_owned(),
        series,
        ..LineChart::default()
    };
    Some([
        chart("energy (mJ)", vec![energy]),
        chart("on the part", vec![force, torque]),
    ])
}

/// Writes both charts as a picture.
pub(super) fn draw(
    answer: &PathAnswer,
    setup: &SceneSetup,
    file: &Path,
) -> Result<(), CommandError> {
    let Some(charts) = charts(answer, setup) else {
        crate::remark!("no way to draw: {} is not written", file.display());
        return Ok(());
    };
    let bytes = pegfit_pictures::png("energy and force along the way", (1300, 1000), |sheet| {
        for (panel, chart) in sheet.split_evenly((2, 1)).iter().zip(&charts) {
            chart.draw(panel)?;
        }
        Ok(())
    })?;
    Ok(atomic::write(file, &bytes)?)
}

/// Both charts for a page.
pub(super) fn svg(answer: &PathAnswer, setup: &SceneSetup) -> Result<String, CommandError> {
    let mut text = String::new();
    for chart in charts(answer, setup).iter().flatten() {
        text += &pegfit_pictures::svg(&chart.vertical, SIZE, |sheet| chart.draw(sheet))?;
        text.push('\n');
    }
    Ok(text)
}
