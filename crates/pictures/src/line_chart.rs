//! Curves over a common axis, and their reduction to what a chart can show.

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::canvas::GRID;
use crate::canvas::{
    Area, Drawing, EVENT, FAINT, INK, PAPER, stroke, text, text_size, tick, titled,
};
use crate::colour::SERIES;

/// Curves over a common axis.
#[derive(Debug, Clone, Default)]
pub struct LineChart {
    /// Above the chart.
    pub title: String,
    /// Under the horizontal axis, with its unit.
    pub horizontal: String,
    /// Beside the vertical axis, with its unit.
    pub vertical: String,
    /// The curves.
    pub series: Vec<Series>,
    /// Vertical lines, with a word each or, thin and red, without.
    pub marks: Vec<Mark>,
    /// Least height of the vertical axis, so that small ripples look small.
    pub least_span: f64,
}

/// One curve.
#[derive(Debug, Clone, Default)]
pub struct Series {
    /// For the legend; no entry if empty.
    pub label: String,
    /// Points in drawing order.
    pub points: Vec<(f64, f64)>,
    /// Draw it dashed.
    pub dashed: bool,
    /// Draw the points as dots, not joined.
    pub dots: bool,
    /// Draw a fine line, for many points.
    pub thin: bool,
}

/// A vertical line that says what happens there.
#[derive(Debug, Clone)]
pub struct Mark {
    /// Where.
    pub at: f64,
    /// What; no text if empty.
    pub label: String,
}

impl LineChart {
    /// Draws the chart into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw<DB: DrawingBackend>(&self, panel: &Area<DB>) -> Drawing
    where
        DB::ErrorType: 'static,
    {
        let size = text_size(panel);
        let rest = titled(panel, &self.title)?;
        let ([x0, x1], [y0, y1]) = self.ranges();
        let mut chart = ChartBuilder::on(&rest)
            .margin(size)
            .margin_top(size / 2)
            .x_label_area_size(3 * size)
            .y_label_area_size(4 * size + size / 2)
            .build_cartesian_2d(x0..x1, y0..y1)?;
        chart
            .configure_mesh()
            .light_line_style(PAPER.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_desc(&self.horizontal)
            .y_desc(&self.vertical)
            .x_labels(9)
            .y_labels(8)
            .x_label_formatter(&|v| tick(*v, [x0, x1]))
            .y_label_formatter(&|v| tick(*v, [y0, y1]))
            .label_style(text(size, INK))
            .axis_desc_style(text(size, INK))
            .draw()?;
        for mark in &self.marks {
            mark.draw(&mut chart, size, [x0, x1], [y0, y1])?;
        }
        for (index, series) in self.series.iter().enumerate() {
            series.draw(&mut chart, SERIES[index % SERIES.len()])?;
        }
        if self.series.iter().any(|s| !s.label.is_empty()) {
            chart
                .configure_series_labels()
                .background_style(PAPER.mix(0.85))
                .border_style(GRID)
                .legend_area_size(stroke(32))
                .label_font(text(size, INK))
                .position(SeriesLabelPosition::UpperRight)
                .draw()?;
        }
        Ok(())
    }

    fn ranges(&self) -> ([f64; 2], [f64; 2]) {
        let points = || {
            self.series
                .iter()
                .flat_map(|s| s.points.iter().copied())
                .filter(|(x, y)| x.is_finite() && y.is_finite())
        };
        let [y0, y1] = spread(points().map(|p| p.1));
        let margin = (0.06 * (y1 - y0)).max(0.5 * (self.least_span - (y1 - y0)));
        (spread(points().map(|p| p.0)), [y0 - margin, y1 + margin])
    }
}

/// A chart with both axes in numbers.
type Chart<'a, DB> = ChartContext<'a, DB, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

impl Mark {
    fn draw<DB: DrawingBackend>(
        &self,
        chart: &mut Chart<'_, DB>,
        size: u32,
        [x0, x1]: [f64; 2],
        [y0, y1]: [f64; 2],
    ) -> Drawing
    where
        DB::ErrorType: 'static,
    {
        let line = vec![(self.at, y0), (self.at, y1)];
        if self.label.is_empty() {
            let style = EVENT.stroke_width(stroke(1));
            chart.draw_series([PathElement::new(line, style)])?;
            return Ok(());
        }
        chart.draw_series(DashedLineSeries::new(
            line,
            stroke(4),
            stroke(5),
            FAINT.stroke_width(stroke(1)),
        ))?;
        let label = text(size, FAINT);
        let place = (self.at + 0.005 * (x1 - x0), y1 - 0.01 * (y1 - y0));
        chart.draw_series([Text::new(self.label.clone(), place, label)])?;
        Ok(())
    }
}

impl Series {
    fn draw<DB: DrawingBackend>(&self, chart: &mut Chart<'_, DB>, colour: RGBColor) -> Drawing
    where
        DB::ErrorType: 'static,
    {
        let style = colour.stroke_width(stroke(2) + 1);
        let points = self.points.iter().copied();
        let drawn = if self.dots {
            chart.draw_series(points.map(|p| Circle::new(p, stroke(2), colour.filled())))?
        } else if self.dashed {
            chart.draw_series(DashedLineSeries::new(points, stroke(9), stroke(6), style))?
        } else if self.thin {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(stroke(1))))?
        } else {
            // Piece by piece: the joins of one thick line go astray where a curve turns sharply.
            chart.draw_series(
                self.points
                    .windows(2)
                    .map(|pair| PathElement::new(pair.to_vec(), style)),
            )?
        };
        if !self.label.is_empty() {
            drawn.label(&self.label).legend(move |(x, y)| {
                PathElement::new(vec![(x, y), (x + stroke(22) as i32, y)], style)
            });
        }
        Ok(())
    }
}

