//! A field on a plane as colours, with contour lines and a legend.

use ndarray::Array2;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::canvas::{
    self, Drawing, FAINT, GRID, INK, Panel, centred, number, round_ticks, stroke, text, text_size,
    tick, titled,
};
use super::colour::ColourScale;
use super::contour;

/// Values over a rectangle, drawn as colours.
#[derive(Debug, Clone)]
pub struct HeatMap {
    /// Above the map.
    pub title: String,
    /// Under the horizontal axis, with its unit.
    pub horizontal: String,
    /// Beside the vertical axis, with its unit.
    pub vertical: String,
    /// Values `[i, j]`: i along the horizontal axis, j along the vertical.
    pub values: Array2<f32>,
    /// Axis values of the first and the last column of samples.
    pub across: [f64; 2],
    /// Axis values of the first and the last row of samples.
    pub up: [f64; 2],
    /// From values to colours.
    pub scale: ColourScale,
    /// Beside the legend, with its unit.
    pub legend: String,
    /// Lines over the colours.
    pub contours: Vec<Contours>,
    /// What the lines are, at the foot of the picture.
    pub note: String,
    /// True where both axes are lengths: one unit is as long across as up.
    pub equal_axes: bool,
}

/// Lines of equal value of another quantity on the same samples.
#[derive(Debug, Clone)]
pub struct Contours {
    /// Values `[i, j]` on the samples of the map.
    pub values: Array2<f32>,
    /// Levels of thin lines.
    pub levels: Vec<f64>,
    /// Levels of thick lines.
    pub bold: Vec<f64>,
}

const LEGEND_WIDTH: u32 = stroke(150);

impl HeatMap {
    /// Draws the map into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw(&self, panel: &Panel<'_>) -> Drawing {
        let width = panel.dim_in_pixel().0;
        let size = text_size(panel);
        let rest = titled(panel, &self.title)?;
        let (rest, foot) = rest.split_vertically(rest.dim_in_pixel().1 - 2 * size);
        let place = (width as i32 / 2, size as i32 / 2);
        foot.draw_text(&self.note, &centred(size, FAINT), place)?;
        let (map, legend) = rest.split_horizontally(width - LEGEND_WIDTH - size);
        self.draw_map(&map, size)?;
        self.draw_legend(&legend, size)
    }

    /// Half a sample beyond the outer samples on each side.
    fn ranges(&self) -> ([f64; 2], [f64; 2]) {
        let (columns, rows) = self.values.dim();
        let grow = |[a, b]: [f64; 2], n: usize| {
            let half = if n > 1 {
                0.5 * (b - a) / (n - 1) as f64
            } else {
                0.5
            };
            [a - half, b + half]
        };
        (grow(self.across, columns), grow(self.up, rows))
    }

    fn draw_map(&self, panel: &Panel<'_>, size: u32) -> Drawing {
        let ([x0, x1], [y0, y1]) = self.ranges();
        let label_left = 4 * size;
        let label_below = 3 * size;
        let panel = if self.equal_axes {
            shrink_to_aspect(panel, (x1 - x0) / (y1 - y0), label_left, label_below, size)
        } else {
            panel.clone()
        };
        let mut chart = ChartBuilder::on(&panel)
            .margin(size / 2)
            .x_label_area_size(label_below)
            .y_label_area_size(label_left)
            .build_cartesian_2d(x0..x1, y0..y1)?;
        self.paint(chart.plotting_area())?;
        chart
            .configure_mesh()
            .disable_mesh()
            .axis_style(FAINT)
            .x_desc(&self.horizontal)
            .y_desc(&self.vertical)
            .x_labels(7)
            .y_labels(7)
            .x_label_formatter(&|v| tick(*v, [x0, x1]))
            .y_label_formatter(&|v| tick(*v, [y0, y1]))
            .label_style(text(size, INK))
            .axis_desc_style(text(size, INK))
            .draw()?;
        for lines in &self.contours {
            let thin = INK.mix(0.35).stroke_width(stroke(1));
            let thick = INK.stroke_width(stroke(3) - 1);
            let levels = lines.levels.iter().map(|l| (*l, thin));
            for (level, style) in levels.chain(lines.bold.iter().map(|l| (*l, thick))) {
                let pieces = contour::segments(lines.values.view(), level);
                chart.draw_series(
                    pieces.into_iter().map(|piece| {
                        PathElement::new(piece.map(|p| self.place(p)).to_vec(), style)
                    }),
                )?;
            }
        }
        Ok(())
    }

    /// Axis values at fractional indices.
    fn place(&self, [i, j]: [f64; 2]) -> (f64, f64) {
        let (columns, rows) = self.values.dim();
        let on = |[a, b]: [f64; 2], t: f64, n: usize| a + (b - a) * t / (n - 1).max(1) as f64;
        (on(self.across, i, columns), on(self.up, j, rows))
    }

    /// Every pixel gets the colour of the nearest sample: no value is invented across a jump.
    fn paint(
        &self,
        area: &DrawingArea<BitMapBackend<'_>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    ) -> Drawing {
        let (columns, rows) = self.values.dim();
        let (pixels_x, pixels_y) = area.get_pixel_range();
        let sheet = area.strip_coord_spec();
        let (w, h) = (
            (pixels_x.end - pixels_x.start).max(1),
            (pixels_y.end - pixels_y.start).max(1),
        );
        for px in 0..=w {
            let i = ((px as usize * columns) / (w as usize + 1)).min(columns - 1);
            for py in 0..=h {
                let j = (((h - py) as usize * rows) / (h as usize + 1)).min(rows - 1);
                let colour = self.scale.colour(f64::from(self.values[[i, j]]));
                sheet.draw_pixel((px, py), &colour)?;
            }
        }
        Ok(())
    }

    fn draw_legend(&self, panel: &Panel<'_>, size: u32) -> Drawing {
        let (_, height) = panel.dim_in_pixel();
        let (top, bottom) = (size as i32, height as i32 - 4 * size as i32);
        let (left, right) = (size as i32 / 2, size as i32 / 2 + size as i32);
        let span = f64::from(bottom - top);
        for y in top..=bottom {
            let share = f64::from(bottom - y) / span;
            let value = self.scale.low + share * (self.scale.high - self.scale.low);
            panel.draw(&Rectangle::new(
                [(left, y), (right, y + 1)],
                self.scale.colour(value).filled(),
            ))?;
        }
        panel.draw(&Rectangle::new(
            [(left, top), (right, bottom + 1)],
            FAINT.stroke_width(stroke(1)),
        ))?;
        let beside = text(size, INK).pos(Pos::new(HPos::Left, VPos::Center));
        for value in round_ticks(self.scale.low, self.scale.high, 7) {
            let share = (value - self.scale.low) / (self.scale.high - self.scale.low);
            let y = bottom - (share * span) as i32;
            panel.draw(&PathElement::new(
                vec![(right, y), (right + size as i32 / 4, y)],
                FAINT,
            ))?;
            panel.draw_text(&number(value, 3), &beside, (right + size as i32 / 2, y))?;
        }
        let under = text(size, INK).pos(Pos::new(HPos::Left, VPos::Top));
        for (i, line) in self.legend.lines().enumerate() {
            let y = bottom + size as i32 / 2 + 6 + i as i32 * (size as i32 + 4);
            panel.draw_text(line, &under, (left, y))?;
        }
        Ok(())
    }
}

