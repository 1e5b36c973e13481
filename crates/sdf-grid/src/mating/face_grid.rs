//! A surface's faces in a uniform grid of cells, for thousands of questions about what lies near a
//! point.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicI8, AtomicUsize, Ordering::Relaxed};

use glam::{DVec3, IVec3};

use super::features::normal;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// Entries of the cells that a grid aims at, at most: cells grow until a surface has no more.
const ENTRIES: f64 = 4e6;

/// Blocks of a grid, about, at most: cells grow until there are no more.
const BLOCKS: f64 = (1 << 18) as f64;

/// A surface with more faces in a square of the reach is decimated first, and moves by at most this
/// share of the reach in the mean (rms).
const MOST_FACES: f64 = 8.0;
const OFF: f64 = 0.002;

/// Parts of a cell along each axis, each with its middle's distance from the surface and the faces
/// that lines through it may meet.
const PARTS: usize = 4;
const ALL_PARTS: usize = PARTS * PARTS * PARTS;

/// Faces that all parts may list; beyond that a part uses its cell's.
const LISTED: usize = 1 << 23;

/// Such distances are kept as multiples of this share of the reach, and up to 127 of these.
const UNIT: f64 = 1.0 / 32.0;
const UNKNOWN: i8 = i8::MIN;

/// How far beside a face a line may pass and still meet it, reaches.
const BESIDE: f64 = 1e-6;

/// Cells along each edge of a block, as a power of two, and all of them.
const BLOCK: u32 = 4;
const EDGE: usize = 1 << BLOCK;
const ALL_CELLS: usize = EDGE * EDGE * EDGE;

/// In the index of a block, what marks a space without faces within reach.
const EMPTY: u16 = 1 << 15;

type Key = [i32; 3];

/// A cell, and the faces within reach of it.
#[derive(Clone, Copy)]
struct CellFaces<'a> {
    cell: &'a Cell,
    faces: &'a [u32],
}

/// A surface that is asked what lies near a point: opposite faces along a normal, and depth.
///
/// ```
/// use glam::DVec3;
/// use sdf_grid::{FaceGrid, shapes};
///
/// // The upper face of a cube, from half a millimetre above it.
/// let cube = shapes::cuboid(DVec3::splat(0.01)).unwrap();
/// let grid = FaceGrid::new(&cube, 0.001, 0.9);
/// let met = grid.opposite_face(DVec3::new(0.001, 0.0, 0.0055), -DVec3::Z, [0.001; 2]);
/// assert!((met.unwrap().gap - 0.0005).abs() < 1e-12);
/// assert!(grid.is_deeper(DVec3::new(0.0, 0.0, 0.0045), 0.0004));
/// ```
#[derive(Debug)]
pub struct FaceGrid {
    cell: f64,
    reach: f64,
    cosine: f64,
    sine: f64,
    bounds: Aabb,
    origin: DVec3,
    /// Blocks along each axis: they cover all that is within reach.
    shape: [usize; 3],
    blocks: Vec<Block>,
    /// Faces within reach of each block, one block after the other.
    block_faces: Vec<u32>,
    faces: Vec<GridFace>,
    bvh: Bvh,
    /// Faces that parts list.
    listed: AtomicUsize,
}

/// A cube of cells, which are made when one of them is first asked for: most questions are about few
/// places of a large part.
#[derive(Debug, Default)]
struct Block {
    /// Range of the faces within reach of it.
    first: u32,
    last: u32,
    cells: OnceLock<Box<BlockCells>>,
}

#[derive(Debug)]
struct BlockCells {
    /// Of every cell its number in `cells`, or `EMPTY` and its number in `spaces`; nothing where the
    /// whole block is the first of these.
    index: Vec<u16>,
    /// Every cell with faces within reach.
    cells: Vec<Cell>,
    /// Faces of all cells.
    list: Vec<u32>,
    /// The other cells, as far as they hang together.
    spaces: Vec<EmptySpace>,
}

/// Cells of a block without faces within reach, which lie on one side of the surface.
#[derive(Debug)]
struct EmptySpace {
    /// The middle of one of them.
    middle: DVec3,
    inside: OnceLock<bool>,
}

