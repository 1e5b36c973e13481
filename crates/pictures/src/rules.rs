//! The rules of every chart, in one place: type, colours, ticks, legends, how many curves.

use plotters::prelude::{DrawingBackend, PathElement, RGBColor, Rectangle};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, TextStyle};

use crate::canvas::{Area, DrawingError, FACE, stroke};
use crate::number::number;

/// Colours by name for pages, as custom properties of CSS with a dark form each.
pub const COLOURS: &str = include_str!("colours.css");

/// Text and axes.
pub(crate) const INK: RGBColor = RGBColor(29, 39, 51);
/// Less important text and light axes.
pub(crate) const FAINT: RGBColor = RGBColor(85, 99, 122);
/// Lines that mark an event, and forces.
pub(crate) const FORCE: RGBColor = RGBColor(211, 60, 47);
/// Torques.
pub(crate) const TORQUE: RGBColor = RGBColor(124, 77, 189);
/// Energies.
pub(crate) const ENERGY: RGBColor = RGBColor(12, 122, 101);
/// Grid lines.
pub(crate) const GRID: RGBColor = RGBColor(226, 232, 240);

/// Most curves of a chart: more cannot be told apart.
pub const MOST_SERIES: usize = 8;

/// Colours of curves that stand for nothing in particular, distinct also to the colour-blind (Okabe
/// and Ito, and a brown and a grey besides).
pub(crate) const SERIES: [RGBColor; MOST_SERIES] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(121, 85, 72),
    RGBColor(110, 110, 110),
];

/// Whether two colours can be taken for each other.
pub(crate) fn alike(a: RGBColor, b: RGBColor) -> bool {
    let [a, b] = [a, b].map(|c| [c.0, c.1, c.2]);
    let apart: u32 = (0..3).map(|i| u32::from(a[i].abs_diff(b[i]))).sum();
    apart < 90
}

/// What a curve stands for, if its colour is to say so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The size of a force.
    Force,
    /// The size of a torque.
    Torque,
    /// An energy.
    Energy,
}

impl Quantity {
    pub(crate) const fn colour(self) -> RGBColor {
        match self {
            Self::Force => FORCE,
            Self::Torque => TORQUE,
            Self::Energy => ENERGY,
        }
    }
}

/// Least and greatest height of text, pixels of the picture.
const TYPE: (u32, u32) = (14, 26);

/// Height of ordinary text in a panel, drawing pixels.
pub(crate) fn text_size<DB: DrawingBackend>(panel: &Area<DB>) -> u32 {
    let (width, height) = panel.dim_in_pixel();
    (height.min(width) / 32).clamp(stroke(TYPE.0), stroke(TYPE.1))
}

/// Text of `size` pixels in the built-in face.
pub(crate) fn text(size: u32, colour: RGBColor) -> TextStyle<'static> {
    let mut style = TextStyle::from((FACE, size).into_font());
    style.color = colour.to_backend_color();
    style
}

/// The same, anchored by its middle.
pub(crate) fn centred(size: u32, colour: RGBColor) -> TextStyle<'static> {
    text(size, colour).pos(Pos::new(HPos::Center, VPos::Center))
}

/// Draws a centred title, if there is one, at the top of a panel and returns what is left below it.
///
/// # Errors
/// If the drawing library refuses.
pub(crate) fn titled<DB: DrawingBackend>(
    panel: &Area<DB>,
    title: &str,
) -> Result<Area<DB>, DrawingError>
where
    DB::ErrorType: 'static,
{
    let size = text_size(panel);
    if title.is_empty() {
        return Ok(panel.margin(size / 2, 0, 0, 0));
    }
    let (top, rest) = panel.split_vertically(2 * size + size / 2);
    let middle = (
        panel.dim_in_pixel().0 as i32 / 2,
        size as i32 + size as i32 / 3,
    );
    top.draw_text(title, &centred(size + size / 4, INK), middle)?;
    Ok(rest)
}

/// About so many ticks stand on an axis of `pixels` in type of `size`, with labels of `letters`.
pub(crate) fn tick_count(pixels: u32, size: u32, letters: u32) -> usize {
    (pixels / (size * letters).max(1)).clamp(2, 8) as usize
}

/// A tick label on an axis from `low` to `high`: rounding around zero is zero.
pub(crate) fn tick(value: f64, [low, high]: [f64; 2]) -> String {
    match value.abs() < 1e-9 * (high - low) {
        true => number(0.0, 4),
        false => number(value, 4),
    }
}

