//! Meshes of a wanted number of triangles: finely cut flat faces, many true facets, curved; and
//! those of a folder.

use std::collections::HashMap;

use glam::{DVec2, DVec3};
use sdf_grid::shapes::{self, PegInHole};
use sdf_grid::{LengthUnit, RepairOptions, TriangleMesh, mesh_io};

use crate::Outcome;

/// The combined hole with its faces cut up until there are at least `count` triangles: what meshers
/// for simulation make of a CAD part.
///
/// # Errors
/// If the shape is refused.
pub fn cad(count: usize) -> Outcome<TriangleMesh> {
    let (hole, _) = PegInHole::Combined.pair(0.0)?;
    refined(&hole, count)
}

/// A block with a round hole of `count` / 4 facets: what fine deflection makes of a CAD part.
///
/// # Errors
/// If the shape is refused.
pub fn facets(count: usize) -> Outcome<TriangleMesh> {
    let segments = (count / 4).max(3);
    let turn = 2.0 * std::f64::consts::PI / segments as f64;
    let hole = (0..segments).map(|i| 0.01 * DVec2::from_angle(turn * i as f64));
    let outline = [(-0.02, -0.02), (0.02, -0.02), (0.02, 0.02), (-0.02, 0.02)].map(DVec2::from);
    Ok(shapes::prism(&outline, &[hole.collect()], 0.03)?)
}

/// A torus of about `count` triangles: no two faces in one plane.
///
/// # Errors
/// If the shape is refused.
pub fn curved(count: usize) -> Outcome<TriangleMesh> {
    let tube = ((count as f64 / 6.0).sqrt().round() as u32).max(3);
    Ok(shapes::torus(0.015, 0.007, 3 * tube, tube)?)
}

/// All meshes in a folder, OBJ and STL in metres, by the last 22 characters of their names.
///
/// # Errors
/// If the folder cannot be read or a mesh is refused.
pub fn read_folder(folder: &str) -> Outcome<Vec<(String, TriangleMesh)>> {
    let mut paths: Vec<_> = std::fs::read_dir(folder)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|e| e == "obj" || e == "stl"))
        .collect();
    paths.sort();
    let mut parts = Vec::new();
    for path in paths {
        let (mesh, _) = mesh_io::read(&path, LengthUnit::M, &RepairOptions::default())?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        parts.push((name.into_owned(), mesh));
    }
    Ok(parts)
}

/// The paper's round pair at `clearance` (metres) with circles of `count` / 4 facets, as wide as
/// those of [`PegInHole::Circular`] on average.
///
/// # Errors
/// If the shape is refused.
pub fn round_pair(clearance: f64, count: usize) -> Outcome<[TriangleMesh; 2]> {
    let segments = (count / 4).max(3);
    let turn = 2.0 * std::f64::consts::PI / segments as f64;
    let coarse = 2.0 * std::f64::consts::PI / f64::from(PegInHole::SEGMENTS);
    let same = (coarse.sin() / coarse).sqrt();
    let circle = |radius: f64| {
        let at = |i| same * radius * DVec2::from_angle(turn * i as f64);
        (0..segments).map(at).collect::<Vec<_>>()
    };
    let half = 0.5 * PegInHole::BLOCK;
    let outline = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let outline = outline.map(|(x, y)| half * DVec2::new(x, y));
    let hole = [circle(PegInHole::RADIUS + clearance)];
    Ok([
        shapes::prism(&outline, &hole, PegInHole::HEIGHT)?,
        shapes::prism(&circle(PegInHole::RADIUS), &[], PegInHole::HEIGHT)?,
    ])
}

/// `mesh` with every edge longer than some length halved, and again, until it has `count`
/// triangles or more.
///
/// # Errors
/// If the mesh is refused.
pub fn refined(mesh: &TriangleMesh, count: usize) -> Outcome<TriangleMesh> {
    let mut vertices = mesh.vertices().to_vec();
    let mut triangles = mesh.triangles().to_vec();
    let mut longest = mesh.bounds().diagonal();
    while triangles.len() < count {
        longest *= 0.9;
        while halve(&mut vertices, &mut triangles, longest) {}
    }
    let options = RepairOptions {
        weld_tolerance: 0.0,
        ..RepairOptions::default()
    };
    Ok(TriangleMesh::clean("refined", vertices, triangles, &options)?.0)
}

/// Halves every edge longer than `longest`; false if there was none.
fn halve(vertices: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, longest: f64) -> bool {
    let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
    let mut cut = Vec::with_capacity(2 * triangles.len());
    for &t in triangles.iter() {
        let middle = [0, 1, 2].map(|k| {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            let [p, q] = [a, b].map(|v| vertices[v as usize]);
            (p.distance(q) > longest).then(|| {
                *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    vertices.push(0.5 * (p + q));
                    vertices.len() as u32 - 1
                })
            })
        });
        // Turned so that the first edge is cut if one is, and the last is whole if one is.
        let turn = (0..3).find(|&k| middle[k].is_some() && middle[(k + 2) % 3].is_none());
        let at = |k: usize| (turn.unwrap_or(0) + k) % 3;
        let [a, b, c] = [t[at(0)], t[at(1)], t[at(2)]];
        match [middle[at(0)], middle[at(1)], middle[at(2)]] {
            [Some(d), Some(e), Some(f)] => {
                cut.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
            }
            [Some(d), Some(e), None] => cut.extend([[a, d, c], [d, b, e], [d, e, c]]),
            [Some(d), None, None] => cut.extend([[a, d, c], [d, b, c]]),
            _ => cut.push(t),
        }
    }
    *triangles = cut;
    !middles.is_empty()
}