#[derive(Debug)]
struct Cell {
    /// Range of its block's list of faces within reach.
    first: u32,
    last: u32,
    /// Signed distances of the middles of its parts, units, as far as they have been asked for.
    distances: OnceLock<Box<[AtomicI8; ALL_PARTS]>>,
    /// Faces that lines through its parts may meet, of those parts that lines have passed.
    met: PartLists,
    /// Faces that may be nearest to points of its parts, of those parts that were asked for depths.
    nearest: PartLists,
}

/// Faces of every part of a cell, as far as they have been asked for.
type PartLists = OnceLock<Box<[OnceLock<Box<[u32]>>; ALL_PARTS]>>;

/// A part of a cell.
#[derive(Clone, Copy)]
struct Part {
    index: usize,
    middle: DVec3,
}

#[derive(Debug)]
struct GridFace {
    normal: DVec3,
    /// Of its plane along the normal, metres.
    offset: f64,
    /// Normals of the edges in the plane, away from the face, and their offsets; edge `k` begins at
    /// corner `k`.
    outward: [(DVec3, f64); 3],
    corners: [DVec3; 3],
}

/// An opposite face that a line meets.
///
/// See the example of [`FaceGrid`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OppositeFace {
    /// How far along the line's direction it lies, metres; negative behind the point.
    pub gap: f64,
    /// Its normal.
    pub normal: DVec3,
}

impl FaceGrid {
    /// The grid of a surface for questions about faces at most `reach` (metres, above 0) away, and
    /// opposite ones whose normals have at least `cosine` (above 0) in common with the opposite of the
    /// line that meets them. Of a surface with far more faces than the reach can tell apart, some are
    /// taken together, to within some thousandths of the reach.
    pub fn new(mesh: &TriangleMesh, reach: f64, cosine: f64) -> Self {
        let fine = mesh.triangles().len() as f64 > MOST_FACES * mesh.area() / (reach * reach);
        match fine {
            true => Self::of_faces(&mesh.decimated(OFF * reach), reach, cosine),
            false => Self::of_faces(mesh, reach, cosine),
        }
    }

    fn of_faces(mesh: &TriangleMesh, reach: f64, cosine: f64) -> Self {
        let faces: Vec<GridFace> = mesh.faces().map(GridFace::new).collect();
        let bounds = mesh.bounds();
        let covered = bounds.size() + 2.0 * reach;
        let least = covered.element_product().cbrt() / BLOCKS.cbrt() / EDGE as f64;
        let cell = reach.max((3.0 * mesh.area() / ENTRIES).sqrt()).max(least);
        let shape = (covered / (EDGE as f64 * cell)).floor().to_array();
        let mut grid = Self {
            cell,
            reach,
            cosine,
            sine: (1.0 - cosine * cosine).sqrt(),
            bounds,
            origin: bounds.min - reach,
            shape: shape.map(|n| n as usize + 1),
            blocks: Vec::new(),
            block_faces: Vec::new(),
            faces,
            bvh: Bvh::build(mesh),
            listed: AtomicUsize::new(0),
        };
        let mut entries: Vec<(u32, u32)> = Vec::new();
        for (index, face) in grid.faces.iter().enumerate() {
            let range = grid.range(face).map(|key| key.map(|k| k >> BLOCK));
            grid.visit(face, EDGE as f64 * cell, range, |key| {
                let block = grid.block(key);
                entries.extend(block.map(|block| (block as u32, index as u32)));
            });
        }
        entries.sort_unstable();
        let mut last = 0;
        let block = |block: usize| {
            let first = last;
            last += entries[last..].partition_point(|e| e.0 as usize <= block);
            Block {
                first: first as u32,
                last: last as u32,
                cells: OnceLock::new(),
            }
        };
        grid.blocks = (0..grid.shape.iter().product()).map(block).collect();
        grid.block_faces = entries.iter().map(|e| e.1).collect();
        grid
    }

    /// The number of a block.
    fn block(&self, key: Key) -> Option<usize> {
        let [x, y, z] = key.map(|k| k as usize);
        let [wide, deep, high] = self.shape;
        (x < wide && y < deep && z < high).then(|| (x * deep + y) * high + z)
    }

