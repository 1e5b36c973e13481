//! A function of two variables as a surface in perspective.

use ndarray::Array2;
use plotters::prelude::*;

use crate::canvas::{Drawing, Panel, samples};
use crate::colour::ColourScale;
use crate::number::number;
use crate::rules::{FAINT, GRID, INK, centred, text, text_size, titled};

/// A function of two variables.
#[derive(Debug, Clone)]
pub struct Surface {
    /// Above the surface.
    pub title: String,
    /// First variable, with its unit.
    pub first: String,
    /// Second variable, with its unit.
    pub second: String,
    /// The function, with its unit.
    pub height: String,
    /// Values `[i, j]`: i along the first variable, j along the second.
    pub values: Array2<f32>,
    /// First variable at the first and the last sample.
    pub first_range: [f64; 2],
    /// Second variable at the first and the last sample.
    pub second_range: [f64; 2],
}

impl Surface {
    /// Draws the surface into a panel.
    ///
    /// # Errors
    /// If the drawing library refuses.
    pub fn draw(&self, panel: &Panel<'_>) -> Drawing {
        let width = panel.dim_in_pixel().0;
        let size = text_size(panel);
        let rest = titled(panel, &self.title)?;
        let (rest, foot) = rest.split_vertically(rest.dim_in_pixel().1 - 2 * size);
        let caption = format!(
            "along: {}   ·   into the page: {}   ·   up: {}",
            self.first, self.second, self.height
        );
        foot.draw_text(
            &caption,
            &centred(size, FAINT),
            (width as i32 / 2, size as i32 / 2),
        )?;
        let scale = ColourScale::sequential(self.values.iter().map(|v| f64::from(*v)));
        let (columns, rows) = self.values.dim();
        let (xs, zs) = (
            samples(self.first_range, columns),
            samples(self.second_range, rows),
        );
        let mut chart = ChartBuilder::on(&rest).margin(size).build_cartesian_3d(
            self.first_range[0]..self.first_range[1],
            scale.low..scale.high,
            self.second_range[0]..self.second_range[1],
        )?;
        chart.with_projection(|mut view| {
            view.pitch = 0.42;
            view.yaw = 0.65;
            view.scale = 0.82;
            view.into_matrix()
        });
        chart
            .configure_axes()
            .light_grid_style(GRID.mix(0.4))
            .bold_grid_style(GRID)
            .axis_panel_style(RGBColor(250, 250, 252))
            .label_style(text(size, INK))
            .x_labels(5)
            .y_labels(6)
            .z_labels(5)
            .x_formatter(&|v| number(*v, 3))
            .y_formatter(&|v| number(*v, 3))
            .z_formatter(&|v| number(*v, 3))
            .draw()?;
        // Four-cornered cells in index order are sorted by depth by the drawing library.
        let mut cells = Vec::with_capacity((columns - 1) * (rows - 1));
        for i in 0..columns - 1 {
            for j in 0..rows - 1 {
                let corner = |di: usize, dj: usize| {
                    let y = f64::from(self.values[[i + di, j + dj]]);
                    (xs[i + di], y, zs[j + dj])
                };
                let corners = vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                let mean = corners.iter().map(|c| c.1).sum::<f64>() / 4.0;
                cells.push(Polygon::new(corners, scale.colour(mean).filled()));
            }
        }
        chart.draw_series(cells)?;
        Ok(())
    }
}
