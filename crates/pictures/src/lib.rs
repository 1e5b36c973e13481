//! Pictures of density fields and of what is computed from them: heat maps with contour lines, line
//! charts, histograms, surfaces and points in space, drawn without any installed font or display.
//! Fields also as VTK images, for ParaView.
//!
//! `png` and `svg` make a sheet; everything else has a `draw` that takes a panel of it. In a browser
//! there are planes and skeletons as numbers only: the page draws.

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
mod skeleton;
mod slice;
#[cfg(not(target_family = "wasm"))]
mod surface;
#[cfg(not(target_family = "wasm"))]
mod vti;

pub use number::number;
pub use skeleton::skeleton_points;
pub use slice::{AXES, Slice, SliceError, SliceTextError, sheet};

#[cfg(not(target_family = "wasm"))]
pub use drawn::*;

/// Everything that is drawn.
#[cfg(not(target_family = "wasm"))]
mod drawn {
    pub use crate::canvas::{Area, Drawing, DrawingError, Panel, PictureError, png, samples, svg};
    pub use crate::cloud::Cloud;
    pub use crate::colour::{ColourMap, ColourScale};
    pub use crate::figure::{density_map, distance_contours, skeleton};
    pub use crate::heat_map::{Contours, HeatMap};
    pub use crate::histogram::Histogram;
    pub use crate::line_chart::{LineChart, Mark, Series, reduced};
    pub use crate::surface::Surface;
    pub use crate::vti::write_vti;
}
