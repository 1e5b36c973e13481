//! Pictures: heat maps with contour lines, line charts, surfaces and points in space, drawn without
//! any installed font or display.

pub mod canvas;
pub mod cloud;
pub mod colour;
mod contour;
pub mod heat_map;
pub mod histogram;
mod legend;
pub mod line_chart;
mod reduce;
pub mod surface;

pub use canvas::{Area, Drawing, Panel, png, svg};
pub use cloud::Cloud;
pub use colour::{ColourMap, ColourScale};
pub use heat_map::{Contours, HeatMap};
pub use histogram::Histogram;
pub use line_chart::{LineChart, Mark, Series};
pub use reduce::reduced;
pub use surface::Surface;