    /// First and last cells of the box around a face, widened by the reach.
    fn range(&self, face: &GridFace) -> [Key; 2] {
        let [a, b, c] = face.corners;
        [
            self.key(a.min(b).min(c) - self.reach),
            self.key(a.max(b).max(c) + self.reach),
        ]
    }

    /// Calls `found` with every cube of a range, edges `size` long (metres), that the face, widened by
    /// the reach, may touch.
    fn visit(&self, face: &GridFace, size: f64, [low, high]: [Key; 2], mut found: impl FnMut(Key)) {
        let far = (1.0 + 1e-9) * (self.reach + 0.5 * size * 3f64.sqrt());
        let middle = |[x, y, z]: Key| {
            let cube = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
            self.origin + (cube + 0.5) * size
        };
        // Columns along the axis that is most normal to the face meet its plane in few cubes.
        let mut key = [0; 3];
        let steep = face.normal.abs();
        let along = (0..3).fold(0, |k, i| if steep[i] > steep[k] { i } else { k });
        let [u, v] = [(along + 1) % 3, (along + 2) % 3];
        for x in low[u]..=high[u] {
            for y in low[v]..=high[v] {
                (key[along], key[u], key[v]) = (0, x, y);
                let foot = face.height(middle(key)) / (size * face.normal[along]);
                let half = far / (size * steep[along]);
                let from = ((-foot - half).floor() as i32).max(low[along]);
                let to = ((-foot + half).ceil() as i32).min(high[along]);
                for z in from..=to {
                    key[along] = z;
                    let middle = middle(key);
                    if face.height(middle).abs() <= far && face.covers(middle, far) {
                        found(key);
                    }
                }
            }
        }
    }

    /// The cells of a block.
    fn cells(&self, block: Key, faces: &[u32]) -> BlockCells {
        let first = block.map(|k| k << BLOCK);
        let last = first.map(|k| k + EDGE as i32 - 1);
        let mut entries: Vec<(u16, u32)> = Vec::new();
        for &index in faces {
            let face = &self.faces[index as usize];
            let [low, high] = self.range(face);
            let low = std::array::from_fn(|i| low[i].max(first[i]));
            let high = std::array::from_fn(|i| high[i].min(last[i]));
            self.visit(face, self.cell, [low, high], |key| {
                entries.push((within_block(key) as u16, index));
            });
        }
        entries.sort_unstable();
        let mut index = match faces.is_empty() {
            true => Vec::new(),
            false => vec![u16::MAX; ALL_CELLS],
        };
        let mut cells = Vec::new();
        for same in entries.chunk_by(|a, b| a.0 == b.0) {
            index[same[0].0 as usize] = cells.len() as u16;
            let first = cells.last().map_or(0, |c: &Cell| c.last);
            cells.push(Cell {
                first,
                last: first + same.len() as u32,
                distances: OnceLock::new(),
                met: OnceLock::new(),
                nearest: OnceLock::new(),
            });
        }
        let seeds = number_spaces(&mut index);
        let space = |seed: usize| {
            let local = [seed >> (2 * BLOCK), seed >> BLOCK, seed].map(|k| (k % EDGE) as i32);
            EmptySpace {
                middle: self.middle(std::array::from_fn(|i| first[i] + local[i])),
                inside: OnceLock::new(),
            }
        };
        BlockCells {
            index,
            cells,
            list: entries.iter().map(|e| e.1).collect(),
            spaces: seeds.into_iter().map(space).collect(),
        }
    }

    /// A block's cells; none if they are not covered.
    fn block_cells(&self, key: Key) -> Option<&BlockCells> {
        let of = key.map(|k| k >> BLOCK);
        let block = &self.blocks[self.block(of)?];
        let faces = &self.block_faces[block.first as usize..block.last as usize];
        Some((block.cells).get_or_init(|| Box::new(self.cells(of, faces))))
    }

