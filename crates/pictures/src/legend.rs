//! The bar that says which colour is which value.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{
    Drawing, FAINT, INK, Panel, centred, number, round_ticks, stroke, text, text_size, titled,
};
use crate::colour::ColourScale;

/// Room that the bar and its numbers take, drawing pixels.
pub(crate) const WIDTH: u32 = stroke(150);

/// Draws `title` at the top of a panel and `note` at its foot; gives what is between, without and with
/// the room for the bar.
///
/// # Errors
/// If the drawing library refuses.
pub(crate) fn framed<'a>(
    panel: &Panel<'a>,
    title: &str,
    note: &str,
) -> Result<(Panel<'a>, Panel<'a>), Box<dyn std::error::Error + Send + Sync>> {
    let width = panel.dim_in_pixel().0;
    let size = text_size(panel);
    let rest = titled(panel, title)?;
    let (rest, foot) = rest.split_vertically(rest.dim_in_pixel().1 - 2 * size);
    let place = (width as i32 / 2, size as i32 / 2);
    foot.draw_text(note, &centred(size, FAINT), place)?;
    Ok(rest.split_horizontally(width - WIDTH - size))
}

/// Draws the bar with `caption` (the quantity and its unit, a line or several) above it.
pub(crate) fn draw(panel: &Panel<'_>, scale: &ColourScale, caption: &str, size: u32) -> Drawing {
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
