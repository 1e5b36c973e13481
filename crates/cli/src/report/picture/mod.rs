//! Pictures: heat maps with contour lines, line charts, surfaces and points in space, drawn without
//! any installed font or display.

pub mod canvas;
pub mod cloud;
pub mod colour;
mod contour;
pub mod heat_map;
mod legend;
pub mod line_chart;
pub mod surface;

pub use canvas::{Drawing, Panel, png};
pub use cloud::Cloud;
pub use colour::{ColourMap, ColourScale};
pub use heat_map::{Contours, HeatMap};
pub use line_chart::{LineChart, Mark, Series};
pub use surface::Surface;
