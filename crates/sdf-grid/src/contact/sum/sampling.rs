//! Samples of a surface.
//!
//! The sum over samples errs where the other surface's field has a kink or a ridge: on its planes
//! and along its edges, which mating parts have next to their own. Samples in rows along such lines
//! all err alike. So samples of a flat face or a cylinder are the centroids of squares of a
//! lattice, turned so that none of its rows runs along the face's sides. Towards sharp edges, next
//! to which edges of other parts come to lie, they form two narrow rows, even along each edge and
//! with another phase on each. Samples of a face that cannot be developed are the centroids of
//! compact cells, found by Lloyd's algorithm.

use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec2, DVec3, IVec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::curved::Cylinder;
use super::regions::{SmoothParts, fit_cylinders};
use crate::contact::error::ContactError;
use crate::contact::samples::{SurfaceSample, surface_pieces};
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::pieces::merge_coplanar;

/// Sums over the pieces of one sample.
#[derive(Debug, Clone, Copy, Default)]
struct SampleAccumulator {
    /// Places times areas.
    pub(super) moment: DVec3,
    pub(super) area: DVec3,
    pub(super) size: f64,
}

impl SampleAccumulator {
    pub(super) fn add(&mut self, piece: &SurfaceSample) {
        let size = piece.area.length();
        self.moment += piece.position * size;
        self.area += piece.area;
        self.size += size;
    }

    pub(super) fn sample(&self) -> Option<SurfaceSample> {
        (self.size > 0.0).then(|| SurfaceSample {
            position: self.moment / self.size,
            area: self.area,
        })
    }
}

/// Steps of Lloyd's algorithm: more make cells rounder by a percent.
const STEPS: usize = 3;

/// Least distance of initial centres, in units of the wanted distance: gives as many cells as
/// squares of that side.
const APART: f64 = 0.82;

/// Cosine of the largest angle between the normals of a piece and its cell.
const ALIGNED: f64 = 0.5;

/// Pieces are first merged in boxes of this size, in units of the distance of cells.
const BOX: f64 = 0.2;

/// Pieces of a surface, divided into compact cells by Lloyd's algorithm.
struct Cells {
    distance: f64,
    /// By part and box.
    pieces: FxHashMap<(u32, IVec3), SampleAccumulator>,
}

/// A cell's part, middle and normal.
#[derive(Clone, Copy)]
struct Centre {
    part: u32,
    place: DVec3,
    normal: DVec3,
}

/// Centres by boxes of the distance's size.
type Boxes = FxHashMap<IVec3, Vec<u32>>;

impl Cells {
    pub(super) fn new(distance: f64) -> Self {
        Self {
            distance,
            pieces: FxHashMap::default(),
        }
    }

    /// Adds a piece of a part.
    pub(super) fn add(&mut self, part: u32, piece: &SurfaceSample) {
        let place = (piece.position / (BOX * self.distance)).floor().as_ivec3();
        self.pieces.entry((part, place)).or_default().add(piece);
    }

    /// One sample for each cell.
    pub(super) fn samples(&self) -> Vec<SurfaceSample> {
        // Pieces in a fixed order, so that results are deterministic.
        let mut order: Vec<_> = self.pieces.iter().collect();
        order.sort_unstable_by_key(|((part, place), _)| (*part, place.to_array()));
        let pieces = order.iter();
        let pieces = pieces.filter_map(|((part, _), sum)| Some((*part, sum.sample()?)));
        let pieces: Vec<(u32, SurfaceSample)> = pieces.collect();
        // Initial centres at least a minimum distance apart.
        let mut centres: Vec<Centre> = Vec::new();
        let mut boxes = Boxes::default();
        for (part, piece) in &pieces {
            let at = Centre::new(*part, piece);
            let nearest = self.nearest(&at, &centres, &boxes);
            if nearest.is_none_or(|(_, off)| off >= APART * self.distance) {
                let place = self.place(at.place);
                boxes.entry(place).or_default().push(centres.len() as u32);
                centres.push(at);
            }
        }
        // Lloyd iterations: assign pieces to the nearest centre, then recentre.
        let mut cells = Vec::new();
        for _ in 0..STEPS {
            cells = vec![SampleAccumulator::default(); centres.len()];
            let all = pieces.par_iter();
            let nearest = all.map(|(part, piece)| {
                let at = Centre::new(*part, piece);
                self.nearest(&at, &centres, &boxes).map(|(i, _)| i)
            });
            for ((_, piece), nearest) in pieces.iter().zip(nearest.collect::<Vec<_>>()) {
                if let Some(i) = nearest {
                    cells[i].add(piece);
                }
            }
            boxes.clear();
            for (i, (centre, cell)) in centres.iter_mut().zip(&cells).enumerate() {
                if let Some(sample) = cell.sample() {
                    *centre = Centre::new(centre.part, &sample);
                }
                let place = self.place(centre.place);
                boxes.entry(place).or_default().push(i as u32);
            }
        }
        cells.iter().filter_map(SampleAccumulator::sample).collect()
    }

