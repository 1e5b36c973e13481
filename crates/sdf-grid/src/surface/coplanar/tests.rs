use std::f64::consts::TAU;

use glam::DQuat;

use super::*;
use crate::surface::face::Face;

const FLAT: f64 = 4e-7;

/// Eight decimals, of normalized coordinates of about 1.
fn rounded(p: DVec3) -> DVec3 {
    (p * 1e7).round() * 1e-7
}

/// The side of a cylinder of `sides` strips of `layers` pieces, each cut into two triangles.
fn strips(sides: u32, layers: u32, place: impl Fn(DVec3) -> DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..sides {
        let direction = glam::DVec2::from_angle(TAU * f64::from(i) / f64::from(sides));
        for layer in 0..=layers {
            let z = f64::from(layer) / f64::from(layers);
            vertices.push(place((0.1 * direction).extend(z - 0.5)));
        }
    }
    let at = |i: u32, layer: u32| i % sides * (layers + 1) + layer;
    for (i, l) in (0..sides).flat_map(|i| (0..layers).map(move |l| (i, l))) {
        let [a, b, c, d] = [(i, l), (i + 1, l), (i + 1, l + 1), (i, l + 1)].map(|(i, l)| at(i, l));
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    (vertices, triangles)
}

fn faces(indices: &[[u32; 3]], vertices: &[DVec3]) -> Vec<Face> {
    let pieces = merge_coplanar(indices, vertices, FLAT);
    let piece = |i| Face::new(&pieces.get(i).unwrap());
    (0..pieces.len()).map(piece).collect()
}

fn regions(indices: &[[u32; 3]], vertices: &[DVec3]) -> usize {
    Surface::new(indices, vertices, FLAT).regions().count()
}

/// A plane from one narrow triangle of rounded corners is wrong farther away; that of its strip is
/// not.
#[test]
fn strips_of_rounded_corners_are_merged() {
    let turn = DQuat::from_scaled_axis(DVec3::new(0.3, 1.1, -0.5));
    let (vertices, triangles) = strips(300, 16, |p| rounded(turn * p));
    assert_eq!(regions(&triangles, &vertices), 300);
    let faces = faces(&triangles, &vertices);
    let area: f64 = faces.iter().map(|f| f.area).sum();
    let around = 300.0 * 2.0 * (TAU / 600.0).sin() * 0.1;
    assert!((area - around).abs() < 1e-6 * around, "{area} {around}");
    // Where corners were dropped the surface has moved by what says that they may be.
    for v in &vertices {
        let off = faces.iter().map(|f| f.distance_squared(*v));
        let off = off.fold(f64::INFINITY, f64::min).sqrt();
        assert!(off < 1.5 * FLAT, "{off:e}");
    }
}

/// Curved surfaces stay what they are as long as their faces show.
#[test]
fn faces_that_bend_are_not_merged() {
    // Strips of 1e-3 whose neighbours' far sides lie 1e-5 off their plane.
    let (vertices, triangles) = strips(600, 1, |p| p);
    assert_eq!(regions(&triangles, &vertices), 600);
    // Many more bend by less than files round: then several make one face, and none is farther off.
    let (vertices, triangles) = strips(6000, 1, |p| p);
    let count = regions(&triangles, &vertices);
    assert!((700..6000).contains(&count), "{count}");
    let merged = faces(&triangles, &vertices);
    for v in vertices.iter().step_by(7) {
        let near = merged.iter().map(|f| f.distance_squared(*v));
        let off = near.fold(f64::INFINITY, f64::min).sqrt();
        assert!(off < 1.5 * FLAT, "{off:e}");
    }
}

/// `n` x `n` unit squares without those of `left_out`.
fn squares(n: u32, left_out: &[(u32, u32)]) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let places = (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j)));
    let vertices = places.map(|(i, j)| DVec3::new(i.into(), j.into(), 0.0) / f64::from(n));
    let mut triangles = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        if !left_out.contains(&(i, j)) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (vertices.collect(), triangles)
}

