//! Several plots on one sheet, at whatever size they are shown.

use crate::canvas::{Panel, PictureError, png, png_fine};
use crate::heat_map::HeatMap;
use crate::line_chart::LineChart;
use crate::surface::Surface;

/// One plot.
#[derive(Debug, Clone)]
pub enum Plot {
    /// Colours over a rectangle.
    Map(HeatMap),
    /// Curves.
    Lines(LineChart),
    /// A function of two variables.
    Surface(Surface),
}

/// Plots in rows on one sheet.
#[derive(Debug, Clone)]
pub struct PlotSheet {
    /// What errors call it.
    pub what: &'static str,
    /// Row after row.
    pub plots: Vec<Plot>,
    /// Plots in a row, at least one.
    pub across: usize,
}

impl PlotSheet {
    /// The sheet as a PNG file's bytes, `size` pixels wide and high.
    ///
    /// # Errors
    /// If drawing or encoding fails.
    pub fn png(&self, size: (u32, u32)) -> Result<Vec<u8>, PictureError> {
        png(self.what, size, |sheet| self.draw(sheet))
    }

    /// The same with two pixels per unit of `size`, for screens with small pixels: type is as large as
    /// on [`PlotSheet::png`] where both are shown as wide.
    ///
    /// # Errors
    /// If drawing or encoding fails.
    pub fn png_fine(&self, size: (u32, u32)) -> Result<Vec<u8>, PictureError> {
        png_fine(self.what, size, |sheet| self.draw(sheet))
    }

    fn draw(&self, sheet: &Panel<'_>) -> crate::canvas::Drawing {
        let rows = self.plots.len().div_ceil(self.across.max(1)).max(1);
        let panels = sheet.split_evenly((rows, self.across.max(1)));
        for (panel, plot) in panels.iter().zip(&self.plots) {
            match plot {
                Plot::Map(map) => map.draw(panel)?,
                Plot::Lines(chart) => chart.draw(panel)?,
                Plot::Surface(surface) => surface.draw(panel)?,
            }
        }
        Ok(())
    }
}
