//! Pictures of density fields and of what is computed from them: heat maps with contour lines, line
//! charts, histograms, surfaces and points in space, drawn without any installed font or display.
//! Fields also as VTK images, for ParaView.
//!
//! `png` and `svg` make a sheet; everything else has a `draw` that takes a panel of it. In a
//! browser there are planes and skeletons as numbers only: the page draws.

#[cfg(not(target_family = "wasm"))]
mod axis;
#[cfg(not(target_family = "wasm"))]
mod canvas;
#[cfg(not(target_family = "wasm"))]
mod cloud;
#[cfg(not(target_family = "wasm"))]
mod colour;
#[cfg(not(target_family = "wasm"))]
mod figure;
#[cfg(not(target_family = "wasm"))]
mod heat_map;
#[cfg(not(target_family = "wasm"))]
mod histogram;
#[cfg(not(target_family = "wasm"))]
mod line_chart;
mod number;
#[cfg(not(target_family = "wasm"))]
mod plots;
#[cfg(not(target_family = "wasm"))]
mod rules;
mod skeleton_points;
mod slice;
#[cfg(not(target_family = "wasm"))]
mod surface;
#[cfg(not(target_family = "wasm"))]
mod vti;

pub use number::number;
pub use skeleton_points::skeleton_points;
pub use slice::{AXES, Slice, SliceError, SliceTextError, sheet};

#[cfg(not(target_family = "wasm"))]
pub use canvas::{Area, Drawing, DrawingError, Panel, PictureError, png, png_fine, samples, svg};
#[cfg(not(target_family = "wasm"))]
pub use cloud::Cloud;
#[cfg(not(target_family = "wasm"))]
pub use colour::{ColourMap, ColourScale};
#[cfg(not(target_family = "wasm"))]
pub use figure::{density_map, distance_contours, skeleton};
#[cfg(not(target_family = "wasm"))]
pub use heat_map::{Contours, HeatMap};
#[cfg(not(target_family = "wasm"))]
pub use histogram::Histogram;
#[cfg(not(target_family = "wasm"))]
pub use line_chart::{LineChart, Mark, Series, reduced};
#[cfg(not(target_family = "wasm"))]
pub use plots::{Plot, PlotSheet};
#[cfg(not(target_family = "wasm"))]
pub use rules::{COLOURS, MOST_SERIES, Quantity};
#[cfg(not(target_family = "wasm"))]
pub use surface::Surface;
#[cfg(not(target_family = "wasm"))]
pub use vti::write_vti;