    fn place(&self, p: DVec3) -> IVec3 {
        (p / self.distance).floor().as_ivec3()
    }

    /// The nearest centre within about one and a half times the distance of cells, and its
    /// distance.
    fn nearest(&self, at: &Centre, centres: &[Centre], boxes: &Boxes) -> Option<(usize, f64)> {
        let place = self.place(at.place);
        let around = (0..27).map(|i| place + IVec3::new(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1));
        let near = around.filter_map(|p| boxes.get(&p)).flatten();
        let near = near.map(|i| (*i as usize, &centres[*i as usize]));
        let alike = near.filter(|(_, c)| c.part == at.part && c.normal.dot(at.normal) > ALIGNED);
        let squared = alike.map(|(i, c)| (i, c.place.distance_squared(at.place)));
        let nearest = squared.min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map(|(i, squared)| (i, squared.sqrt()))
    }
}

impl Centre {
    fn new(part: u32, sample: &SurfaceSample) -> Self {
        Self {
            part,
            place: sample.position,
            normal: sample.area.normalize_or_zero(),
        }
    }
}

/// A lattice of squares on a part of a surface.
#[derive(Debug, Clone, Copy)]
enum PartLattice {
    /// In a plane: from the mesh's frame to that of the lattice, which has the normal as its third
    /// axis.
    Flat(DMat3),
    /// On a cylinder.
    Round(RoundLattice),
    /// There is none.
    None,
}

/// A lattice of squares on a cylinder that closes around it.
#[derive(Debug, Clone, Copy)]
struct RoundLattice {
    cylinder: Cylinder,
    /// Metres in the cylinder's unit.
    unit: f64,
    /// Once around, in squares along the lattice's two directions.
    around: [i32; 2],
    /// The side of the squares, metres.
    side: f64,
}

