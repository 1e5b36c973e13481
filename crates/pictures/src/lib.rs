//! Pictures of density fields and of what is computed from them: heat maps with contour lines, line
//! charts, histograms, surfaces and points in space, drawn without any installed font or display.
//! Fields also as VTK images, for ParaView.
//!
//! [`png`] and [`svg`] make a sheet; everything else has a `draw` that takes a panel of it.

mod canvas;
mod cloud;
mod colour;
mod figure;
mod heat_map;
mod histogram;
mod line_chart;
mod surface;
mod vti;

pub use canvas::{Area, Drawing, DrawingError, Panel, PictureError, number, png, samples, svg};
pub use cloud::Cloud;
pub use colour::{ColourMap, ColourScale};
pub use figure::{
    AXES, Slice, SliceTextError, density_map, distance_contours, sheet, skeleton, skeleton_points,
};
pub use heat_map::{Contours, HeatMap};
pub use histogram::Histogram;
pub use line_chart::{LineChart, Mark, Series, reduced};
pub use surface::Surface;
pub use vti::write_vti;