    /// A cell with faces within reach.
    fn cell(&self, key: Key) -> Option<CellFaces<'_>> {
        self.block_cells(key)?.cell(key).ok()
    }

    /// The cell of a point. Points less than a cell before the first one count as in it: nothing is
    /// within reach of them.
    fn key(&self, p: DVec3) -> Key {
        ((p - self.origin) / self.cell).as_ivec3().to_array()
    }

    /// The middle of a cell.
    fn middle(&self, [x, y, z]: Key) -> DVec3 {
        let cell = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        self.origin + (cell + 0.5) * self.cell
    }

    /// The part of a cell that a point lies in.
    fn part(&self, key: Key, p: DVec3) -> Part {
        let width = self.cell / PARTS as f64;
        let corner = self.middle(key) - 0.5 * self.cell;
        let last = IVec3::splat(PARTS as i32 - 1);
        let part = ((p - corner) / width).as_ivec3().clamp(IVec3::ZERO, last);
        let [x, y, z] = part.to_array().map(|k| k as usize);
        Part {
            index: (x * PARTS + y) * PARTS + z,
            middle: corner + (part.as_dvec3() + 0.5) * width,
        }
    }

    /// The faces of a cell that lines through a part of it may meet within the reach.
    fn met<'a>(&self, cell: CellFaces<'a>, part: Part) -> &'a [u32] {
        let (radius, tangent) = (self.part_radius(), self.sine / self.cosine);
        self.listed(cell, &cell.cell.met, part, |face| {
            let height = face.height(part.middle).abs();
            // A line passes beside its point's foot by as much as it leans.
            let beside = (tangent * (height + radius)).min(self.sine * self.reach);
            height <= self.reach + radius && face.covers(part.middle, radius + beside)
        })
    }

    /// The faces of a cell that may be nearest to points of a part of it.
    fn nearest<'a>(&self, cell: CellFaces<'a>, part: Part) -> &'a [u32] {
        let distance = (f64::from(self.units(cell, part)).abs() + 0.5) * UNIT * self.reach;
        if distance + self.part_radius() > self.reach {
            return cell.faces;
        }
        let far = distance + 2.0 * self.part_radius();
        self.listed(cell, &cell.cell.nearest, part, |face| {
            let height = face.height(part.middle);
            height.abs() <= far && face.distance(part.middle, height) <= far
        })
    }

    /// The faces of a cell that a condition lists for a part of it; the condition is always the same.
    fn listed<'a>(
        &self,
        cell: CellFaces<'a>,
        lists: &'a PartLists,
        part: Part,
        condition: impl Fn(&GridFace) -> bool,
    ) -> &'a [u32] {
        if self.listed.load(Relaxed) > LISTED {
            return cell.faces;
        }
        let none = || Box::new([const { OnceLock::new() }; ALL_PARTS]);
        lists.get_or_init(none)[part.index].get_or_init(|| {
            let faces = cell.faces.iter();
            let list: Box<[u32]> = faces
                .filter(|index| condition(&self.faces[**index as usize]))
                .copied()
                .collect();
            self.listed.fetch_add(list.len(), Relaxed);
            list
        })
    }

    /// How far a point of a part may be from its middle, metres.
    fn part_radius(&self) -> f64 {
        (0.5 + 1e-6) * 3f64.sqrt() * self.cell / PARTS as f64
    }

    /// The signed distance of a part's middle, units.
    fn units(&self, cell: CellFaces<'_>, Part { index, middle }: Part) -> i8 {
        let unknown = || Box::new(std::array::from_fn(|_| AtomicI8::new(UNKNOWN)));
        let distances = cell.cell.distances.get_or_init(unknown);
        match distances[index].load(Relaxed) {
            UNKNOWN => {
                let distance = self.signed_distance(middle, cell.faces);
                let found = (distance / (UNIT * self.reach)).round();
                let found = found.clamp(-127.0, 127.0) as i8;
                distances[index].store(found, Relaxed);
                found
            }
            known => known,
        }
    }

    /// The least and the largest signed distance that a point of a part may have, metres.
    fn distances(&self, cell: CellFaces<'_>, part: Part, p: DVec3) -> [f64; 2] {
        let (unit, units) = (UNIT * self.reach, self.units(cell, part));
        let room = p.distance(part.middle) + 0.5 * unit;
        let distance = f64::from(units) * unit;
        // Of the largest ones, only that they are at least so large is known.
        match units {
            127 => [distance - room, f64::INFINITY],
            -127 => [f64::NEG_INFINITY, distance + room],
            _ => [distance - room, distance + room],
        }
    }

    /// Signed distance of a point, metres, or as much as can be kept; `faces` are those within reach
    /// that may be nearest.
    fn signed_distance(&self, p: DVec3, faces: &[u32]) -> f64 {
        if let Some(distance) = self.signed_distance_near(p, faces) {
            return distance;
        }
        let nearest = self.bvh.nearest(p);
        match self.is_inside_from(p, nearest.point) {
            true => -nearest.distance,
            false => nearest.distance,
        }
    }

    /// The nearest opposite face that the line through `p` along `direction` (unit length) meets, at
    /// most `behind` it or `ahead` of it (metres, at most the grid's reach). What it learns of
    /// distances and faces stays in the grid.
    pub fn opposite_face(
        &self,
        p: DVec3,
        direction: DVec3,
        [behind, ahead]: [f64; 2],
    ) -> Option<OppositeFace> {
        let mut best: Option<OppositeFace> = None;
        let mut least = behind.max(ahead);
        let key = self.key(p);
        let cell = self.cell(key)?;
        let part = self.part(key, p);
        let [low, high] = self.distances(cell, part, p);
        if low > least || high < -least {
            return None;
        }
        for &index in self.met(cell, part) {
            let face = &self.faces[index as usize];
            let along = face.normal.dot(direction);
            if along > -self.cosine {
                continue;
            }
            let gap = -face.height(p) / along;
            let within = gap.abs() <= least && (-behind..=ahead).contains(&gap);
            if within && face.covers(p + gap * direction, BESIDE * self.reach) {
                least = gap.abs();
                best = Some(OppositeFace {
                    gap,
                    normal: face.normal,
                });
            }
        }
        best
    }

    /// Whether `p` lies inside the solid, farther than `depth` (metres) from its surface; the depth
    /// is at most the grid's reach.
    pub fn is_deeper(&self, p: DVec3, depth: f64) -> bool {
        if !self.bounds.contains(p) {
            return false;
        }
        let key = self.key(p);
        let Some(cells) = self.block_cells(key) else {
            return false;
        };
        let cell = match cells.cell(key) {
            Ok(cell) => cell,
            Err(space) => return *space.inside.get_or_init(|| self.find_inside(space.middle)),
        };
        let part = self.part(key, p);
        let [low, high] = self.distances(cell, part, p);
        if high < -depth || low > -depth {
            return high < -depth;
        }
        self.signed_distance(p, self.nearest(cell, part)) < -depth
    }

    /// Signed distance of `p` from the nearest of these faces, metres, negative inside; none if it is
    /// beyond the reach. Of faces that meet in the nearest point, the one that `p` lies most above or
    /// below gives the sign.
    fn signed_distance_near(&self, p: DVec3, faces: &[u32]) -> Option<f64> {
        let (mut least, mut height, mut steepest) = (self.reach, None, 0.0);
        let same = 1e-9 * self.reach;
        for &index in faces {
            let face = &self.faces[index as usize];
            let above = face.height(p);
            if above.abs() > least + same {
                continue;
            }
            // No nearer than the line through its nearest edge.
            let beside = face.beside(p);
            if beside > 0.0 && above * above + beside * beside > (least + same) * (least + same) {
                continue;
            }
            let distance = face.distance(p, above);
            let steep = above.abs() / distance.max(f64::MIN_POSITIVE);
            if distance < least - same || (distance <= least + same && steep > steepest) {
                (height, steepest) = (Some(above), steep);
                least = least.min(distance);
            }
        }
        height.map(|above| least.copysign(above))
    }

    /// Whether a point lies inside.
    fn find_inside(&self, p: DVec3) -> bool {
        self.is_inside_from(p, self.bvh.nearest(p).point)
    }

    /// The same where the nearest point of the surface is known: as all points between them do.
    fn is_inside_from(&self, p: DVec3, nearest: DVec3) -> bool {
        let q = nearest + (p - nearest).clamp_length_max(0.5 * self.reach);
        let faces = self.cell(self.key(q)).map(|cell| cell.faces);
        (self.signed_distance_near(q, faces.unwrap_or_default())).is_some_and(|d| d < 0.0)
    }
}

