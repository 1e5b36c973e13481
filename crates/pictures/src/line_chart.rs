//! Curves over a common axis, and their reduction to what a chart can show.

use plotters::prelude::*;

use crate::axis::Axis;
use crate::canvas::{Area, Drawing, PAPER, stroke};
use crate::rules::{
    Entry, FAINT, FORCE, GRID, INK, Quantity, SERIES, alike, are_whole, legend, text, text_size,
    tick_count, titled,
};

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
    /// Whether the values along x, and along y, are logarithms to base ten: labels are the numbers
    /// themselves.
    pub logarithmic: [bool; 2],
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
    /// What it stands for, and so its colour; the next one in line if nothing is said.
    pub quantity: Option<Quantity>,
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
    /// If more than [`MOST_SERIES`](crate::MOST_SERIES) curves have a label, or the drawing library
    /// refuses.
    pub fn draw<DB: DrawingBackend>(&self, panel: &Area<DB>) -> Drawing
    where
        DB::ErrorType: 'static,
    {
        let size = text_size(panel);
        let rest = legend(&titled(panel, &self.title)?, &self.entries())?;
        let (width, height) = rest.dim_in_pixel();
        let [x, y] = self.axes(tick_count(width, size, 6), tick_count(height, size, 3));
        let ([x0, x1], [y0, y1]) = (x.range, y.range);
        let mut chart = ChartBuilder::on(&rest)
            .margin(size)
            .margin_top(size / 2)
            .margin_right(2 * size)
            .x_label_area_size(3 * size)
            .y_label_area_size(4 * size + size / 2)
            .build_cartesian_2d(x.clone(), y.clone())?;
        chart
            .configure_mesh()
            .light_line_style(PAPER.mix(0.0))
            .bold_line_style(GRID)
            .axis_style(FAINT)
            .x_desc(&self.horizontal)
            .y_desc(&self.vertical)
            .x_labels(x.ticks.len())
            .y_labels(y.ticks.len())
            .x_label_formatter(&|v| x.label(*v))
            .y_label_formatter(&|v| y.label(*v))
            .label_style(text(size, INK))
            .axis_desc_style(text(size, INK))
            .draw()?;
        for mark in &self.marks {
            mark.draw(&mut chart, size, [x0, x1], [y0, y1])?;
        }
        for (index, series) in self.series.iter().enumerate() {
            series.draw(&mut chart, self.colour(index))?;
        }
        Ok(())
    }

    /// Colours go by turns among curves that stand for nothing in particular, leaving out those like
    /// the colour of a quantity in the chart.
    fn colour(&self, index: usize) -> RGBColor {
        if let Some(quantity) = self.series[index].quantity {
            return quantity.colour();
        }
        let taken = || self.series.iter().filter_map(|s| s.quantity);
        let free = |c: &&RGBColor| !taken().any(|q| alike(**c, q.colour()));
        let free: Vec<&RGBColor> = SERIES.iter().filter(free).collect();
        let before = self.series[..index].iter();
        *free[before.filter(|s| s.quantity.is_none()).count() % free.len()]
    }

    /// Of a single curve the axis says what it is.
    fn entries(&self) -> Vec<Entry<'_>> {
        let named = self.series.iter().enumerate();
        let named = named.filter(|(_, s)| !s.label.is_empty() && self.series.len() > 1);
        named
            .map(|(index, series)| Entry {
                label: &series.label,
                colour: self.colour(index),
                dots: series.dots,
            })
            .collect()
    }

    fn axes(&self, across: usize, up: usize) -> [Axis; 2] {
        let points = || {
            self.series
                .iter()
                .flat_map(|s| s.points.iter().copied())
                .filter(|(x, y)| x.is_finite() && y.is_finite())
        };
        let [y0, y1] = spread(points().map(|p| p.1));
        let margin = (0.06 * (y1 - y0)).max(0.5 * (self.least_span - (y1 - y0)));
        let axis = |range: [f64; 2], whole, logarithmic, about| match logarithmic {
            true => Axis::logarithmic(range.map(|v| 10f64.powf(v)), about),
            false => Axis::linear(range, whole, about),
        };
        let [x, y] = self.logarithmic;
        let whole = [
            are_whole(points().map(|p| p.0)),
            are_whole(points().map(|p| p.1)),
        ];
        [
            axis(spread(points().map(|p| p.0)), whole[0], x, across),
            axis([y0 - margin, y1 + margin], whole[1], y, up),
        ]
    }
}

/// A chart with both axes in numbers.
type Chart<'a, DB> = ChartContext<'a, DB, Cartesian2d<Axis, Axis>>;

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
            let style = FORCE.mix(0.6).stroke_width(stroke(1));
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
        if self.dots {
            chart.draw_series(points.map(|p| Circle::new(p, stroke(3), colour.filled())))?;
        } else if self.dashed {
            chart.draw_series(DashedLineSeries::new(points, stroke(9), stroke(6), style))?;
        } else if self.thin {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(stroke(1))))?;
        } else {
            // Piece by piece: the joins of one thick line go astray where a curve turns sharply.
            chart.draw_series(
                self.points
                    .windows(2)
                    .map(|pair| PathElement::new(pair.to_vec(), style)),
            )?;
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
    use crate::canvas::svg;

    /// What is written in the chart of these points.
    fn words(points: Vec<(f64, f64)>, logarithmic: bool) -> Vec<String> {
        let chart = LineChart {
            series: vec![Series {
                points,
                ..Series::default()
            }],
            logarithmic: [logarithmic; 2],
            ..LineChart::default()
        };
        let text = svg("test", (600, 400), |sheet| chart.draw(sheet)).unwrap();
        let words = text.split("</text>").filter_map(|t| t.rsplit('>').next());
        let words = words.map(|t| t.trim().to_owned());
        words.filter(|t| !t.is_empty()).collect()
    }

    #[test]
    fn whole_quantities_have_whole_ticks_and_negative_ones_a_minus_sign() {
        let whole = words(vec![(0.0, 1.0), (1.0, 3.0), (2.0, 2.0)], false);
        assert!(whole.iter().all(|t| !t.contains('.')), "{whole:?}");
        assert!(
            ["0", "1", "2", "3"]
                .iter()
                .all(|t| whole.iter().any(|w| w == t))
        );
        let signed = words(vec![(-1.5, -2.5), (1.5, 2.5)], false);
        assert!(
            signed.iter().any(|t| t.starts_with('\u{2212}')),
            "{signed:?}"
        );
        assert!(signed.iter().all(|t| !t.starts_with('-')), "{signed:?}");
    }

    #[test]
    fn logarithmic_axes_say_the_numbers_themselves() {
        let said = words(vec![(-3.0, 0.0), (-2.0, 2.0)], true);
        let both = ["0.001", "0.01", "1", "100"];
        assert!(both.iter().all(|t| said.iter().any(|w| w == t)), "{said:?}");
    }

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