/// The middle of a panel, of the shape that gives its plotting area the aspect `across / up`.
fn shrink_to_aspect<'a>(
    panel: &Panel<'a>,
    aspect: f64,
    left: u32,
    below: u32,
    margin: u32,
) -> Panel<'a> {
    let (w, h) = panel.dim_in_pixel();
    let (inner_w, inner_h) = (
        f64::from(w.saturating_sub(left + margin)),
        f64::from(h.saturating_sub(below + margin)),
    );
    let (spare_w, spare_h) = if inner_w > aspect * inner_h {
        ((inner_w - aspect * inner_h) as i32, 0)
    } else {
        (0, (inner_h - inner_w / aspect) as i32)
    };
    panel.margin(spare_h / 2, spare_h / 2, spare_w / 2, spare_w / 2)
}

/// Grid colour is shared with charts so that panels side by side look alike.
pub(super) const MESH: RGBColor = GRID;

/// Samples of a picture that is `n` across: `low` and `high` with `n - 1` equal steps.
pub fn samples([low, high]: [f64; 2], n: usize) -> Vec<f64> {
    (0..n)
        .map(|i| low + (high - low) * i as f64 / (n - 1).max(1) as f64)
        .collect()
}

/// Levels for contour lines of a distance: round numbers on both sides of zero.
pub fn distance_levels(values: &Array2<f32>, about: usize) -> Vec<f64> {
    let (low, high) = values
        .iter()
        .filter(|v| v.is_finite())
        .fold((0f64, 0f64), |(a, b), &v| {
            (a.min(f64::from(v)), b.max(f64::from(v)))
        });
    let mut ticks = canvas::round_ticks(low, high, about);
    ticks.retain(|t| *t != 0.0);
    ticks
}
