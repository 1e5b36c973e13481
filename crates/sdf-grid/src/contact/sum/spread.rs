//! A part's surface as points that are spread well.
//!
//! The sum over points errs where what they look at has a kink or a ridge: on the other surface's
//! planes and along its edges, which mating parts have side by side with their own. Points in rows
//! along such lines all err alike. So those of a flat face are the centroids of the squares of a
//! lattice turned by an angle that no row of points lies along the face's sides, and towards sharp
//! edges, along which other parts' edges come to lie, they are in two narrow rows. Those of a curved
//! face are the centroids of compact cells, found by Lloyd's algorithm.

use std::collections::HashMap;

use glam::{DMat3, DQuat, DVec3, IVec3};

use super::cells::Cells;
use super::gathered::Gathered;
use super::smooth_parts::SmoothParts;
use crate::contact::error::ContactError;
use crate::contact::samples::{SurfaceSample, surface_pieces};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces::merged;

/// Where the rows along sharp edges end, in units of the distance of points.
const ROWS: [f64; 2] = [0.12, 0.42];

/// Into how many pieces points are cut along each side: the most, and the fewest where a part is
/// large.
const CUTS: [f64; 2] = [12.0, 2.0];

/// Pieces from which on points are cut into fewer.
const PIECES: f64 = (1 << 22) as f64;

/// Boxes that gather what belongs to a point of a curved surface are this much wider than the
/// points' distance: surfaces cross them anyhow.
const WIDER: f64 = 1.15;

/// Points of less than this share of the area of a whole one join a neighbour.
const WHOLE: f64 = 0.4;

/// Pieces of one point: its part of the surface, its row (that of [`ROWS`], or their number), and
/// its place in a lattice.
type Key = (u32, usize, IVec3);

/// Points about `distance` (metres) apart on the surface of `mesh`, where what lies within `flat`
/// of a plane lies in it.
///
/// # Errors
/// If there would be too many, or no triangle has an area.
pub(super) fn spread(
    mesh: &TriangleMesh,
    flat: f64,
    distance: f64,
) -> Result<Vec<SurfaceSample>, ContactError> {
    if !(distance.is_finite() && distance > 0.0) {
        return Err(ContactError::Distance { found: distance });
    }
    let parts = SmoothParts::new(mesh);
    let faces = merged(mesh.triangles(), mesh.vertices(), flat);
    let lattices = lattices(mesh, &parts);
    let edges = SharpEdges::new(mesh, &parts, distance)?;
    let key = |part: u32, p: DVec3| {
        let off = edges.distance(part, p) / distance;
        let row = ROWS.iter().position(|end| off < *end);
        let lattice = &lattices[part as usize];
        let turned = match row {
            Some(_) => generic() * p,
            None => *lattice * p,
        };
        let bent = row.is_some() || parts.bent[part as usize];
        let wide = distance * if bent { WIDER } else { 1.0 };
        let place = (turned / wide).floor().as_ivec3();
        // Of the direction across a face there is one place.
        let place = if bent { place } else { place.with_z(0) };
        (part, row.unwrap_or(ROWS.len()), place)
    };
    let mut cells = Cells::new(distance);
    let mut points: HashMap<Key, Gathered> = HashMap::new();
    let all = || (0..faces.len()).filter_map(|i| faces.get(i));
    let sources: Vec<u32> = all().map(|f| f.source).collect();
    let points_expected = (mesh.area() / (distance * distance)).max(1.0);
    let cuts = (PIECES / points_expected).sqrt().clamp(CUTS[1], CUTS[0]);
    surface_pieces(all(), distance / cuts, |face, piece| {
        let part = parts.of[sources[face] as usize];
        let key = key(part, piece.position);
        match key.1 == ROWS.len() && parts.bent[part as usize] {
            true => cells.add(part, &piece),
            false => points.entry(key).or_default().add(&piece),
        }
    })?;
    let mut points = joined(points, distance);
    points.extend(cells.samples());
    match points.is_empty() {
        true => Err(ContactError::EmptyMesh),
        false => Ok(points),
    }
}