impl BlockCells {
    /// A cell with faces within reach, or the space that it belongs to.
    fn cell(&self, key: Key) -> Result<CellFaces<'_>, &EmptySpace> {
        let at = self.index.get(within_block(key)).copied().unwrap_or(EMPTY);
        if at & EMPTY != 0 {
            return Err(&self.spaces[usize::from(at & !EMPTY)]);
        }
        let cell = &self.cells[usize::from(at)];
        let faces = &self.list[cell.first as usize..cell.last as usize];
        Ok(CellFaces { cell, faces })
    }
}

/// The number of a cell in its block.
fn within_block(key: Key) -> usize {
    let [x, y, z] = key.map(|k| k as usize % EDGE);
    (x * EDGE + y) * EDGE + z
}

/// Numbers the spaces of a block's index that share no side, and returns one cell of each.
fn number_spaces(index: &mut [u16]) -> Vec<usize> {
    let mut seeds = Vec::new();
    let mut open = Vec::new();
    for seed in 0..index.len() {
        if index[seed] != u16::MAX {
            continue;
        }
        let space = EMPTY + seeds.len() as u16;
        seeds.push(seed);
        index[seed] = space;
        open.push(seed);
        while let Some(at) = open.pop() {
            for step in [1, EDGE, EDGE * EDGE] {
                let along = at / step % EDGE;
                let next = [
                    (along > 0, at.wrapping_sub(step)),
                    (along + 1 < EDGE, at + step),
                ];
                for (_, next) in next.into_iter().filter(|(there, _)| *there) {
                    if index[next] == u16::MAX {
                        index[next] = space;
                        open.push(next);
                    }
                }
            }
        }
    }
    match index.is_empty() {
        true => vec![0],
        false => seeds,
    }
}

