//! A plug with a lug, and the socket that it is pushed into, turned in, and let back.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};

use super::profiled::Solid;
use super::solids::{circle, finish, out_of_range};
use crate::mesh::error::MeshError;
use crate::mesh::triangle_mesh::TriangleMesh;

/// Sectors around.
const SECTORS: u32 = 64;
/// Radii of the plug, of its lug, and of the socket's outside, metres.
const RADII: [f64; 3] = [0.004, 0.006, 0.009];
/// Half the lug's angle, radians.
const HALF_LUG: f64 = 0.3;
/// Heights of the lug, of the plug above the lug's foot, and of the notch above the turn, metres.
const LUG: f64 = 0.003;
const PLUG: f64 = 0.014;
const NOTCH: f64 = 0.002;
/// Where the lug's foot stands while it turns, and the socket's upper face, metres.
const TURN: f64 = 0.002;
const TOP: f64 = 0.012;

/// A socket (fixed) and a plug (moving) whose lug lies in a notch a quarter turn from the groove by
/// which it came in, counter-clockwise seen from +z: out of it the plug is pushed down by 2 mm,
/// turned clockwise by a quarter, and drawn out along +z. `clearance` (metres) lies between all walls;
/// the identity is the assembled pose.
///
/// # Errors
/// If the clearance is not 0.005 .. 0.5 mm: the facets of the walls take 0.007 mm.
pub fn bayonet(clearance: f64) -> Result<(TriangleMesh, TriangleMesh), MeshError> {
    if !(5e-6..=5e-4).contains(&clearance) {
        let expected = "5e-6 .. 5e-4 m";
        return Err(out_of_range("bayonet", "clearance", expected, clearance));
    }
    Ok((socket(clearance)?, plug()?))
}

fn plug() -> Result<TriangleMesh, MeshError> {
    let foot = TURN + NOTCH;
    let heights = [foot, foot + LUG, foot + PLUG];
    let centre = FRAC_PI_2;
    let edges = edges(&[centre - HALF_LUG, centre + HALF_LUG]);
    let radius = |angle: f64, z: f64| {
        let lug = z < foot + LUG && (angle - centre).abs() < HALF_LUG;
        RADII[usize::from(lug)]
    };
    let mut solid = Solid::default();
    let rings = solid.skin(&relief(&edges, &heights, radius));
    solid.cap(rings[rings.len() - 1], None, true)?;
    solid.cap(rings[0], None, false)?;
    finish("plug", solid.vertices, solid.triangles)
}

fn socket(clearance: f64) -> Result<TriangleMesh, MeshError> {
    // At the lug's own radius, so that its sides keep the clearance all along.
    let wide = HALF_LUG + clearance / RADII[0];
    let floor = TURN - clearance - 0.001;
    let low = TURN - clearance;
    let heights = [
        floor,
        low,
        TURN + LUG + clearance,
        TURN + NOTCH + LUG + clearance,
        TOP,
    ];
    let edges = edges(&[-wide, wide, FRAC_PI_2 - wide, FRAC_PI_2 + wide]);
    let radius = |angle: f64, z: f64| {
        let [entry, notch] = [0.0, FRAC_PI_2].map(|c| (angle - c).abs() < wide);
        let between = (0.0..FRAC_PI_2).contains(&angle);
        let groove = z > low && (entry || (z < heights[3] && notch) || (z < heights[2] && between));
        RADII[usize::from(groove)] + clearance
    };
    let mut inner = relief(&edges, &heights, radius);
    inner.reverse();
    let outline = circle(RADII[2], SECTORS);
    let level = |z: f64| outline.iter().map(|p| p.extend(z)).collect::<Vec<DVec3>>();
    let mut solid = Solid::default();
    let outside = solid.skin(&[level(floor - 0.002), level(TOP)]);
    let inside = solid.skin(&inner);
    solid.cap(outside[1], Some(inside[0]), true)?;
    solid.cap(outside[0], None, false)?;
    solid.cap(inside[inside.len() - 1], None, true)?;
    finish("socket", solid.vertices, solid.triangles)
}

/// Angles between which radii are constant, rising, less than a turn in all: the wanted ones, and
/// between them as many as a circle of [`SECTORS`] has.
fn edges(wanted: &[f64]) -> Vec<f64> {
    let mut edges = Vec::new();
    for (i, &from) in wanted.iter().enumerate() {
        let to = wanted.get(i + 1).copied().unwrap_or(wanted[0] + TAU);
        let count = (f64::from(SECTORS) * (to - from) / TAU).ceil().max(1.0);
        edges.extend((0..count as u32).map(|k| from + (to - from) * f64::from(k) / count));
    }
    edges
}

/// Sections, upwards, of a wall whose radius is one number in every sector between two `edges` and two
/// `heights`, found at its middle. Corners that coincide are welded afterwards.
fn relief(edges: &[f64], heights: &[f64], radius: impl Fn(f64, f64) -> f64) -> Vec<Vec<DVec3>> {
    let next = |i: usize| match edges.get(i + 1) {
        Some(edge) => *edge,
        None => edges[0] + TAU,
    };
    let middle = |i: usize| {
        let angle = 0.5 * (edges[i] + next(i));
        if angle > 1.5 * std::f64::consts::PI {
            angle - TAU
        } else {
            angle
        }
    };
    let section = |z: f64, layer: f64| -> Vec<DVec3> {
        let sector = |i: usize| {
            let r = radius(middle(i), layer);
            [edges[i], next(i)].map(|a| (r * DVec2::from_angle(a)).extend(z))
        };
        (0..edges.len()).flat_map(sector).collect()
    };
    let layers = heights
        .windows(2)
        .map(|h| [h[0], h[1], 0.5 * (h[0] + h[1])]);
    layers
        .flat_map(|[low, high, layer]| [section(low, layer), section(high, layer)])
        .collect()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::surface::bvh::tree::Bvh;

    #[test]
    fn the_lug_goes_down_round_and_up() {
        let clearance = 5e-5;
        let (socket, plug) = bayonet(clearance).unwrap();
        assert!(bayonet(1e-3).is_err());
        let surface = Bvh::build(&socket);
        let least = |turn: f64, lift: f64| {
            let at = |p: &DVec3| DQuat::from_rotation_z(turn) * *p + DVec3::Z * lift;
            let apart = |p: &DVec3| surface.signed_distance(at(p));
            plug.vertices()
                .iter()
                .map(apart)
                .fold(f64::INFINITY, f64::min)
        };
        let facets = 8e-6;
        for (turn, lift) in [
            (0.0, 0.0),
            (0.0, -NOTCH),
            (-0.7, -NOTCH),
            (-FRAC_PI_2, -NOTCH),
            (-FRAC_PI_2, 0.0),
            (-FRAC_PI_2, 0.005),
        ] {
            let found = least(turn, lift);
            assert!(found > clearance - facets, "{turn} {lift}: {found}");
        }
        for (turn, lift) in [(0.0, 0.001), (-0.7, 0.0), (0.2, -NOTCH), (0.0, -0.004)] {
            assert!(least(turn, lift) < -1e-4, "{turn} {lift}");
        }
    }
}
