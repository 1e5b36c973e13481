//! A field on a plane as colours, with contour lines and a legend.

use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{Drawing, Panel, stroke};
use crate::colour::ColourScale;
use crate::number::number;
use crate::rules::{FAINT, INK, centred, round_ticks, text, text_size, tick, tick_count, titled};

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
    /// Write the level on each line.
    pub labelled: bool,
}

/// Where levels are written: once for each, far from the others and from the rim.
#[derive(Default)]
struct Labels {
    chosen: Vec<(f64, (i32, i32))>,
}

impl Labels {
    /// Chooses, among the middles of a level's pieces, the one farthest from the labels so far,
    /// if any is far enough to be read.
    fn consider(
        &mut self,
        level: f64,
        size: u32,
        (across, down): (Range<i32>, Range<i32>),
        pieces: &[[(f64, f64); 2]],
        pixel: impl Fn(&(f64, f64)) -> (i32, i32),
    ) {
        let room = |(x, y): (i32, i32)| {
            let gap =
                |(_, (a, b)): &(f64, (i32, i32))| (f64::from(x - a) / 2.0).hypot(f64::from(y - b));
            self.chosen.iter().map(gap).fold(f64::INFINITY, f64::min)
        };
        let middles = pieces.iter().map(|[a, b]| {
            let (a, b) = (pixel(a), pixel(b));
            ((a.0 + b.0) / 2, (a.1 + b.1) / 2)
        });
        let (x_margin, y_margin) = (2 * size as i32, size as i32);
        let inner = middles.filter(|(x, y)| {
            (across.start + x_margin..across.end - x_margin).contains(x)
                && (down.start + y_margin..down.end - y_margin).contains(y)
        });
        let best = inner.max_by(|a, b| room(*a).min(1e4).total_cmp(&room(*b).min(1e4)));
        if let Some(place) = best.filter(|p| room(*p) > 1.6 * f64::from(size)) {
            self.chosen.push((level, place));
        }
    }
}

/// A tick label, left out at the ends of the axis, where it would meet that of the other axis.
fn inner_tick(value: f64, [low, high]: [f64; 2]) -> String {
    let margin = 0.015 * (high - low);
    if value < low + margin || value > high - margin {
        return String::new();
    }
    tick(value, [low, high])
}

