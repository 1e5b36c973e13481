//! The sheet that pictures are drawn on, and how it becomes a PNG or an SVG.

use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, DrawingBackend, FontStyle, IntoDrawingArea, RGBColor, SVGBackend,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, IntoFont, TextStyle, register_font};

use crate::number::number;

/// A rectangle of a sheet, of pixels or of lines.
pub type Area<DB> = DrawingArea<DB, Shift>;

/// A rectangle of a sheet of pixels.
pub type Panel<'a> = Area<BitMapBackend<'a>>;

/// Why a picture could not be drawn.
pub type DrawingError = Box<dyn std::error::Error + Send + Sync>;

/// What a drawing function returns; any drawing error is kept as text.
pub type Drawing = Result<(), DrawingError>;

/// Text and axes.
pub(crate) const INK: RGBColor = RGBColor(38, 42, 51);
/// Less important text and light axes.
pub(crate) const FAINT: RGBColor = RGBColor(120, 126, 138);
/// Lines that mark an event.
pub(crate) const EVENT: RGBColor = RGBColor(219, 128, 118);
/// Grid lines.
pub(crate) const GRID: RGBColor = RGBColor(226, 229, 235);
/// The sheet.
pub(crate) const PAPER: RGBColor = RGBColor(255, 255, 255);

/// The name under which the built-in face is registered.
pub(crate) const FACE: &str = "pegfit-sans";

/// Pictures are drawn this many times larger and averaged down, for smooth slanted lines.
const OVERSAMPLE: u32 = 2;

/// Draws on a white sheet of `width` by `height` pixels and returns it as a PNG file's bytes;
/// `what` names the picture in errors.
///
/// # Errors
/// If drawing or encoding fails.
pub fn png(
    what: &str,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Panel<'_>) -> Drawing,
) -> Result<Vec<u8>, PictureError> {
    let failed = |reason: String| PictureError {
        what: what.to_owned(),
        reason,
    };
    load_face();
    let large = (OVERSAMPLE * width, OVERSAMPLE * height);
    let mut pixels = vec![255; 3 * large.0 as usize * large.1 as usize];
    {
        let sheet = BitMapBackend::with_buffer(&mut pixels, large).into_drawing_area();
        sheet.fill(&PAPER).map_err(|e| failed(e.to_string()))?;
        draw(&sheet).map_err(|e| failed(e.to_string()))?;
        sheet.present().map_err(|e| failed(e.to_string()))?;
    }
    encode(&averaged(&pixels, width, height), width, height).map_err(|e| failed(e.to_string()))
}

/// What the drawing library writes for files that stand alone.
const NAME_SPACE: &str = r#" xmlns="http://www.w3.org/2000/svg""#;

/// Draws as [`png`] does and returns an SVG element, which a page may show at any width. Within a
/// page it needs no name space, and a page without addresses is seen to fetch nothing.
///
/// # Errors
/// If drawing fails.
pub fn svg(
    what: &str,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Area<SVGBackend<'_>>) -> Drawing,
) -> Result<String, PictureError> {
    load_face();
    let mut text = String::new();
    let drawn = {
        let size = (OVERSAMPLE * width, OVERSAMPLE * height);
        let sheet = SVGBackend::with_string(&mut text, size).into_drawing_area();
        draw(&sheet).and_then(|()| Ok(sheet.present()?))
    };
    match drawn {
        Ok(()) => Ok(text.replacen(NAME_SPACE, "", 1)),
        Err(e) => Err(PictureError {
            what: what.to_owned(),
            reason: e.to_string(),
        }),
    }
}

