//! Boxes, prisms, cylinders, spheres and tori.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use crate::mesh::error::MeshError;
use crate::mesh::polygon;
use crate::mesh::repair::report::RepairOptions;
use crate::mesh::triangle_mesh::TriangleMesh;

/// The most segments around a circle, or subdivisions of a sphere's faces, that are accepted.
const MAX_SEGMENTS: u32 = 4096;

/// A box with edges `size`.
///
/// # Errors
/// If an edge is not positive and finite.
pub fn cuboid(size: DVec3) -> Result<TriangleMesh, MeshError> {
    for length in size.to_array() {
        positive("cuboid", "edge", length)?;
    }
    let (x, y) = (0.5 * size.x, 0.5 * size.y);
    let outline = [(-x, -y), (x, -y), (x, y), (-x, y)].map(DVec2::from);
    named_prism("cuboid", &outline, &[], size.z)
}

/// A square plate with edges `side` and a thickness along z.
///
/// # Errors
/// If a length is not positive and finite.
pub fn plate(side: f64, thickness: f64) -> Result<TriangleMesh, MeshError> {
    cuboid(DVec3::new(side, side, thickness))
}

/// A cylinder whose circles are regular polygons of `segments` corners on the radius, the first
/// at +x.
///
/// # Errors
/// If a length is not positive and finite, or `segments` is not 3 .. 4096.
pub fn cylinder(radius: f64, height: f64, segments: u32) -> Result<TriangleMesh, MeshError> {
    positive("cylinder", "radius", radius)?;
    counted("cylinder", "segments", segments, 3)?;
    named_prism("cylinder", &circle(radius, segments), &[], height)
}

/// A prism along z over a polygon with holes, each listed either way round.
///
/// # Errors
/// If the height is not positive and finite, or the polygon has fewer than 3 corners, a corner that
/// is not finite, crosses itself, or has no area.
pub fn prism(
    outline: &[DVec2],
    holes: &[Vec<DVec2>],
    height: f64,
) -> Result<TriangleMesh, MeshError> {
    named_prism("prism", outline, holes, height)
}

/// A sphere made of an icosahedron whose faces are cut into `subdivisions`² triangles each, all
/// vertices on the radius.
///
/// # Errors
/// If the radius is not positive and finite, or `subdivisions` is not 1 .. 512.
pub fn icosphere(radius: f64, subdivisions: u32) -> Result<TriangleMesh, MeshError> {
    positive("icosphere", "radius", radius)?;
    if !(1..=512).contains(&subdivisions) {
        return Err(out_of_range(
            "icosphere",
            "subdivisions",
            "1 .. 512",
            f64::from(subdivisions),
        ));
    }
    let (corners, faces) = icosahedron();
    let n = subdivisions;
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for face in faces {
        let [a, b, c] = face.map(|i| corners[i]);
        let first = vertices.len() as u32;
        // Row i has n - i + 1 points; points shared between faces are welded afterwards.
        let at = |i: u32, j: u32| first + i * (2 * n + 3 - i) / 2 + j;
        for i in 0..=n {
            for j in 0..=n - i {
                let (u, v) = (f64::from(j) / f64::from(n), f64::from(i) / f64::from(n));
                vertices.push(radius * ((1.0 - u - v) * a + u * b + v * c).normalize());
                if i + j < n {
                    triangles.push([at(i, j), at(i, j + 1), at(i + 1, j)]);
                }
                if i + j + 1 < n {
                    triangles.push([at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)]);
                }
            }
        }
    }
    finish("icosphere", vertices, triangles)
}

