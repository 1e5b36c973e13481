//! The score over two translations (figure 5).

use fft_correlate::TranslationWindow;
use ndarray::{Array2, Array3, Axis};
use pegfit_pictures::{AXES, PictureError, Surface};
use pegfit_scene::Assembly;

use crate::commands::scenes::within;
use crate::error::CommandError;

/// Two different axes from text such as `xz`; x and z if there is none.
pub(super) fn parse_plane(text: Option<&str>) -> Result<[usize; 2], CommandError> {
    let Some(text) = text else {
        return Ok([0, 2]);
    };
    let axis = |c: char| "xyz".find(c);
    match text.chars().map(axis).collect::<Vec<_>>()[..] {
        [Some(a), Some(b)] if a != b => Ok([a, b]),
        _ => Err(CommandError::option(
            "--along",
            "two of x, y, z, such as xz",
            text,
        )),
    }
}

/// The score with the assembled rotation over the scene's window along two of its axes, the third
/// displacement being that of the fit.
pub(in crate::commands) fn score_surface(
    assembly: &Assembly,
    plane: [usize; 2],
) -> Result<Vec<u8>, CommandError> {
    let parts = &assembly.setup.parts;
    let middle = assembly.pair.displacement(&parts.assembled);
    let across = 3 - plane[0] - plane[1];
    let mut reach = parts.reach();
    reach[across] = 0.0;
    let window = TranslationWindow::new(middle - reach, middle + reach, assembly.pair.spacing())
        .map_err(|e| CommandError::bad_input(within(assembly, "window"), e))?;
    let score = assembly.scores(&window)?;
    Ok(draw(assembly, plane, &window, middle, &score)?)
}

fn draw(
    assembly: &Assembly,
    plane: [usize; 2],
    window: &TranslationWindow,
    middle: glam::DVec3,
    score: &Array3<f32>,
) -> Result<Vec<u8>, PictureError> {
    let unit = assembly.setup.display_unit();
    let metre = unit.in_metres();
    let across = 3 - plane[0] - plane[1];
    // A fit between two nodes has two sheets; the first is within half a spacing.
    let values: Array2<f32> = score
        .index_axis(Axis(across), 0)
        .mapv(|v| (f64::from(v) / metre.powi(3)) as f32);
    let values = if plane[0] < plane[1] {
        values
    } else {
        values.reversed_axes()
    };
    let bounds = window.lattice().node_bounds();
    let range = |axis: usize| {
        [
            (bounds.min[axis] - middle[axis]) / metre,
            (bounds.max[axis] - middle[axis]) / metre,
        ]
    };
    let surface = Surface {
        title: format!(
            "Score of {} in {} over two translations",
            assembly.scene().moving.name,
            assembly.scene().fixed.name
        ),
        first: format!("{} ({unit})", AXES[plane[0]]),
        second: format!("{} ({unit})", AXES[plane[1]]),
        height: format!("score ({unit}³)"),
        values,
        first_range: range(plane[0]),
        second_range: range(plane[1]),
    };
    pegfit_pictures::png("score surface", (1200, 950), |sheet| surface.draw(sheet))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_two_letters() {
        assert_eq!(parse_plane(None).unwrap(), [0, 2]);
        assert_eq!(parse_plane(Some("zy")).unwrap(), [2, 1]);
        for bad in ["x", "xx", "xyz", "xw", ""] {
            assert!(parse_plane(Some(bad)).is_err(), "{bad}");
        }
    }
}