/// Points, those that are small joined to their neighbours.
fn joined(mut points: HashMap<Key, Gathered>, distance: f64) -> Vec<SurfaceSample> {
    let mut keys: Vec<Key> = points.keys().copied().collect();
    keys.sort_unstable_by_key(|(part, row, place)| (*part, *row, place.to_array()));
    let whole = |row: usize| match row {
        0 => ROWS[0],
        1 => ROWS[1] - ROWS[0],
        _ => 1.0,
    };
    for key in &keys {
        let (part, row, place) = *key;
        let small = points[key];
        if small.size >= WHOLE * whole(row) * distance * distance {
            continue;
        }
        let around = (0..27).map(|i| place + IVec3::new(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
        let centre = |p: &Gathered| p.moment / p.size;
        let others = around.filter(|p| *p != place).filter_map(|p| {
            let other = points.get(&(part, row, p))?;
            let along = other.area.normalize_or_zero().dot(small.area);
            let off = centre(other).distance(centre(&small));
            (along > 0.9 * small.area.length()).then_some((off, (part, row, p)))
        });
        let nearest = others.min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(other) = nearest.and_then(|(_, k)| points.get_mut(&k)) {
            other.moment += small.moment;
            other.area += small.area;
            other.size += small.size;
            points.remove(key);
        }
    }
    let left = keys.iter().filter_map(|k| points.get(k));
    left.filter_map(Gathered::sample).collect()
}

/// A rotation after which no edge of a part is along a lattice, unless it is made so.
fn generic() -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(0.553, -0.709, 0.961))
}

/// From the frame of the mesh to that of the lattice of each part: in a flat one across z, and its
/// longest border at the angle that spreads the projections of a square lattice best.
fn lattices(mesh: &TriangleMesh, parts: &SmoothParts) -> Vec<DMat3> {
    let mut longest = vec![(0.0, DMat3::from_quat(generic())); parts.bent.len()];
    for (t, corners) in mesh.faces().enumerate() {
        let part = parts.of[t] as usize;
        for [a, b] in parts.borders(mesh, t) {
            let [a, b] = [a, b].map(|v| mesh.vertices()[v as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let (Some(x), Some(z)) = ((b - a).try_normalize(), normal.try_normalize()) else {
                continue;
            };
            if a.distance(b) > longest[part].0 && !parts.bent[part] {
                let golden = 0.5 * (5f64.sqrt() - 1.0);
                let turn = DMat3::from_rotation_z(golden.atan());
                let face = DMat3::from_cols(x, z.cross(x), z).transpose();
                longest[part] = (a.distance(b), turn * face);
            }
        }
    }
    longest.into_iter().map(|l| l.1).collect()
}

/// Sharp edges of each part, by boxes in which they are near.
struct SharpEdges {
    /// How near is near, and the edge of the boxes, metres.
    near: f64,
    boxes: HashMap<(u32, IVec3), Vec<[DVec3; 2]>>,
}

/// Boxes along all edges together, at most.
const MOST_BOXES: f64 = 1e7;

impl SharpEdges {
    fn new(mesh: &TriangleMesh, parts: &SmoothParts, distance: f64) -> Result<Self, ContactError> {
        let near = ROWS[ROWS.len() - 1] * distance;
        let mut boxes: HashMap<(u32, IVec3), Vec<[DVec3; 2]>> = HashMap::new();
        let mut found = 0.0;
        for t in 0..mesh.triangles().len() {
            for ends in parts.borders(mesh, t) {
                let ends = ends.map(|v| mesh.vertices()[v as usize]);
                let steps = (ends[0].distance(ends[1]) / near).ceil().max(1.0);
                found += steps;
                if found > MOST_BOXES {
                    return Err(ContactError::TooMany {
                        what: "surface samples along edges",
                        most: MOST_BOXES as usize,
                        found,
                    });
                }
                for i in 0..=steps as usize {
                    let at = ends[0].lerp(ends[1], i as f64 / steps) / near;
                    // All boxes within reach of half a step to either side.
                    let (low, high) =
                        ((at - 1.5).floor().as_ivec3(), (at + 1.5).floor().as_ivec3());
                    for x in low.x..=high.x {
                        for y in low.y..=high.y {
                            for z in low.z..=high.z {
                                let edges = boxes.entry((parts.of[t], IVec3::new(x, y, z)));
                                let edges = edges.or_default();
                                if edges.last() != Some(&ends) {
                                    edges.push(ends);
                                }
                            }
                        }
                    }
                }
            }
        }
        Ok(Self { near, boxes })
    }

    /// Distance of a place from the nearest sharp edge of a part, infinite if that is not near.
    fn distance(&self, part: u32, p: DVec3) -> f64 {
        let place = (p / self.near).floor().as_ivec3();
        let Some(edges) = self.boxes.get(&(part, place)) else {
            return f64::INFINITY;
        };
        let squared = edges.iter().map(|[a, b]| {
            let (along, from) = (*b - *a, p - *a);
            let t = (from.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            from.distance_squared(along * t)
        });
        squared.fold(f64::INFINITY, f64::min).sqrt()
    }
}