/// A torus about z: tube of radius `minor` around the circle of radius `major`, cut into
/// `segments` around the axis and `tube_segments` around the tube.
///
/// # Errors
/// If a radius is not positive and finite, `minor` is not below `major`, or a count is not
/// 3 .. 4096.
pub fn torus(
    major: f64,
    minor: f64,
    segments: u32,
    tube_segments: u32,
) -> Result<TriangleMesh, MeshError> {
    positive("torus", "major radius", major)?;
    positive("torus", "minor radius", minor)?;
    if minor >= major {
        let expected = "below the major radius";
        return Err(out_of_range("torus", "minor radius", expected, minor));
    }
    counted("torus", "segments", segments, 3)?;
    counted("torus", "tube segments", tube_segments, 3)?;
    let tube = circle(minor, tube_segments);
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for (i, direction) in circle(1.0, segments).into_iter().enumerate() {
        for (j, p) in tube.iter().enumerate() {
            vertices.push((direction * (major + p.x)).extend(p.y));
            let ring = |i: usize| (i as u32 % segments) * tube_segments;
            let [j0, j1] = [j as u32, (j as u32 + 1) % tube_segments];
            let [a, b] = [ring(i) + j0, ring(i + 1) + j0];
            let [c, d] = [ring(i + 1) + j1, ring(i) + j1];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    finish("torus", vertices, triangles)
}

/// Corners of a regular polygon on the radius, counter-clockwise, the first at +x.
pub fn circle(radius: f64, segments: u32) -> Vec<DVec2> {
    (0..segments)
        .map(|i| radius * DVec2::from_angle(2.0 * PI * f64::from(i) / f64::from(segments)))
        .collect()
}

/// A [`prism`] that errors call `name`.
///
/// # Errors
/// As [`prism`].
pub fn named_prism(
    name: &str,
    outline: &[DVec2],
    holes: &[Vec<DVec2>],
    height: f64,
) -> Result<TriangleMesh, MeshError> {
    positive(name, "height", height)?;
    let rings: Vec<&[DVec2]> = std::iter::once(outline)
        .chain(holes.iter().map(Vec::as_slice))
        .collect();
    let refuse = |polygon: usize, found: &str| MeshError::Polygon {
        part: name.to_owned(),
        polygon,
        found: found.to_owned(),
    };
    for (k, ring) in rings.iter().enumerate() {
        if ring.len() < 3 {
            return Err(refuse(k, &format!("{} corners", ring.len())));
        }
        if let Some(p) = ring.iter().find(|p| !p.is_finite()) {
            return Err(refuse(k, &format!("corner {p}")));
        }
    }
    let caps = polygon::triangulate(outline, holes)
        .ok_or_else(|| refuse(0, "one that crosses itself or its holes, or has no area"))?;

    let corners = rings.iter().map(|r| r.len()).sum::<usize>() as u32;
    let level = |z: f64| rings.iter().copied().flatten().map(move |p| p.extend(z));
    let vertices: Vec<DVec3> = level(-0.5 * height).chain(level(0.5 * height)).collect();
    let top = |t: [u32; 3]| t.map(|i| i + corners);
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for &[a, b, c] in &caps {
        triangles.extend([[a, c, b], top([a, b, c])]);
    }
    let mut first = 0;
    for (k, ring) in rings.iter().enumerate() {
        let n = ring.len() as u32;
        let solid_on_left = (polygon::signed_area(ring) > 0.0) == (k == 0);
        for i in 0..n {
            // The diagonal does not depend on the side the solid is on: a peg and its hole then
            // have the same facets.
            let (a, b) = (first + i, first + (i + 1) % n);
            let (c, d) = (b + corners, a + corners);
            if solid_on_left {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, c, b], [a, d, c]]);
            }
        }
        first += n;
    }
    finish(name, vertices, triangles)
}

fn icosahedron() -> ([DVec3; 12], [[usize; 3]; 20]) {
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let corners = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    #[rustfmt::skip]
    let faces = [
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11],
        [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6], [7, 1, 8],
        [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9],
        [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ];
    (corners.map(DVec3::from_array), faces)
}

/// Welds what shares a position and repairs the rest.
///
/// # Errors
/// As [`TriangleMesh::clean`].
pub fn finish(
    name: &str,
    vertices: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
) -> Result<TriangleMesh, MeshError> {
    let options = RepairOptions {
        weld_tolerance: 1e-9,
        ..RepairOptions::default()
    };
    TriangleMesh::clean(name, vertices, triangles, &options).map(|(mesh, _)| mesh)
}

/// Refuses lengths that are not positive and finite.
///
/// # Errors
/// If `found` is one.
pub fn positive(part: &str, item: &'static str, found: f64) -> Result<(), MeshError> {
    if found.is_finite() && found > 0.0 {
        return Ok(());
    }
    Err(out_of_range(
        part,
        item,
        "a positive number of metres",
        found,
    ))
}

/// Refuses numbers of segments below `least` or above 4096.
///
/// # Errors
/// If `found` is one.
pub fn counted(part: &str, item: &'static str, found: u32, least: u32) -> Result<(), MeshError> {
    if (least..=MAX_SEGMENTS).contains(&found) {
        return Ok(());
    }
    Err(out_of_range(part, item, "3 .. 4096", f64::from(found)))
}

/// The error of a size or count outside its range.
pub fn out_of_range(
    part: &str,
    item: &'static str,
    expected: &'static str,
    found: f64,
) -> MeshError {
    MeshError::OutOfRange {
        part: part.to_owned(),
        item,
        expected,
        found,
    }
}