/// Least and greatest value; a range of some width if there is none.
fn spread(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
        (a.min(v), b.max(v))
    });
    match () {
        () if low < high => [low, high],
        () if low == high => [low - 0.5, low + 0.5],
        () => [0.0, 1.0],
    }
}

/// Columns a curve is reduced to: more could not be seen.
const COLUMNS: usize = 900;

/// The lowest and highest point of each of [`COLUMNS`] columns, in order of `x`: what a line drawn
/// through all points would cover.
pub fn reduced(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let ends = |p: Option<&(f64, f64)>| p.map_or(0.0, |p| p.0);
    let (low, high) = (ends(points.first()), ends(points.last()));
    let finite = points.iter().copied().filter(|p| p.1.is_finite());
    if points.len() <= 2 * COLUMNS {
        return finite.collect();
    }
    let column = |x: f64| ((x - low) / (high - low) * COLUMNS as f64) as usize;
    let mut out: Vec<(f64, f64)> = Vec::with_capacity(2 * COLUMNS + 2);
    let mut current: Option<Column> = None;
    for p in finite {
        let index = column(p.0);
        match &mut current {
            Some(c) if c.index == index => {
                c.least = if p.1 < c.least.1 { p } else { c.least };
                c.most = if p.1 > c.most.1 { p } else { c.most };
            }
            other => {
                out.extend(other.take().into_iter().flat_map(Column::points));
                *other = Some(Column {
                    index,
                    least: p,
                    most: p,
                });
            }
        }
    }
    out.extend(current.into_iter().flat_map(Column::points));
    out
}

/// The lowest and the highest point of one column.
struct Column {
    index: usize,
    least: (f64, f64),
    most: (f64, f64),
}

impl Column {
    /// One point or two, in order of `x`.
    fn points(self) -> impl Iterator<Item = (f64, f64)> {
        let (first, second) = match self.least.0 <= self.most.0 {
            true => (self.least, self.most),
            false => (self.most, self.least),
        };
        std::iter::once(first).chain((first != second).then_some(second))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reduced_curve_keeps_its_peaks() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        points[54_322].1 = -3.0;
        let few = reduced(&points);
        assert!(few.len() <= 2 * COLUMNS + 2);
        assert!(few.contains(&(54_321.0, 7.0)) && few.contains(&(54_322.0, -3.0)));
        assert!(few.windows(2).all(|w| w[0].0 <= w[1].0));
    }
}
