//! The paper's three peg-in-hole pairs (its Fig. 4a).

use glam::{DVec2, dvec2};
use serde::{Deserialize, Serialize};

use super::solids::{circle, named_prism, out_of_range};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// A peg and the block with a through hole that it fills, named by the cross-section they share.
///
/// The block is 40 mm x 40 mm x 30 mm, the peg 30 mm long; both are centred on the origin with the
/// axis along z, so the identity is the assembled pose, in which the end faces are flush.
///
/// ```
/// use sdf_grid::shapes::PegInHole;
///
/// let (block, peg) = PegInHole::Rectangular.pair(0.0)?;
/// // Without clearance the peg fills the hole: 40 mm x 40 mm x 30 mm in all.
/// assert!((block.volume() + peg.volume() - 4.8e-5).abs() < 1e-12);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PegInHole {
    /// A circle of radius 10 mm: any spin about the axis fits.
    Circular,
    /// A square of 20 mm x 20 mm: four poses fit, 90 degrees apart.
    Rectangular,
    /// The circle of radius 10 mm merged with a rectangle 8 mm wide that reaches 14 mm along +x:
    /// no rotation about the axis fits.
    Combined,
}

impl PegInHole {
    /// All three, in the paper's order.
    pub const ALL: [Self; 3] = [Self::Circular, Self::Rectangular, Self::Combined];

    /// Edge of the block across the axis, metres.
    pub const BLOCK: f64 = 0.040;
    /// Length of the peg and of the hole, metres.
    pub const HEIGHT: f64 = 0.030;
    /// Radius of the circle, and half the edge of the square, metres.
    pub const RADIUS: f64 = 0.010;
    /// Segments of the circle: its facets stray 5.4e-4 of the radius from it.
    pub const SEGMENTS: u32 = 96;

    /// Half the width of the combined section's key, and how far it reaches, metres.
    const KEY: DVec2 = dvec2(0.014, 0.004);

    /// The name used in files: `circular`, `rectangular` or `combined`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Circular => "circular",
            Self::Rectangular => "rectangular",
            Self::Combined => "combined",
        }
    }

    /// The hole (fixed part) and the peg (moving part). The peg has its nominal size, the hole is
    /// `clearance` metres wider on every side; at 0 both have the same facets where they touch.
    ///
    /// # Errors
    /// If the clearance is not 0 .. 5 mm.
    pub fn pair(self, clearance: f64) -> Result<(TriangleMesh, TriangleMesh), MeshError> {
        if !(0.0..=0.005).contains(&clearance) {
            let expected = "0 .. 0.005 m";
            return Err(out_of_range(self.name(), "clearance", expected, clearance));
        }
        let hole = named_prism(
            &format!("{} hole", self.name()),
            &rectangle(0.5 * Self::BLOCK, 0.5 * Self::BLOCK),
            &[self.section(clearance)],
            Self::HEIGHT,
        )?;
        let peg = named_prism(
            &format!("{} peg", self.name()),
            &self.section(0.0),
            &[],
            Self::HEIGHT,
        )?;
        Ok((hole, peg))
    }

    /// The cross-section widened by `offset` metres on every side (corners stay sharp),
    /// counter-clockwise.
    pub fn section(self, offset: f64) -> Vec<DVec2> {
        let radius = Self::RADIUS + offset;
        match self {
            Self::Circular => circle(radius, Self::SEGMENTS),
            Self::Rectangular => rectangle(radius, radius),
            Self::Combined => keyed_circle(radius, Self::KEY + offset),
        }
    }
}

fn rectangle(half_x: f64, half_y: f64) -> Vec<DVec2> {
    let corner = dvec2(half_x, half_y);
    [
        dvec2(-1.0, -1.0),
        dvec2(1.0, -1.0),
        dvec2(1.0, 1.0),
        dvec2(-1.0, 1.0),
    ]
    .map(|s| s * corner)
    .to_vec()
}

/// A circle merged with the rectangle from the centre to `key.x`, `key.y` to either side.
fn keyed_circle(radius: f64, key: DVec2) -> Vec<DVec2> {
    let start = (key.y / radius).asin();
    let arc = 2.0 * (std::f64::consts::PI - start);
    let steps =
        (f64::from(PegInHole::SEGMENTS) * arc / (2.0 * std::f64::consts::PI)).round() as u32;
    let mut outline = vec![dvec2(key.x, -key.y), key];
    outline.extend(
        (0..=steps)
            .map(|i| radius * DVec2::from_angle(start + arc * f64::from(i) / f64::from(steps))),
    );
    outline
}