/// Evenly placed round numbers within a range: 1, 2 or 5 times a power of ten apart.
pub(crate) fn round_ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    ticks(low, high, about, 0.0)
}

/// The same for a quantity that has whole values only.
pub(crate) fn whole_ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    ticks(low, high, about, 1.0)
}

fn ticks(low: f64, high: f64, about: usize, least: f64) -> Vec<f64> {
    let raw = ((high - low) / about.max(1) as f64).max(least);
    if !(raw.is_finite() && raw > 0.0) {
        return vec![low];
    }
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|s| *s >= raw * (1.0 - 1e-12))
        .unwrap_or(10.0 * power);
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    (first as i64..=last as i64)
        .map(|i| i as f64 * step)
        .collect()
}

/// The range of a logarithmic axis that shows `low` to `high` (both above zero), from round number to
/// round number, and its ticks: at least two, about `about`.
pub(crate) fn log_ticks(low: f64, high: f64, about: usize) -> ([f64; 2], Vec<f64>) {
    let low = if low > 0.0 && low.is_finite() {
        low
    } else {
        1.0
    };
    let high = if high > low && high.is_finite() {
        high
    } else {
        10.0 * low
    };
    let decades = (low.log10() - 1e-9).floor() as i32..=(high.log10() + 1e-9).ceil() as i32;
    // Written as text: a power of ten that was computed is not the number it is read as.
    let at = |digit: u8, power: i32| format!("{digit}e{power}").parse().unwrap_or(1.0);
    let fine: Vec<f64> = decades
        .clone()
        .flat_map(|p| [1, 2, 5].map(|digit| at(digit, p)))
        .collect();
    let from = fine.iter().rposition(|t| *t <= low * (1.0 + 1e-9));
    let to = fine.iter().position(|t| *t >= high * (1.0 - 1e-9));
    let (from, to) = (from.unwrap_or(0), to.unwrap_or(fine.len() - 1));
    let range = [fine[from], fine[to]];
    let fine = fine[from..=to].to_vec();
    if fine.len() <= about.max(2) {
        return (range, fine);
    }
    let every = (decades.clone().count() / about.max(1)).max(1);
    let whole = decades.step_by(every).map(|p| at(1, p));
    let whole: Vec<f64> = whole
        .filter(|t| (range[0]..=range[1]).contains(t))
        .collect();
    match whole.len() {
        0 | 1 => (range, range.to_vec()),
        _ => (range, whole),
    }
}

/// Whether all values are whole numbers, so that the ticks of their axis are.
pub(crate) fn are_whole(mut values: impl Iterator<Item = f64>) -> bool {
    values.all(|v| v == v.round())
}

/// One entry of a legend: a word, its colour, and whether it is a line or dots.
pub(crate) struct Entry<'a> {
    pub(crate) label: &'a str,
    pub(crate) colour: RGBColor,
    pub(crate) dots: bool,
}