impl GridFace {
    fn new(corners: [DVec3; 3]) -> Self {
        let normal = normal(corners);
        let edge = |k: usize| corners[(k + 1) % 3] - corners[k];
        Self {
            normal,
            offset: corners[0].dot(normal),
            outward: std::array::from_fn(|k| {
                let outward = edge(k).cross(normal).normalize_or_zero();
                (outward, corners[k].dot(outward))
            }),
            corners,
        }
    }

    /// Above the face's plane, metres.
    fn height(&self, p: DVec3) -> f64 {
        p.dot(self.normal) - self.offset
    }

    /// Whether a point of the face's plane lies on the face or at most `beside` it.
    fn covers(&self, p: DVec3, beside: f64) -> bool {
        self.beside(p) <= beside
    }

    /// How far a point's foot lies outside the line through the edge that it lies farthest outside
    /// of, metres; negative inside the face.
    fn beside(&self, p: DVec3) -> f64 {
        let outside = |(outward, offset): &(DVec3, f64)| p.dot(*outward) - offset;
        let [a, b, c] = self.outward.each_ref().map(outside);
        a.max(b).max(c)
    }

    /// Distance of a point at this height.
    fn distance(&self, p: DVec3, height: f64) -> f64 {
        if self.covers(p, 0.0) {
            return height.abs();
        }
        let from_edge = |k: usize| {
            let [a, b] = [self.corners[k], self.corners[(k + 1) % 3]];
            let along = b - a;
            let t = ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
            p.distance(a + t * along)
        };
        (0..3).map(from_edge).fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use rand::{Rng, SeedableRng, rngs::SmallRng};

    use super::*;
    use crate::mesh::repair::report::RepairOptions;
    use crate::mesh::shapes::PegInHole;

    /// Against a search of the whole tree, near and far from the surfaces of a block with a hole.
    #[test]
    fn depth_is_that_of_the_signed_distance() {
        let (block, _) = PegInHole::Combined.pair(0.0).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
        let block = block.transformed(turn, DVec3::new(0.01, 0.02, -0.005));
        let (grid, bvh) = (FaceGrid::new(&block, 0.002, 0.9), Bvh::build(&block));
        let mut random = SmallRng::seed_from_u64(1);
        let (low, size) = (block.bounds().min, block.bounds().size());
        let mut inside = 0;
        for _ in 0..4000 {
            let p = low + size * DVec3::from_array(random.random());
            for depth in [0.0, 0.0005, 0.002] {
                let distance = bvh.signed_distance(p);
                if (distance + depth).abs() > 1e-9 {
                    assert_eq!(
                        grid.is_deeper(p, depth),
                        distance < -depth,
                        "{p} {distance}"
                    );
                }
            }
            inside += usize::from(grid.is_deeper(p, 0.0));
        }
        assert!((200..3800).contains(&inside));
        assert!(!grid.is_deeper(low - 1.0, 0.0));
    }

    /// Every face of a block in 256: few of them are kept, and say the same.
    #[test]
    fn a_finely_cut_surface_is_the_same() {
        let (block, _) = PegInHole::Combined.pair(0.0).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4, -1.1, 0.7));
        let block = block.transformed(turn, DVec3::new(0.01, 0.02, -0.005));
        let mut vertices = Vec::new();
        let mut faces: Vec<[DVec3; 3]> = block.faces().collect();
        for _ in 0..4 {
            let four = |[a, b, c]: [DVec3; 3]| {
                let [d, e, f] = [a.midpoint(b), b.midpoint(c), c.midpoint(a)];
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            };
            faces = faces.into_iter().flat_map(four).collect();
        }
        let triangles = (0..faces.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
        vertices.extend(faces.iter().flatten());
        let options = RepairOptions::default();
        let fine = TriangleMesh::clean("fine", vertices, triangles.collect(), &options);
        let (fine, reach) = (fine.unwrap().0, 0.002);
        let [coarse, grid] = [&block, &fine].map(|mesh| FaceGrid::new(mesh, reach, 0.9));
        assert!(8 * grid.faces.len() < fine.triangles().len());
        let bvh = Bvh::build(&block);
        let mut random = SmallRng::seed_from_u64(3);
        let (low, size) = (block.bounds().min, block.bounds().size());
        let mut met = 0;
        for _ in 0..4000 {
            let p = low + size * DVec3::from_array(random.random());
            let distance = bvh.signed_distance(p);
            for depth in [0.0, 0.0005] {
                if (distance + depth).abs() > 0.01 * reach {
                    assert_eq!(grid.is_deeper(p, depth), distance < -depth, "{distance}");
                }
            }
            // Away from the block's edges, where a line may pass beside a face.
            let nearest = bvh.nearest(p);
            let direction = (nearest.point - p).normalize();
            let [a, b] = [&coarse, &grid].map(|g| g.opposite_face(p, direction, [0.0, reach]));
            if let (Some(a), Some(b)) = (a, b) {
                assert!((a.gap - b.gap).abs() < 0.01 * reach, "{a:?} {b:?}");
                met += 1;
            }
        }
        assert!(met > 100, "{met}");
    }

    /// Against all faces, one by one.
    #[test]
    fn opposite_faces_are_those_that_a_search_of_all_finds() {
        let (block, _) = PegInHole::Circular.pair(0.0).unwrap();
        let grid = FaceGrid::new(&block, 0.003, 0.8);
        let mut random = SmallRng::seed_from_u64(2);
        let bounds = block.bounds();
        let mut met = 0;
        for _ in 0..6000 {
            let p = bounds.min + bounds.size() * DVec3::from_array(random.random());
            let direction =
                DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)));
            let direction = direction.normalize();
            let slow = block.faces().filter_map(|corners| {
                let face = GridFace::new(corners);
                let along = face.normal.dot(direction);
                let gap = -face.height(p) / along;
                let meets = along <= -0.8
                    && (-0.001..=0.002).contains(&gap)
                    && face.covers(p + gap * direction, 0.0);
                meets.then_some(gap)
            });
            let slow = slow.min_by(|a, b| a.abs().total_cmp(&b.abs()));
            let found = grid.opposite_face(p, direction, [0.001, 0.002]);
            assert_eq!(found.map(|f| f.gap), slow);
            met += usize::from(found.is_some());
        }
        assert!(met > 30);
    }
}