impl HeatMap {
    /// Draws the map into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw(&self, panel: &Panel<'_>) -> Drawing {
        let size = text_size(panel);
        let (map, bar) = legend_frame(panel, &self.title, &self.note)?;
        self.draw_map(&map, size)?;
        draw_legend(&bar, &self.scale, &self.legend, size)
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
            .x_labels(tick_count(panel.dim_in_pixel().0, size, 6))
            .y_labels(tick_count(panel.dim_in_pixel().1, size, 4))
            .x_label_formatter(&|v| inner_tick(*v, [x0, x1]))
            .y_label_formatter(&|v| inner_tick(*v, [y0, y1]))
            .label_style(text(size, INK))
            .axis_desc_style(text(size, INK))
            .draw()?;
        for lines in &self.contours {
            let thin = INK.mix(0.35).stroke_width(stroke(1));
            let thick = INK.stroke_width(stroke(3) - 1);
            let levels = lines.levels.iter().map(|l| (*l, thin));
            let mut labels = Labels::default();
            for (level, style) in levels.chain(lines.bold.iter().map(|l| (*l, thick))) {
                let pieces = contour_segments(lines.values.view(), level);
                let pieces: Vec<_> = pieces
                    .into_iter()
                    .map(|piece| piece.map(|p| self.place(p)))
                    .collect();
                if lines.labelled && level != 0.0 {
                    let area = chart.plotting_area();
                    let rim = area.get_pixel_range();
                    labels.consider(level, size, rim, &pieces, |p| area.map_coordinate(p));
                }
                let lines = pieces
                    .into_iter()
                    .map(|p| PathElement::new(p.to_vec(), style));
                chart.draw_series(lines)?;
            }
            let sheet = chart.plotting_area().strip_coord_spec();
            let (left, top) = sheet.get_base_pixel();
            for (level, (x, y)) in labels.chosen {
                let label = centred(size * 3 / 4, INK);
                sheet.draw_text(&number(level, 3), &label, (x - left, y - top))?;
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

/// Levels for contour lines of a distance: round numbers on both sides of zero.
pub(crate) fn distance_levels(values: &Array2<f32>, about: usize) -> Vec<f64> {
    let (low, high) = values
        .iter()
        .filter(|v| v.is_finite())
        .fold((0f64, 0f64), |(a, b), &v| {
            (a.min(f64::from(v)), b.max(f64::from(v)))
        });
    let mut ticks = round_ticks(low, high, about);
    ticks.retain(|t| *t != 0.0);
    ticks
}

/// A straight piece of a contour between two points, in fractional indices `[row, column]`.
pub(crate) type Segment = [[f64; 2]; 2];

/// The pieces of the line where `values` crosses `level`. Squares with a non-finite corner are
/// left out; of the two ways through a saddle, the one that joins the corners above is taken.
fn contour_segments(values: ArrayView2<'_, f32>, level: f64) -> Vec<Segment> {
    let (rows, columns) = values.dim();
    let mut out = Vec::new();
    for i in 0..rows.saturating_sub(1) {
        for j in 0..columns.saturating_sub(1) {
            let corner = |di: usize, dj: usize| f64::from(values[[i + di, j + dj]]) - level;
            // Around the square, so that neighbours in the list share an edge.
            let places = [(0, 0), (0, 1), (1, 1), (1, 0)];
            let v = places.map(|(di, dj)| corner(di, dj));
            if !v.iter().all(|x| x.is_finite()) {
                continue;
            }
            let mut crossings = Vec::with_capacity(4);
            for k in 0..4 {
                let (a, b) = (v[k], v[(k + 1) % 4]);
                if (a < 0.0) != (b < 0.0) {
                    let share = a / (a - b);
                    let from = places[k];
                    let to = places[(k + 1) % 4];
                    let along = |p: usize, q: usize| p as f64 + share * (q as f64 - p as f64);
                    crossings.push([
                        i as f64 + along(from.0, to.0),
                        j as f64 + along(from.1, to.1),
                    ]);
                }
            }
            match crossings[..] {
                [a, b] => out.push([a, b]),
                // Crossing k lies on the edge from corner k: cut off the corners below.
                [a, b, c, d] if v[0] < 0.0 => out.extend([[d, a], [b, c]]),
                [a, b, c, d] => out.extend([[a, b], [c, d]]),
                _ => {}
            }
        }
    }
    out
}

/// Room that the bar and its numbers take, heights of text.
const LEGEND_WIDTH: u32 = 6;

/// Draws `title` at the top of a panel and `note` at its foot; gives what is between, without and with
/// the room for the bar.
///
/// # Errors
/// If the drawing library refuses.
pub(crate) fn legend_frame<'a>(
    panel: &Panel<'a>,
    title: &str,
    note: &str,
) -> Result<(Panel<'a>, Panel<'a>), Box<dyn std::error::Error + Send + Sync>> {
    let width = panel.dim_in_pixel().0;
    let size = text_size(panel);
    let rest = titled(panel, title)?;
    if note.is_empty() {
        return Ok(rest.split_horizontally(width.saturating_sub((LEGEND_WIDTH + 1) * size)));
    }
    let (rest, foot) = rest.split_vertically(rest.dim_in_pixel().1.saturating_sub(2 * size));
    let place = (width as i32 / 2, size as i32 / 2);
    foot.draw_text(note, &centred(size, FAINT), place)?;
    Ok(rest.split_horizontally(width.saturating_sub((LEGEND_WIDTH + 1) * size)))
}

/// Draws the bar with `caption` (the quantity and its unit, a line or several) above it.
pub(crate) fn draw_legend(
    panel: &Panel<'_>,
    scale: &ColourScale,
    caption: &str,
    size: u32,
) -> Drawing {
    let (_, height) = panel.dim_in_pixel();
    let line = size as i32 + 4;
    let (left, right) = (size as i32 / 2, size as i32 / 2 + size as i32);
    let above = text(size, INK).pos(Pos::new(HPos::Left, VPos::Top));
    for (i, words) in caption.lines().enumerate() {
        panel.draw_text(words, &above, (left, i as i32 * line))?;
    }
    let top = caption.lines().count() as i32 * line + size as i32 / 2;
    let bottom = height as i32 - 4 * size as i32;
    let span = f64::from((bottom - top).max(1));
    for y in top..=bottom {
        let share = f64::from(bottom - y) / span;
        let value = scale.low + share * (scale.high - scale.low);
        let colour = scale.colour(value).filled();
        panel.draw(&Rectangle::new([(left, y), (right, y + 1)], colour))?;
    }
    let frame = FAINT.stroke_width(stroke(1));
    panel.draw(&Rectangle::new([(left, top), (right, bottom + 1)], frame))?;
    let beside = text(size, INK).pos(Pos::new(HPos::Left, VPos::Center));
    for value in round_ticks(scale.low, scale.high, 7) {
        let share = (value - scale.low) / (scale.high - scale.low);
        let y = bottom - (share * span) as i32;
        let mark = vec![(right, y), (right + size as i32 / 4, y)];
        panel.draw(&PathElement::new(mark, FAINT))?;
        panel.draw_text(&number(value, 3), &beside, (right + size as i32 / 2, y))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_found_where_it_is() {
        let values = Array2::from_shape_fn((41, 41), |(i, j)| {
            ((i as f32 - 20.0).hypot(j as f32 - 20.0)) - 12.5
        });
        let found = contour_segments(values.view(), 0.0);
        assert!(found.len() > 60);
        for [x, y] in found.iter().flatten() {
            // Linear interpolation of a distance over one cell is off by at most 1/(8 r).
            let radius = (x - 20.0).hypot(y - 20.0);
            assert!((radius - 12.5).abs() < 0.02, "{radius}");
        }
        let length: f64 = found
            .iter()
            .map(|[a, b]| (a[0] - b[0]).hypot(a[1] - b[1]))
            .sum();
        assert!((length / (std::f64::consts::TAU * 12.5) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_saddle_joins_the_high_corners() {
        let values = ndarray::array![[-1.0f32, 1.0], [1.0, -1.0]];
        for [a, b] in contour_segments(values.view(), 0.0) {
            // Both pieces cut off a low corner: their middles are near (0,0) and (1,1).
            let (x, y) = ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0);
            assert!((x - y).abs() < 1e-12, "{x} {y}");
        }
        assert_eq!(contour_segments(values.view(), 0.0).len(), 2);
    }
}