/// Writes a legend at the top of a panel, never over the data, in as many lines as it takes; gives the
/// rest of the panel.
///
/// # Errors
/// If there are more than [`MOST_SERIES`] entries, or the drawing library refuses.
pub(crate) fn legend<DB: DrawingBackend>(
    panel: &Area<DB>,
    entries: &[Entry<'_>],
) -> Result<Area<DB>, DrawingError>
where
    DB::ErrorType: 'static,
{
    if entries.len() > MOST_SERIES {
        let count = entries.len();
        return Err(format!("a chart of {count} curves, of at most {MOST_SERIES}").into());
    }
    if entries.is_empty() {
        return Ok(panel.clone());
    }
    let size = text_size(panel) as i32;
    let width = panel.dim_in_pixel().0 as i32;
    let style = text(size as u32, INK).pos(Pos::new(HPos::Left, VPos::Center));
    let (mut x, mut y) = (size, size / 2);
    let mut places = Vec::new();
    for entry in entries {
        let (letters, _) = panel.estimate_text_size(entry.label, &style)?;
        let wide = 2 * size + letters as i32;
        if x + wide > width - size && x > size {
            (x, y) = (size, y + 3 * size / 2);
        }
        places.push((x, y));
        x += wide + 3 * size / 2;
    }
    let (top, rest) = panel.split_vertically((y + size) as u32);
    for (entry, (x, y)) in entries.iter().zip(places) {
        let (left, right) = (x, x + 3 * size / 2);
        if entry.dots {
            let (middle, half) = ((left + right) / 2, size / 4);
            let corners = [(middle - half, y - half), (middle + half, y + half)];
            top.draw(&Rectangle::new(corners, entry.colour.filled()))?;
        } else {
            let line = vec![(left, y), (right, y)];
            top.draw(&PathElement::new(
                line,
                entry.colour.stroke_width(stroke(3)),
            ))?;
        }
        top.draw_text(entry.label, &style, (right + size / 2, y))?;
    }
    Ok(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canvas::{PAPER, svg};
    use crate::colour::ColourMap;

    #[test]
    fn pictures_and_pages_have_the_same_colours() {
        let light = COLOURS.split("@media").next().unwrap();
        let named = [
            ("ink", INK),
            ("soft", FAINT),
            ("line", GRID),
            ("paper", PAPER),
            ("force", FORCE),
            ("torque", TORQUE),
            ("energy", ENERGY),
            ("positive", ColourMap::Diverging.at(0.9)),
            ("negative", ColourMap::Diverging.at(0.1)),
        ];
        for (name, RGBColor(r, g, b)) in named {
            let line = format!("--{name}: #{r:02x}{g:02x}{b:02x};");
            assert!(light.contains(&line), "{line}");
        }
        // Every colour has a dark form.
        let names = |text: &str| {
            let lines = text.lines().filter_map(|l| l.trim().strip_prefix("--"));
            let names = lines.filter_map(|l| l.split(':').next().map(str::to_owned));
            names.collect::<Vec<_>>()
        };
        assert_eq!(names(light), names(COLOURS.split("@media").nth(1).unwrap()));
    }

    #[test]
    fn few_colours_are_like_that_of_a_quantity() {
        for quantity in [Quantity::Force, Quantity::Torque, Quantity::Energy] {
            let like = SERIES.into_iter().filter(|c| alike(*c, quantity.colour()));
            assert!(like.count() <= 1, "{quantity:?}");
        }
        assert!(alike(FORCE, SERIES[1]) && alike(ENERGY, SERIES[2]));
    }

    #[test]
    fn rounding_around_zero_is_zero() {
        assert_eq!(tick(3e-18, [-1.0, 1.0]), "0");
        assert_eq!(tick(0.25, [-1.0, 1.0]), "0.25");
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(round_ticks(-1.0, 1.0, 4), vec![-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(round_ticks(0.0, 0.0, 4), vec![0.0]);
        let ticks = round_ticks(0.13, 9.7, 5);
        assert!(ticks.len() >= 4 && ticks.iter().all(|t| (0.13..=9.7).contains(t)));
        assert_eq!(whole_ticks(0.9, 3.2, 8), vec![1.0, 2.0, 3.0]);
        assert!(are_whole([1.0, 64.0].into_iter()) && !are_whole([1.0, 1.5].into_iter()));
    }

    #[test]
    fn logarithmic_axes_have_ticks_however_short_they_are() {
        assert_eq!(log_ticks(7.9, 10.0, 6), ([5.0, 10.0], vec![5.0, 10.0]));
        assert_eq!(log_ticks(12.0, 15.0, 6), ([10.0, 20.0], vec![10.0, 20.0]));
        let (range, ticks) = log_ticks(0.5, 3e6, 6);
        assert!(range[0] <= 0.5 && range[1] >= 3e6, "{range:?}");
        assert_eq!(ticks, [1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6]);
        assert_eq!(log_ticks(0.0, f64::NAN, 6).0, [1.0, 10.0]);
    }

    #[test]
    fn a_legend_stands_above_and_has_at_most_eight_entries() {
        let draw = |count: usize| {
            let entry = |_| Entry {
                label: "some curve",
                colour: INK,
                dots: false,
            };
            let entries: Vec<_> = (0..count).map(entry).collect();
            let mut left = 0;
            let drawn = svg("test", (400, 300), |sheet| {
                left = legend(sheet, &entries)?.dim_in_pixel().1;
                Ok(())
            });
            (drawn, left)
        };
        let (one, eight) = (draw(1), draw(8));
        assert!(one.1 > eight.1 && eight.1 > 300, "{} {}", one.1, eight.1);
        assert!(draw(9).0.unwrap_err().to_string().contains("at most 8"));
    }
}