/// Two holes that touch in a corner, and one that touches the outline.
#[test]
fn outlines_that_touch_are_cut_anew() {
    for left_out in [vec![(3, 3), (4, 4)], vec![(0, 2), (1, 1)]] {
        let (vertices, triangles) = squares(8, &left_out);
        let faces = faces(&triangles, &vertices);
        let area: f64 = faces.iter().map(|f| f.area).sum();
        assert!((area - 62.0 / 64.0).abs() < 1e-12, "{area}");
        assert!(faces.len() < 40, "{}", faces.len());
        // The holes are left open.
        for (i, j) in left_out {
            let middle = DVec3::new(f64::from(i) + 0.5, f64::from(j) + 0.5, 0.0) / 8.0;
            let off = faces.iter().map(|f| f.distance_squared(middle));
            let off = off.fold(f64::INFINITY, f64::min).sqrt();
            assert!((off - 1.0 / 16.0).abs() < 1e-12, "{off}");
        }
    }
}

/// Rounding turns needles over; what lies under them is there twice.
#[test]
fn a_needle_upside_down_is_taken_back() {
    let (mut vertices, mut triangles) = squares(8, &[]);
    // The left half bulges into the right one.
    let middle = vertices.len() as u32;
    vertices.push(vertices[40] + DVec3::new(1e-5, 0.0, 0.0));
    for t in &mut triangles {
        if t.iter().all(|v| vertices[*v as usize].x < 0.51) {
            let corner = t.iter_mut().filter(|v| **v == 40);
            corner.for_each(|v| *v = middle);
        }
    }
    let (lower, upper) = (39, 41);
    // Two needles, upside down, where both lie.
    triangles.extend([[lower, 40, middle], [40, upper, middle]]);
    let surface = Surface::new(&triangles, &vertices, FLAT);
    let down = surface.facets.iter().filter(|f| f.normal.z < 0.0);
    assert_eq!(down.count(), 2);
    assert_eq!(surface.regions().count(), 1);
    let faces = faces(&triangles, &vertices);
    let area: f64 = faces.iter().map(|f| f.area).sum();
    assert!((area - 1.0).abs() < 1e-12, "{area}");
    assert!(faces.len() < 40, "{}", faces.len());
}

/// Front and back of a sheet without thickness are two faces.
#[test]
fn sheets_keep_both_sides() {
    let (vertices, mut triangles) = squares(4, &[]);
    // The back shares the outline's corners; inside, the front has more.
    let corner = |i: u32, j: u32| i * 5 + j;
    let ring: Vec<u32> = [
        (0..4).map(|j| corner(0, j)).collect::<Vec<_>>(),
        (0..4).map(|i| corner(i, 4)).collect(),
        (0..4).map(|j| corner(4, 4 - j)).collect(),
        (0..4).map(|i| corner(4 - i, 0)).collect(),
    ]
    .concat();
    let middle = corner(2, 2);
    triangles.extend((0..16).map(|k| [ring[k], ring[(k + 1) % 16], middle]));
    let faces = faces(&triangles, &vertices);
    let up: f64 = faces.iter().map(|f| f.area * f.normal.z).sum();
    let all: f64 = faces.iter().map(|f| f.area).sum();
    assert!(up.abs() < 1e-12 && (all - 2.0).abs() < 1e-12, "{up} {all}");
}

/// A comb is straightened tooth by tooth: not more than a bounded number of looks.
#[test]
fn combs_do_not_take_for_ever() {
    let teeth = 60_000u32;
    let width = 1.0 / f64::from(teeth);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for i in 0..=teeth {
        let x = f64::from(i) * width;
        vertices.extend([DVec3::new(x, 0.0, 0.0), DVec3::new(x, 1e-3, 0.0)]);
        vertices.push(DVec3::new(x + 0.5 * width, 2e-3, 0.0));
        if i < teeth {
            let [a, b, tip, c, d] = [0, 1, 2, 3, 4].map(|k| 3 * i + k);
            triangles.extend([[a, c, d], [a, d, b], [b, d, tip]]);
        }
    }
    let surface = Surface::new(&triangles, &vertices, FLAT);
    let regions = surface.regions();
    assert_eq!(regions.count(), 1);
    let rings = surface.straighten_all(&surface.loops(&regions, 0).unwrap());
    let kept: usize = rings.iter().map(Vec::len).sum();
    // All tips, and the valleys between them; the straight back is dropped if there is time for it.
    assert!(kept >= 2 * teeth as usize, "{kept}");
}
