//! Which of many measurements are worth their cost: no other is both cheaper and more accurate.

use pegfit_pictures::{LineChart, Series};

use crate::Outcome;

/// Indices of the points `(cost, error)` that no other one beats in both, cheapest first. Points
/// that are not finite are on no frontier.
pub fn frontier(points: &[(f64, f64)]) -> Vec<usize> {
    let finite = |i: &usize| points[*i].0.is_finite() && points[*i].1.is_finite();
    let mut order: Vec<usize> = (0..points.len()).filter(finite).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (points[a], points[b]);
        a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    let mut best = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i].1 < best;
        best = best.min(points[i].1);
        better
    });
    order
}

/// Measurements of one kind: a colour and a word in the legend.
#[derive(Debug, Clone)]
pub struct Kind {
    /// For the legend.
    pub label: String,
    /// `(cost, error)` of each.
    pub points: Vec<(f64, f64)>,
}

/// One panel: error against one cost.
#[derive(Debug, Clone)]
pub struct ParetoPanel {
    /// Above it.
    pub title: String,
    /// What the cost is, with its unit.
    pub cost: String,
    /// What the error is one of.
    pub error: String,
    /// The measurements.
    pub kinds: Vec<Kind>,
}

impl ParetoPanel {
    /// Both axes logarithmic; the frontier is a line, all measurements are dots.
    fn chart(&self) -> LineChart {
        let log = |(cost, error): (f64, f64)| (cost.log10(), error.max(1e-9).log10());
        let all: Vec<(f64, f64)> = self.kinds.iter().flat_map(|k| k.points.clone()).collect();
        let best = frontier(&all);
        let mut series = vec![Series {
            label: "efficient frontier".into(),
            points: best.iter().map(|&i| log(all[i])).collect(),
            ..Series::default()
        }];
        series.extend(self.kinds.iter().map(|kind| Series {
            label: kind.label.clone(),
            points: kind.points.iter().map(|&p| log(p)).collect(),
            dots: true,
            ..Series::default()
        }));
        LineChart {
            title: self.title.clone(),
            horizontal: self.cost.clone(),
            vertical: self.error.clone(),
            series,
            logarithmic: [true; 2],
            ..LineChart::default()
        }
    }
}

/// Panels side by side, as PNG.
///
/// # Errors
/// If the picture cannot be drawn.
pub fn draw(panels: &[ParetoPanel]) -> Outcome<Vec<u8>> {
    let size = (900 * panels.len() as u32, 640);
    Ok(pegfit_pictures::png("pareto", size, |sheet| {
        let areas = sheet.split_evenly((1, panels.len()));
        for (panel, area) in panels.iter().zip(&areas) {
            panel.chart().draw(area)?;
        }
        Ok(())
    })?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_nothing_beats_is_on_the_frontier() {
        let points = [
            (1.0, 5.0),
            (2.0, 6.0),
            (3.0, 2.0),
            (3.0, 3.0),
            (4.0, 2.0),
            (f64::NAN, 0.0),
            (9.0, 1.0),
        ];
        assert_eq!(frontier(&points), [0, 2, 6]);
    }
}