/// Means over blocks of [`OVERSAMPLE`]² pixels.
fn averaged(pixels: &[u8], width: u32, height: u32) -> Vec<u8> {
    let (w, h, n) = (width as usize, height as usize, OVERSAMPLE as usize);
    let mut out = Vec::with_capacity(3 * w * h);
    for y in 0..h {
        for x in 0..w {
            for c in 0..3 {
                let block = (0..n * n).map(|k| {
                    let (px, py) = (n * x + k % n, n * y + k / n);
                    u32::from(pixels[3 * (py * n * w + px) + c])
                });
                out.push((block.sum::<u32>() / (n * n) as u32) as u8);
            }
        }
    }
    out
}

/// Height of ordinary text in a panel, drawing pixels.
pub(crate) fn text_size<DB: DrawingBackend>(panel: &Area<DB>) -> u32 {
    let (width, height) = panel.dim_in_pixel();
    (height.min(width) / 32).clamp(14 * OVERSAMPLE, 26 * OVERSAMPLE)
}

/// A line width in picture pixels, as drawing pixels.
pub(crate) const fn stroke(pixels: u32) -> u32 {
    pixels * OVERSAMPLE
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
    if title.is_empty() {
        return Ok(panel.clone());
    }
    let size = text_size(panel);
    let (top, rest) = panel.split_vertically(2 * size + size / 2);
    let middle = (
        panel.dim_in_pixel().0 as i32 / 2,
        size as i32 + size as i32 / 3,
    );
    top.draw_text(title, &centred(size + size / 4, INK), middle)?;
    Ok(rest)
}

fn encode(pixels: &[u8], width: u32, height: u32) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Best);
    encoder.set_adaptive_filter(png::AdaptiveFilterType::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

fn load_face() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let face = epaint_default_fonts::UBUNTU_LIGHT;
        if register_font(FACE, FontStyle::Normal, face).is_err() {
            tracing::error!("the built-in font cannot be read: pictures cannot be drawn");
        }
    });
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

/// A tick label on an axis from `low` to `high`: rounding around zero is zero.
pub(crate) fn tick(value: f64, [low, high]: [f64; 2]) -> String {
    match value.abs() < 1e-9 * (high - low) {
        true => number(0.0, 4),
        false => number(value, 4),
    }
}

/// Samples of a picture that is `n` across: `low` and `high` with `n - 1` equal steps.
pub fn samples([low, high]: [f64; 2], n: usize) -> Vec<f64> {
    (0..n)
        .map(|i| low + (high - low) * i as f64 / (n - 1).max(1) as f64)
        .collect()
}

/// Evenly placed round numbers that cover a range: 1, 2 or 5 times a power of ten apart.
pub(crate) fn round_ticks(low: f64, high: f64, about: usize) -> Vec<f64> {
    let raw = (high - low) / about.max(1) as f64;
    if !(raw.is_finite() && raw > 0.0) {
        return vec![low];
    }
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|m| m * power)
        .find(|s| *s >= raw)
        .unwrap_or(10.0 * power);
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    (first as i64..=last as i64)
        .map(|i| i as f64 * step)
        .collect()
}

/// A picture that could not be drawn or encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw {what}: {reason}")]
pub struct PictureError {
    /// Which picture.
    pub what: String,
    /// The drawing library's reason.
    pub reason: String,
}

#[cfg(test)]
mod tests {
    use super::*;

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
    }

    #[test]
    fn a_sheet_becomes_a_png() {
        let bytes = png("test", (40, 30), |sheet| {
            sheet.draw_text("x", &text(12, INK), (5, 5))?;
            Ok(())
        })
        .unwrap();
        assert_eq!(&bytes[1..4], b"PNG");
    }

    #[test]
    fn a_sheet_becomes_an_svg() {
        let text = svg("test", (40, 30), |sheet| {
            sheet.draw_text("a < b", &text(12, INK), (5, 5))?;
            Ok(())
        })
        .unwrap();
        assert!(
            !text.contains("http")
                && text.starts_with("<svg")
                && text.trim_end().ends_with("</svg>"),
            "{text}"
        );
        assert!(text.contains("a &lt; b"), "{text}");
    }
}
