//! Counts over a logarithmic axis.

use plotters::prelude::*;

use crate::axis::Axis;
use crate::canvas::{Area, Drawing, PAPER};
use crate::rules::{FAINT, GRID, INK, SERIES, text, text_size, tick_count};

/// Counts in bins; both axes are logarithmic.
#[derive(Debug, Clone, Default)]
pub struct Histogram {
    /// Under the horizontal axis, with its unit.
    pub horizontal: String,
    /// Beside the vertical axis.
    pub vertical: String,
    /// From, to (both above zero), count; in order.
    pub bins: Vec<(f64, f64, u64)>,
}

/// Where bars begin: a count of one is a bar, too.
const FLOOR: f64 = 0.5;

impl Histogram {
    /// Draws the histogram into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw<DB: DrawingBackend>(&self, panel: &Area<DB>) -> Drawing
    where
        DB::ErrorType: 'static,
    {
        let size = text_size(panel);
        let (low, high) = match (self.bins.first(), self.bins.last()) {
            (Some(first), Some(last)) => (first.0, last.1),
            _ => (1.0, 10.0),
        };
        let most = self.bins.iter().map(|b| b.2).max().unwrap_or(1).max(1);
        let (width, height) = panel.dim_in_pixel();
        let across = Axis::logarithmic([low, high], tick_count(width, size, 6));
        let mut up = Axis::logarithmic([1.0, 1.3 * most as f64], tick_count(height, size, 3));
        up.range[0] = FLOOR.log10();
        let mut chart = ChartBuilder::on(panel)
            .margin(size)
            .margin_top(size / 2)
            .margin_right(2 * size)
            .x_label_area_size(3 * size)
            .y_label_area_size(4 * size + size / 2)
            .build_cartesian_2d(across.clone(), up.clone())?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(PAPER.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_desc(&self.horizontal)
            .y_desc(&self.vertical)
            .x_labels(across.ticks.len())
            .y_labels(up.ticks.len())
            .x_label_formatter(&|v| across.label(*v))
            .y_label_formatter(&|v| up.label(*v))
            .label_style(text(size, INK))
            .axis_desc_style(text(size, INK))
            .draw()?;
        let filled = self.bins.iter().filter(|b| b.2 > 0);
        chart.draw_series(filled.map(|&(from, to, count)| {
            let ends = [(from, FLOOR), (to, count as f64)];
            Rectangle::new(
                ends.map(|(x, y)| (x.log10(), y.log10())),
                SERIES[0].filled(),
            )
        }))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::svg;

    #[test]
    fn every_bin_that_holds_something_is_a_bar() {
        let bars = |bins: &[(f64, f64, u64)]| {
            let histogram = Histogram {
                bins: bins.to_vec(),
                ..Histogram::default()
            };
            let text = svg("test", (400, 200), |sheet| histogram.draw(sheet)).unwrap();
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
            text.matches("<rect").count()
        };
        let few = Histogram {
            bins: vec![(7.9, 10.0, 3)],
            ..Histogram::default()
        };
        let text = svg("test", (960, 220), |sheet| few.draw(sheet)).unwrap();
        for label in ["5", "10", "1", "2"] {
            let there = text
                .split("</text>")
                .any(|t| t.trim_end().ends_with(&format!("\n{label}")));
            assert!(there, "no tick {label}: {text}");
        }
        assert_eq!(bars(&[]), 0);
        assert_eq!(bars(&[(1.0, 2.0, 5), (2.0, 4.0, 0), (4.0, 8.0, 1)]), 2);
    }
}
