//! The sheet that pictures are drawn on, and how it becomes a PNG or an SVG.

use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::{
    BitMapBackend, DrawingArea, FontStyle, IntoDrawingArea, RGBColor, SVGBackend,
};
use plotters::style::register_font;

/// A rectangle of a sheet, of pixels or of lines.
pub type Area<DB> = DrawingArea<DB, Shift>;

/// A rectangle of a sheet of pixels.
pub type Panel<'a> = Area<BitMapBackend<'a>>;

/// Why a picture could not be drawn.
pub type DrawingError = Box<dyn std::error::Error + Send + Sync>;

/// What a drawing function returns; any drawing error is kept as text.
pub type Drawing = Result<(), DrawingError>;

/// The name under which the built-in face is registered.
pub(crate) const FACE: &str = "pegfit-sans";

/// The sheet.
pub(crate) const PAPER: RGBColor = RGBColor(255, 255, 255);

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
    let pixels = drawn(what, (width, height), draw)?;
    encode(&averaged(&pixels, width, height), width, height).map_err(|e| failed(what, e))
}

/// The same with two pixels per unit of width and height: sharp also on screens with small pixels.
///
/// # Errors
/// If drawing or encoding fails.
pub fn png_fine(
    what: &str,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Panel<'_>) -> Drawing,
) -> Result<Vec<u8>, PictureError> {
    let pixels = drawn(what, (width, height), draw)?;
    encode(&pixels, OVERSAMPLE * width, OVERSAMPLE * height).map_err(|e| failed(what, e))
}

fn failed(what: &str, reason: impl std::fmt::Display) -> PictureError {
    PictureError {
        what: what.to_owned(),
        reason: reason.to_string(),
    }
}

/// Red, green and blue of a drawing, [`OVERSAMPLE`] times as wide and as high.
fn drawn(
    what: &str,
    (width, height): (u32, u32),
    draw: impl FnOnce(&Panel<'_>) -> Drawing,
) -> Result<Vec<u8>, PictureError> {
    load_face();
    let large = (OVERSAMPLE * width, OVERSAMPLE * height);
    let mut pixels = vec![255; 3 * large.0 as usize * large.1 as usize];
    {
        let sheet = BitMapBackend::with_buffer(&mut pixels, large).into_drawing_area();
        sheet.fill(&PAPER).map_err(|e| failed(what, e))?;
        draw(&sheet).map_err(|e| failed(what, e))?;
        sheet.present().map_err(|e| failed(what, e))?;
    }
    Ok(pixels)
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
        Err(e) => Err(failed(what, e)),
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

/// A line width in picture pixels, as drawing pixels.
pub(crate) const fn stroke(pixels: u32) -> u32 {
    pixels * OVERSAMPLE
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

/// Samples of a picture that is `n` across: `low` and `high` with `n - 1` equal steps.
pub fn samples([low, high]: [f64; 2], n: usize) -> Vec<f64> {
    (0..n)
        .map(|i| low + (high - low) * i as f64 / (n - 1).max(1) as f64)
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
    use plotters::style::{IntoFont, TextStyle};

    fn style() -> TextStyle<'static> {
        TextStyle::from((FACE, 12).into_font())
    }

    #[test]
    fn a_sheet_becomes_a_png() {
        let bytes = png("test", (40, 30), |sheet| {
            sheet.draw_text("x", &style(), (5, 5))?;
            Ok(())
        })
        .unwrap();
        assert_eq!(&bytes[1..4], b"PNG");
        let fine = png_fine("test", (40, 30), |_| Ok(())).unwrap();
        // Width and height, as the file has them.
        assert_eq!((bytes[19], bytes[23], fine[19], fine[23]), (40, 30, 80, 60));
    }

    #[test]
    fn a_sheet_becomes_an_svg() {
        let text = svg("test", (40, 30), |sheet| {
            sheet.draw_text("a < b", &style(), (5, 5))?;
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
