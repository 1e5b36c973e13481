//! A part's surface as points that are spread well.
//!
//! The sum over points errs where what they look at has a kink or a ridge: on the other surface's
//! planes and along its edges, which mating parts have side by side with their own. Points in rows
//! along such lines all err alike. So those of a flat face or a cylinder are the centroids of the
//! squares of a lattice turned by an angle that no row of points lies along the face's sides, and
//! towards sharp edges, along which other parts' edges come to lie, they are in two narrow rows, even
//! along each edge and beginning elsewhere on each. Those of a face that cannot be unrolled are the centroids of compact cells,
//! found by Lloyd's algorithm.

use glam::{DVec3, IVec3};
use rustc_hash::FxHashMap;

use super::cells::Cells;
use super::gathered::Gathered;
use super::lattices::lattices;
use super::sharp_edges::SharpEdges;
use super::smooth_parts::SmoothParts;
use crate::contact::error::ContactError;
use crate::contact::samples::{SurfaceSample, surface_pieces};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces::merge_coplanar;

/// Where the rows along sharp edges end, in units of the distance of points: at least, and by how
/// much farther at most.
const ROWS: [[f64; 2]; 2] = [[0.05, 0.15], [0.2, 0.8]];

/// Distance of the points of a row, in units of that of points.
const ALONG: f64 = 0.8;

/// Into how many pieces points are cut along each side: the most, and the fewest where a part is
/// large.
const CUTS: [f64; 2] = [12.0, 2.0];

/// Pieces from which on points are cut into fewer.
const PIECES: f64 = (1 << 22) as f64;

/// Points of less than this share of the area of a whole one join a neighbour.
const WHOLE: f64 = 0.4;

/// The row of points that are in none.
const LATTICE: usize = ROWS.len();

/// Where rows end at a place along an edge, in units of the distance of points: elsewhere at every
/// place, so that no edge crosses all points of a row at once, nor those next to the last row, which
/// would be in a row again if the lattice were cut along a line.
fn row_ends(place: IVec3) -> [f64; LATTICE] {
    // Multiples of the golden ratio, modulo one, are spread evenly.
    let [chain, point, _] = place.to_array().map(f64::from);
    let share = (0.754_877_666_2 * chain + 0.618_033_988_7 * point).rem_euclid(1.0);
    ROWS.map(|[least, more]| least + share * more)
}

/// Pieces of one point: its part of the surface, its row, and its place along the edge or in the
/// lattice.
type Key = (u32, usize, IVec3);

/// Points about `distance` (metres) apart on the surface of `mesh`, where what lies within `flat`
/// of a plane lies in it, for a kernel with a reach (metres).
///
/// # Errors
/// If there would be too many, or no triangle has an area.
pub(super) fn spread(
    mesh: &TriangleMesh,
    flat: f64,
    distance: f64,
    reach: f64,
) -> Result<Vec<SurfaceSample>, ContactError> {
    if !(distance.is_finite() && distance > 0.0) {
        return Err(ContactError::Distance { found: distance });
    }
    let parts = SmoothParts::new(mesh);
    let faces = merge_coplanar(mesh.triangles(), mesh.vertices(), flat);
    let lattices = lattices(mesh, &parts, distance, reach)?;
    let near = ROWS[ROWS.len() - 1].iter().sum::<f64>() * distance;
    let edges = SharpEdges::new(mesh, &parts, [near, ALONG * distance])?;
    // None where a curved surface has no lattice.
    let key = |part: u32, p: DVec3| {
        let in_row = edges.nearest(part, p).and_then(|(off, place)| {
            let row = row_ends(place)
                .iter()
                .position(|end| off < *end * distance)?;
            Some((part, row, place))
        });
        in_row.or_else(|| Some((part, LATTICE, lattices[part as usize].place(p, distance)?)))
    };
    let mut cells = Cells::new(distance);
    let mut points: FxHashMap<Key, Gathered> = FxHashMap::default();
    let all = || (0..faces.len()).filter_map(|i| faces.get(i));
    let sources: Vec<u32> = all().map(|f| f.source).collect();
    let points_expected = (mesh.area() / (distance * distance)).max(1.0);
    let cuts = (PIECES / points_expected).sqrt().clamp(CUTS[1], CUTS[0]);
    surface_pieces(all(), distance / cuts, |face, piece| {
        let part = parts.of[sources[face] as usize];
        match key(part, piece.position) {
            None => cells.add(part, &piece),
            Some(key) => points.entry(key).or_default().add(&piece),
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
fn joined(mut points: FxHashMap<Key, Gathered>, distance: f64) -> Vec<SurfaceSample> {
    let mut keys: Vec<Key> = points.keys().copied().collect();
    keys.sort_unstable_by_key(|(part, row, place)| (*part, *row, place.to_array()));
    let whole = |row: usize, place: IVec3| match row {
        0 => ALONG * row_ends(place)[0],
        LATTICE => 1.0,
        _ => ALONG * (row_ends(place)[row] - row_ends(place)[row - 1]),
    };
    for key in &keys {
        let (part, row, place) = *key;
        let small = points[key];
        if small.size >= WHOLE * whole(row, place) * distance * distance {
            continue;
        }
        // Other chains of edges are no neighbours.
        let x = if row == LATTICE { -1..=1 } else { 0..=0 };
        let around = x.flat_map(|x| (-1..=1).map(move |y| place + IVec3::new(x, y, 0)));
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
