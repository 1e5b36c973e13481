//! Energy and force along a way.

use pegfit_path::PathPose;
use pegfit_pictures::{LineChart, PictureError, Series};

use super::subject::WayReport;

/// Width and height of a chart on a page.
const SIZE: (u32, u32) = (960, 310);

/// The energy, and the sizes of force and torque, against the way gone; none without energies.
fn charts(way: &WayReport) -> Option<[LineChart; 2]> {
    let (answer, unit) = (&way.answer, way.unit);
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

impl WayReport {
    /// Energy, force and torque along the way as a picture (PNG); none without energies.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn png(&self) -> Result<Option<Vec<u8>>, PictureError> {
        let Some(charts) = charts(self) else {
            return Ok(None);
        };
        let title = "energy and force along the way";
        let bytes = pegfit_pictures::png(title, (1300, 1000), |sheet| {
            for (panel, chart) in sheet.split_evenly((2, 1)).iter().zip(&charts) {
                chart.draw(panel)?;
            }
            Ok(())
        })?;
        Ok(Some(bytes))
    }
}

/// Both charts for a page.
pub(super) fn svg(way: &WayReport) -> Result<String, PictureError> {
    let mut text = String::new();
    for chart in charts(way).iter().flatten() {
        text += &pegfit_pictures::svg(&chart.vertical, SIZE, |sheet| chart.draw(sheet))?;
        text.push('\n');
    }
    Ok(text)
}
