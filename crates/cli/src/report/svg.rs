//! Line charts and histograms as SVG text, for pages that need no other file.

use std::fmt::Write;

use super::html::escaped;

/// Width of a chart, in its own units.
const WIDTH: f64 = 960.0;
/// Left, right, top and bottom margins; the legend is in the top one.
const MARGINS: [f64; 4] = [70.0, 16.0, 30.0, 40.0];
/// Columns a curve is reduced to: more could not be seen.
const COLUMNS: usize = 900;
/// Curve colours, in order.
const COLOURS: [&str; 6] = [
    "#1f5fa8", "#c0392b", "#2e8b57", "#8e44ad", "#b7791f", "#555555",
];

/// A curve: label and points, `x` not decreasing.
pub(crate) struct Curve<'a> {
    pub(crate) label: &'a str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// A line at one `x` over the whole height.
pub(crate) struct Mark<'a> {
    pub(crate) at: f64,
    pub(crate) label: &'a str,
}

/// Curves over a common horizontal axis.
pub(crate) fn lines(
    horizontal: &str,
    vertical: &str,
    curves: &[Curve<'_>],
    marks: &[Mark<'_>],
) -> String {
    let all = || curves.iter().flat_map(|c| &c.points);
    let frame = Frame::new(
        220.0,
        range(all().map(|p| p.0)),
        padded(range(all().map(|p| p.1))),
    );
    let mut svg = frame.open(horizontal, vertical);
    frame.grid(&mut svg, &ticks(frame.y), number);
    frame.labels(&mut svg, &ticks(frame.x), number);
    for mark in marks {
        let x = frame.px(mark.at);
        let _ = write!(
            svg,
            "<line x1='{x:.1}' x2='{x:.1}' y1='{:.1}' y2='{:.1}' class='mark'><title>{}</title></line>",
            frame.top,
            frame.bottom(),
            escaped(mark.label)
        );
    }
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let points = reduced(&curve.points, frame.x);
        let mut path = String::new();
        for (x, y) in points {
            let _ = write!(path, "{:.1},{:.1} ", frame.px(x), frame.py(y));
        }
        let _ = write!(
            svg,
            "<polyline points='{path}' fill='none' stroke='{colour}' stroke-width='1.2'/>"
        );
    }
    if curves.len() > 1 {
        legend(&mut svg, curves);
    }
    svg + "</svg>\n"
}

/// Counts in bins `(from, to, count)`; the horizontal axis is logarithmic, so is the count.
pub(crate) fn histogram(horizontal: &str, bins: &[(f64, f64, u64)]) -> String {
    let edges = bins.iter().flat_map(|b| [b.0.log10(), b.1.log10()]);
    let most = bins.iter().map(|b| b.2).max().unwrap_or(1).max(1);
    let frame = Frame::new(
        150.0,
        range(edges),
        (-0.3, (most as f64).log10().max(0.5) + 0.1),
    );
    let mut svg = frame.open(horizontal, "ticks");
    let decades = |(low, high): (f64, f64)| -> Vec<f64> {
        (low.ceil() as i32..=high.floor() as i32)
            .map(f64::from)
            .collect()
    };
    let power = |v: f64| number(10f64.powf(v));
    frame.grid(&mut svg, &decades(frame.y), power);
    for &(from, to, count) in bins.iter().filter(|b| b.2 > 0) {
        let (left, right) = (frame.px(from.log10()), frame.px(to.log10()));
        let top = frame.py((count as f64).log10());
        let _ = write!(
            svg,
            "<rect x='{left:.1}' y='{top:.1}' width='{:.1}' height='{:.1}' class='bar'>\
             <title>{} to {}: {count}</title></rect>",
            (right - left - 0.5).max(0.5),
            frame.bottom() - top,
            number(from),
            number(to)
        );
    }
    // One number per factor of ten says little where there are few of them.
    let steps: &[f64] = match frame.x.1 - frame.x.0 {
        span if span > 3.0 => &[1.0],
        _ => &[1.0, 2.0, 5.0],
    };
    let below: Vec<f64> = (frame.x.0.floor() as i32..=frame.x.1.ceil() as i32)
        .flat_map(|k| steps.iter().map(move |m| f64::from(k) + m.log10()))
        .filter(|v| (frame.x.0..=frame.x.1).contains(v))
        .collect();
    frame.labels(&mut svg, &below, power);
    svg + "</svg>\n"
}

/// The drawing area and the ranges it shows.
struct Frame {
    height: f64,
    top: f64,
    x: (f64, f64),
    y: (f64, f64),
}

impl Frame {
    fn new(height: f64, x: (f64, f64), y: (f64, f64)) -> Self {
        Self {
            height,
            top: MARGINS[2],
            x: widened(x),
            y: widened(y),
        }
    }

    fn bottom(&self) -> f64 {
        self.top + self.height
    }

    fn px(&self, x: f64) -> f64 {
        let span = WIDTH - MARGINS[0] - MARGINS[1];
        MARGINS[0] + span * (x - self.x.0) / (self.x.1 - self.x.0)
    }

    fn py(&self, y: f64) -> f64 {
        self.bottom() - self.height * (y - self.y.0) / (self.y.1 - self.y.0)
    }

    fn open(&self, horizontal: &str, vertical: &str) -> String {
        let total = self.bottom() + MARGINS[3];
        let (middle, half) = (
            (WIDTH + MARGINS[0] - MARGINS[1]) / 2.0,
            self.top + self.height / 2.0,
        );
        format!(
            "<svg viewBox='0 0 {WIDTH} {total:.0}' role='img'>\
             <text x='{middle:.0}' y='{:.0}' class='axis'>{}</text>\
             <text transform='translate(14 {half:.0}) rotate(-90)' class='axis'>{}</text>",
            total - 4.0,
            escaped(horizontal),
            escaped(vertical)
        )
    }

    /// Horizontal lines with their numbers.
    fn grid(&self, svg: &mut String, at: &[f64], text: impl Fn(f64) -> String) {
        for &value in at {
            let y = self.py(value);
            let _ = write!(
                svg,
                "<line x1='{0}' x2='{1}' y1='{y:.1}' y2='{y:.1}' class='grid'/>\
                 <text x='{2}' y='{3:.1}' class='left'>{4}</text>",
                MARGINS[0],
                WIDTH - MARGINS[1],
                MARGINS[0] - 6.0,
                y + 4.0,
                text(value)
            );
        }
    }

    /// The numbers below.
    fn labels(&self, svg: &mut String, at: &[f64], text: impl Fn(f64) -> String) {
        for &value in at {
            let _ = write!(
                svg,
                "<text x='{:.1}' y='{:.1}' class='below'>{}</text>",
                self.px(value),
                self.bottom() + 16.0,
                text(value)
            );
        }
    }
}

fn legend(svg: &mut String, curves: &[Curve<'_>]) {
    let mut x = MARGINS[0];
    for (curve, colour) in curves.iter().zip(COLOURS.iter().cycle()) {
        let _ = write!(
            svg,
            "<rect x='{x:.0}' y='{0}' width='14' height='4' fill='{colour}'/>\
             <text x='{1:.0}' y='{2}' class='key'>{3}</text>",
            8.0,
            x + 18.0,
            14.0,
            escaped(curve.label)
        );
        x += 40.0 + 7.5 * curve.label.chars().count() as f64;
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        })
}

fn padded((low, high): (f64, f64)) -> (f64, f64) {
    let pad = 0.05 * (high - low);
    (low - pad, high + pad)
}

/// A range that can be divided by.
fn widened((low, high): (f64, f64)) -> (f64, f64) {
    if !(low.is_finite() && high.is_finite()) {
        return (0.0, 1.0);
    }
    let least = 1e-9 * (low.abs() + high.abs()) + 1e-12;
    match high - low > least {
        true => (low, high),
        false => (
            low - 0.5 * low.abs().max(1.0),
            high + 0.5 * high.abs().max(1.0),
        ),
    }
}

/// Round numbers in a range, four to nine of them.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let rough = (high - low) / 6.0;
    let unit = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * unit)
        .find(|s| *s >= rough)
        .unwrap_or(10.0 * unit);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Up to four digits, without an exponent where that is readable.
fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" | "" => "0".to_owned(),
        other => other.to_owned(),
    }
}

/// The lowest and highest point of each of [`COLUMNS`] columns, in order of `x`: what a line drawn
/// through all points would cover.
fn reduced(points: &[(f64, f64)], (low, high): (f64, f64)) -> Vec<(f64, f64)> {
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
        let few = reduced(&points, (0.0, 1e5));
        assert!(few.len() <= 2 * COLUMNS + 2);
        assert!(few.contains(&(54_321.0, 7.0)) && few.contains(&(54_322.0, -3.0)));
        assert!(few.windows(2).all(|w| w[0].0 <= w[1].0));
    }

    #[test]
    fn charts_of_nothing_and_of_constants_are_well_formed() {
        let flat = Curve {
            label: "a < b",
            points: vec![(0.0, 2.0), (1.0, 2.0)],
        };
        let none = Curve {
            label: "none",
            points: Vec::new(),
        };
        for svg in [
            lines("t", "F", &[flat, none], &[]),
            lines("t", "F", &[], &[]),
            histogram("µs", &[]),
            histogram("µs", &[(1.0, 2.0, 5), (2.0, 4.0, 0)]),
        ] {
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"));
            assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("a < b"));
        }
    }

    #[test]
    fn tick_marks_are_round_and_inside() {
        assert_eq!(ticks((0.0, 5.0)), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let some = ticks((-0.013, 0.021));
        assert!((4..=9).contains(&some.len()), "{some:?}");
        assert_eq!(number(0.25), "0.25");
        assert_eq!(number(1e-9), "1e-9");
    }
}