/// Lattices of squares `distance` wide on the parts of `mesh`, for a kernel with this reach
/// (metres).
///
/// The longest boundary edge of a flat part, and the axis of a cylinder, are at an angle to the
/// squares that spreads the projections of a square lattice on them best.
///
/// # Errors
/// If there would be too many pieces.
fn fit_lattices(
    mesh: &TriangleMesh,
    parts: &SmoothParts,
    distance: f64,
    reach: f64,
) -> Result<Vec<PartLattice>, ContactError> {
    let mut found: Vec<PartLattice> = parts.bent.iter().map(|_| PartLattice::None).collect();
    // Curved parts: on cylinders.
    for (part, cylinder) in fit_cylinders(mesh, parts, reach)?.1 {
        let lattice = RoundLattice::new(cylinder, reach, distance);
        found[part as usize] = lattice.map_or(PartLattice::None, PartLattice::Round);
    }
    // Flat parts: aligned with the longest edge of the boundary.
    let mut longest = vec![0.0; found.len()];
    for (t, corners) in mesh.faces().enumerate() {
        let part = parts.of[t] as usize;
        if parts.bent[part] {
            continue;
        }
        if longest[part] == 0.0 {
            found[part] = PartLattice::Flat(DMat3::from_quat(generic_rotation()));
        }
        for [a, b] in parts.boundary(mesh, t) {
            let [a, b] = [a, b].map(|v| mesh.vertices()[v as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let (Some(x), Some(z)) = ((b - a).try_normalize(), normal.try_normalize()) else {
                continue;
            };
            if a.distance(b) > longest[part] {
                let turn = DMat3::from_rotation_z(golden_direction().to_angle());
                let face = DMat3::from_cols(x, z.cross(x), z).transpose();
                longest[part] = a.distance(b);
                found[part] = PartLattice::Flat(turn * face);
            }
        }
    }
    Ok(found)
}

/// A rotation that aligns no edge of a part with a lattice by accident.
fn generic_rotation() -> DQuat {
    DQuat::from_scaled_axis(DVec3::new(0.553, -0.709, 0.961))
}

/// The direction of a square lattice's side whose slope is the golden ratio.
fn golden_direction() -> DVec2 {
    DVec2::new(1.0, 0.5 * (5f64.sqrt() - 1.0)).normalize()
}

impl PartLattice {
    /// The square in which a place is, whose sides are `distance` (metres) long in a plane.
    pub(super) fn place(&self, p: DVec3, distance: f64) -> Option<IVec3> {
        match self {
            Self::Flat(turn) => Some((*turn * p / distance).floor().as_ivec3().with_z(0)),
            Self::Round(lattice) => Some(lattice.place(p)),
            Self::None => None,
        }
    }
}

impl RoundLattice {
    /// None if the cylinder is too thin for squares of that size.
    fn new(cylinder: Cylinder, unit: f64, distance: f64) -> Option<Self> {
        let around = TAU * cylinder.radius() * unit;
        let squares = (golden_direction() * (around / distance)).round();
        let side = around / squares.length();
        (squares.min_element() >= 1.0 && squares.max_element() < 1e9).then(|| Self {
            cylinder,
            unit,
            around: squares.as_ivec2().to_array(),
            side,
        })
    }

    fn place(&self, p: DVec3) -> IVec3 {
        let developed = self.cylinder.developed(p / self.unit) * (self.unit / self.side);
        let [m, n] = self.around;
        // Along the direction in which `m` and `n` squares are once around, and across.
        let once = DVec2::new(f64::from(m), f64::from(n)).normalize();
        let turned = DVec2::new(
            developed.x * once.x - developed.y * once.y,
            developed.x * once.y + developed.y * once.x,
        );
        let place = turned.floor().as_i64vec2();
        // A square that is crossed by the seam has two places, once around apart.
        let [m, n] = [m, n].map(i64::from);
        let turns = (place.x * m + place.y * n).div_euclid(m * m + n * n);
        IVec3::new(
            (place.x - turns * m) as i32,
            (place.y - turns * n) as i32,
            0,
        )
    }
}

/// Sharp edges of each part, by boxes in which they are near.
#[derive(Debug)]
struct SharpEdges {
    /// How near is near, and the edge of the boxes, metres.
    near: f64,
    edges: Vec<SharpEdge>,
    chains: Vec<Chain>,
    boxes: FxHashMap<(u32, IVec3), Vec<u32>>,
}

/// An edge of the mesh at which a part ends.
#[derive(Debug, Clone, Copy)]
struct SharpEdge {
    ends: [DVec3; 2],
    /// The chain of edges without a corner that it belongs to, and how far along it begins, metres.
    chain: u32,
    start: f64,
}

/// Edges one after the other, without a corner.
#[derive(Debug, Clone, Copy)]
struct Chain {
    /// Metres.
    length: f64,
    /// Points along it.
    points: f64,
    /// Where points begin, in units of their distance: another place on each chain, or those of
    /// edges side by side would pass another part's rim together.
    phase: f64,
    /// Whether it goes round.
    closed: bool,
}

impl Chain {
    /// The number of the point at a position along the chain, metres. An open chain has one point
    /// more, the first and the last being partial.
    fn point(&self, along: f64) -> i32 {
        let place = (along / self.length * self.points + self.phase).floor();
        match self.closed {
            true => place.rem_euclid(self.points) as i32,
            false => place.clamp(0.0, self.points) as i32,
        }
    }
}

/// Boxes around a step along an edge: three along each side.
const AROUND: f64 = 27.0;

/// Boxes along all edges together, at most.
const MOST_BOXES: f64 = 1e7;

/// Multiples of this, modulo one, are spread evenly.
const SPREAD: f64 = 0.618_033_988_7;

/// Edges that turn by more than the angle of this cosine (30 degrees) make a corner.
const CORNER: f64 = 0.866;

impl SharpEdges {
    /// The sharp edges of `mesh`, looked up within `near`, in points `distance` apart (metres).
    ///
    /// # Errors
    /// If there would be too many boxes.
    pub(super) fn new(
        mesh: &TriangleMesh,
        parts: &SmoothParts,
        [near, distance]: [f64; 2],
    ) -> Result<Self, ContactError> {
        let mut found = Self {
            near,
            edges: Vec::new(),
            chains: Vec::new(),
            boxes: FxHashMap::default(),
        };
        let mut of_part: FxHashMap<u32, Vec<[u32; 2]>> = FxHashMap::default();
        for t in 0..mesh.triangles().len() {
            let boundary = of_part.entry(parts.of[t]).or_default();
            boundary.extend(parts.boundary(mesh, t));
        }
        let mut parts: Vec<_> = of_part.into_iter().collect();
        parts.sort_unstable_by_key(|(part, _)| *part);
        let mut listed = 0.0;
        for (part, boundary) in parts {
            let first = found.edges.len();
            found.add_chains(mesh, &boundary, distance);
            for i in first..found.edges.len() {
                found.add_to_boxes(part, i as u32, &mut listed)?;
            }
        }
        Ok(found)
    }

    /// Adds the boundary edges of a part.
    fn add_chains(&mut self, mesh: &TriangleMesh, boundary: &[[u32; 2]], distance: f64) {
        let at = |v: u32| mesh.vertices()[v as usize];
        let way = |[a, b]: [u32; 2]| (at(b) - at(a)).normalize_or_zero();
        // The boundary edge that follows each without a corner, if just one does.
        let mut from: FxHashMap<u32, Vec<usize>> = FxHashMap::default();
        for (i, edge) in boundary.iter().enumerate() {
            from.entry(edge[0]).or_default().push(i);
        }
        let next: Vec<Option<usize>> = boundary
            .iter()
            .map(|b| match from.get(&b[1]).map(Vec::as_slice) {
                Some([one]) if way(*b).dot(way(boundary[*one])) > CORNER => Some(*one),
                _ => None,
            })
            .collect();
        let mut follows = vec![false; boundary.len()];
        next.iter().flatten().for_each(|i| follows[*i] = true);
        let mut is_used = vec![false; boundary.len()];
        // Chains that begin at a corner first; the rest are closed.
        let begins = (0..boundary.len()).filter(|i| !follows[*i]);
        for begin in begins.chain(0..boundary.len()) {
            let (mut current, mut start) = (Some(begin), 0.0);
            let chain = self.chains.len() as u32;
            let mut closed = false;
            while let Some(i) = current.filter(|i| !is_used[*i]) {
                is_used[i] = true;
                let ends = boundary[i].map(at);
                self.edges.push(SharpEdge { ends, chain, start });
                start += ends[0].distance(ends[1]);
                current = next[i];
                closed = current == Some(begin);
            }
            if self.edges.last().is_some_and(|e| e.chain == chain) {
                self.chains.push(Chain {
                    length: start.max(f64::MIN_POSITIVE),
                    points: (start / distance).round().max(1.0),
                    phase: (SPREAD * f64::from(chain)).fract(),
                    closed,
                });
            }
        }
    }

    /// Adds an edge to all boxes within reach of half a step to either side.
    fn add_to_boxes(&mut self, part: u32, edge: u32, listed: &mut f64) -> Result<(), ContactError> {
        let near = self.near;
        let ends = self.edges[edge as usize].ends;
        let steps = (ends[0].distance(ends[1]) / near).ceil().max(1.0);
        *listed += AROUND * steps;
        if *listed > MOST_BOXES {
            return Err(ContactError::TooMany {
                what: "surface samples along edges",
                most: MOST_BOXES as usize,
                found: *listed,
            });
        }
        for i in 0..=steps as usize {
            let at = ends[0].lerp(ends[1], i as f64 / steps) / near;
            let (low, high) = ((at - 1.5).floor().as_ivec3(), (at + 1.5).floor().as_ivec3());
            for x in low.x..=high.x {
                for y in low.y..=high.y {
                    for z in low.z..=high.z {
                        let edges = self.boxes.entry((part, IVec3::new(x, y, z))).or_default();
                        if edges.last() != Some(&edge) {
                            edges.push(edge);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Distance of a place from the nearest sharp edge of a part, if it is near, with its chain and
    /// the point along it.
    pub(super) fn nearest(&self, part: u32, p: DVec3) -> Option<(f64, IVec3)> {
        let place = (p / self.near).floor().as_ivec3();
        let edges = self.boxes.get(&(part, place))?;
        let feet = edges.iter().map(|i| {
            let edge = &self.edges[*i as usize];
            let [a, b] = edge.ends;
            let (along, from) = (b - a, p - a);
            let t = (from.dot(along) / along.length_squared()).clamp(0.0, 1.0);
            (p.distance(a + along * t), edge, t * along.length())
        });
        let (off, edge, along) = feet.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let chain = &self.chains[edge.chain as usize];
        let point = chain.point(edge.start + along);
        Some((off, IVec3::new(edge.chain as i32, point, 0)))
    }
}

/// Ends of the rows along sharp edges, in units of the distance of points: the least, and the range
/// beyond it.
const ROWS: [[f64; 2]; 2] = [[0.05, 0.15], [0.2, 0.8]];

/// Distance of points within a row, in units of the distance of points.
const ALONG: f64 = 0.8;

/// Pieces of a point along each side: the most, and the fewest for large parts.
const CUTS: [f64; 2] = [12.0, 2.0];

/// Number of pieces beyond which points are cut into fewer.
const PIECES: f64 = (1 << 22) as f64;

/// Points with less than this share of a whole one's area are merged with a neighbour.
const WHOLE: f64 = 0.4;

/// The row number of points on the lattice.
const LATTICE: usize = ROWS.len();

/// Ends of the rows at a place along an edge, in units of the distance of points. They differ from
/// place to place, so that no other edge crosses all points of a row, or all those next to the last
/// row, at once.
fn row_ends(place: IVec3) -> [f64; LATTICE] {
    // Multiples of the golden ratio, modulo one, are spread evenly.
    let [chain, point, _] = place.to_array().map(f64::from);
    let share = (0.754_877_666_2 * chain + 0.618_033_988_7 * point).rem_euclid(1.0);
    ROWS.map(|[least, more]| least + share * more)
}

/// Pieces of one point: its part of the surface, its row, and its place along the edge or in the
/// lattice.
type Key = (u32, usize, IVec3);

/// Samples about `distance` (metres) apart on the surface of `mesh`, for a kernel with this reach
/// (metres). Vertices within `flat` of a plane count as in it.
///
/// # Errors
/// If there would be too many, or no triangle has an area.
pub(super) fn sample_surface(
    mesh: &TriangleMesh,
    flat: f64,
    distance: f64,
    reach: f64,
) -> Result<Vec<SurfaceSample>, ContactError> {
    if !(distance.is_finite() && distance > 0.0) {
        return Err(ContactError::Distance { found: distance });
    }
    // Smooth parts, flat faces, lattices and sharp edges.
    let parts = SmoothParts::new(mesh);
    let faces = merge_coplanar(mesh.triangles(), mesh.vertices(), flat);
    let lattices = fit_lattices(mesh, &parts, distance, reach)?;
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
    // Cuts faces into pieces and assigns each to a point.
    let mut cells = Cells::new(distance);
    let mut points: FxHashMap<Key, SampleAccumulator> = FxHashMap::default();
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
    // Merges what is too small.
    let mut points = merge_small(points, distance);
    points.extend(cells.samples());
    match points.is_empty() {
        true => Err(ContactError::EmptyMesh),
        false => Ok(points),
    }
}

/// Samples, small ones merged with their neighbours.
fn merge_small(mut points: FxHashMap<Key, SampleAccumulator>, distance: f64) -> Vec<SurfaceSample> {
    let mut keys: Vec<Key> = points.keys().copied().collect();
    keys.sort_unstable_by_key(|(part, row, place)| (*part, *row, place.to_array()));
    // Area of a whole point, in squares of the distance.
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
        let centre = |p: &SampleAccumulator| p.moment / p.size;
        // The nearest neighbour in the same row with a similar normal.
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
    left.filter_map(SampleAccumulator::sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// Squares are of one size, but for those that the ends cut, and none is cut by the seam.
    #[test]
    fn the_lattice_closes_around_a_cylinder() {
        let [radius, height, distance] = [0.005, 0.02, 0.0017];
        let mesh = shapes::cylinder(radius, height, 256).unwrap();
        let mesh = mesh.transformed(
            DQuat::from_scaled_axis(DVec3::new(0.3, 2.0, -0.5)),
            DVec3::ONE,
        );
        let parts = SmoothParts::new(&mesh);
        let lattices = fit_lattices(&mesh, &parts, distance, 0.003).unwrap();
        let round = lattices.iter().find_map(|l| match l {
            PartLattice::Round(r) => Some(*r),
            _ => None,
        });
        let round = round.expect("the wall of a cylinder is one");
        assert!((round.side / distance - 1.0).abs() < 0.05, "{round:?}");
        let (u, v) = round.cylinder.along().any_orthonormal_pair();
        let middle = mesh.centroid();
        let mut count = std::collections::HashMap::new();
        // Places as densely as 30 a side, around and along.
        let [around, up] = [TAU * radius, height].map(|l| (30.0 * l / round.side) as usize);
        for i in 0..around {
            let angle = TAU * i as f64 / around as f64;
            for j in 0..up {
                let high = height * ((j as f64 + 0.5) / up as f64 - 0.5);
                let p = middle + radius * (angle.cos() * u + angle.sin() * v);
                *count
                    .entry(round.place(p + high * round.cylinder.along()))
                    .or_insert(0) += 1;
            }
        }
        // A square of 30 by 30; those at the ends hold less.
        let whole = count.values().filter(|n| (850..950).contains(*n)).count();
        let area = TAU * radius * height / round.side.powi(2);
        let cut = TAU * radius / round.side * 2.0 * 2.0;
        assert!(count.values().all(|n| *n < 950), "{count:?}");
        assert!(whole as f64 > area - cut, "{whole} of {}", count.len());
        assert!((count.len() as f64) < area + cut, "{}", count.len());
    }

    fn edges(mesh: &TriangleMesh, distance: f64) -> (SmoothParts, SharpEdges) {
        let parts = SmoothParts::new(mesh);
        let edges = SharpEdges::new(mesh, &parts, [distance, distance]).unwrap();
        (parts, edges)
    }

    /// A rim of many facets is one chain, seen from the wall and from the lid, and as many points
    /// as fit are spread evenly along it, in any frame.
    #[test]
    fn points_are_even_around_a_rim() {
        let [radius, distance] = [0.005, 0.0017];
        let mesh = shapes::cylinder(radius, 0.02, 200).unwrap();
        let turn = glam::DQuat::from_scaled_axis(DVec3::new(0.7, -0.2, 1.9));
        let place = |p: DVec3| turn * p + DVec3::new(1.0, -3.0, 0.5);
        let mesh = mesh.transformed(turn, place(DVec3::ZERO));
        let (parts, edges) = edges(&mesh, distance);
        assert_eq!(edges.chains.len(), 4, "{:?}", edges.chains);
        let points = (std::f64::consts::TAU * radius / distance).round();
        let mut seen = 0;
        for part in 0..parts.bent.len() as u32 {
            let mut count = std::collections::BTreeMap::new();
            for i in 0..2000 {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 2000.0).sin_cos();
                let p = place(DVec3::new(radius * cos, radius * sin, 0.01));
                if let Some((off, at)) = edges.nearest(part, p) {
                    assert!(off < 2e-6, "{off}");
                    *count.entry(at.to_array()).or_insert(0) += 1;
                }
            }
            // The lid that is far away knows nothing of this rim.
            let even = 2000.0 / points;
            let all_even = count.values().all(|n| (f64::from(*n) - even).abs() < 3.0);
            assert!(all_even, "{count:?}");
            assert!(count.is_empty() || count.len() as f64 == points);
            seen += usize::from(!count.is_empty());
        }
        assert_eq!(seen, 2);
    }

    /// Each edge of a box is a chain of its own on either side, however its faces are cut.
    #[test]
    fn corners_end_chains() {
        let mesh = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
        let (_, edges) = edges(&mesh, 0.0015);
        let mut lengths: Vec<f64> = edges.chains.iter().map(|c| c.length).collect();
        lengths.sort_by(f64::total_cmp);
        assert_eq!(lengths.len(), 24);
        for (i, length) in lengths.iter().enumerate() {
            let expected = 0.01 * (i / 8 + 1) as f64;
            assert!((length - expected).abs() < 1e-12, "{lengths:?}");
        }
    }
}
