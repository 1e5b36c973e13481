//! Lookup by place: grids, surfels in hashed cells, lower bounds on distance, and a tree of balls
//! that hold samples in clusters of sixteen.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::curved::Surfel;
use super::kernel::{LANES, Lanes};
use crate::contact::samples::SurfaceSample;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::bvh::tree::Bvh;

/// A uniform grid of cells, the last direction fastest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Grid {
    /// Where the grid begins, metres.
    pub(super) low: DVec3,
    /// Edge of a cell, metres.
    pub(super) edge: f64,
    pub(super) shape: [usize; 3],
}

impl Grid {
    /// First and last cell along each direction between two places, clamped to the grid.
    pub(super) fn range(&self, low: DVec3, high: DVec3) -> [[usize; 2]; 3] {
        let place = |p: DVec3| ((p - self.low) / self.edge).floor();
        let (from, to) = (place(low), place(high));
        std::array::from_fn(|a| {
            let last = self.shape[a] as f64 - 1.0;
            [from[a], to[a]].map(|i| i.clamp(0.0, last) as usize)
        })
    }

    #[inline(always)]
    pub(super) fn flat(&self, [x, y, z]: [usize; 3]) -> usize {
        (x * self.shape[1] + y) * self.shape[2] + z
    }

    pub(super) fn count(&self) -> usize {
        self.shape.iter().product()
    }

    /// The middle of a cell.
    pub(super) fn middle(&self, flat: usize) -> DVec3 {
        let index = self.unravel(flat).map(|n| n as f64);
        self.low + self.edge * (DVec3::from_array(index) + 0.5)
    }

    fn unravel(&self, flat: usize) -> [usize; 3] {
        let [_, ny, nz] = self.shape;
        [flat / nz / ny, flat / nz % ny, flat % nz]
    }
}

/// Cells along each edge of a block, as a power of two.
const BLOCK: u32 = 3;

/// Which of many boxes a cell of a grid lies in, listed by blocks of cells.
#[derive(Debug)]
pub(super) struct BlockLists {
    /// First and last cell of each box along each direction.
    boxes: Vec<[[u32; 2]; 3]>,
    blocks: [usize; 3],
    /// Numbers of boxes, block after block, and where each block begins.
    ids: Vec<u32>,
    starts: Vec<u32>,
}

impl BlockLists {
    /// Of boxes near the grid.
    pub(super) fn new(grid: &Grid, boxes: impl Iterator<Item = Aabb>) -> Self {
        let range = |b: Aabb| grid.range(b.min, b.max).map(|r| r.map(|n| n as u32));
        let lists = Self {
            boxes: boxes.map(range).collect(),
            blocks: grid.shape.map(|n| ((n - 1) >> BLOCK) + 1),
            ids: Vec::new(),
            starts: Vec::new(),
        };
        // Counts, then places.
        let mut starts = vec![0; lists.blocks.iter().product::<usize>() + 1];
        lists.visit(|block, _| starts[block + 1] += 1);
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        let mut next = starts.clone();
        let mut ids = vec![0; starts.last().map_or(0, |n| *n as usize)];
        lists.visit(|block, id| {
            ids[next[block] as usize] = id;
            next[block] += 1;
        });
        Self {
            ids,
            starts,
            ..lists
        }
    }

    /// Calls `found` with every block and every box that overlaps it, box after box.
    fn visit(&self, mut found: impl FnMut(usize, u32)) {
        for (id, box_) in self.boxes.iter().enumerate() {
            let [xs, ys, zs] = box_.map(|[first, last]| first >> BLOCK..=last >> BLOCK);
            for x in xs {
                for y in ys.clone() {
                    for z in zs.clone() {
                        found(self.block([x, y, z]), id as u32);
                    }
                }
            }
        }
    }

    fn block(&self, place: [u32; 3]) -> usize {
        let [x, y, z] = place.map(|n| n as usize);
        (x * self.blocks[1] + y) * self.blocks[2] + z
    }

    /// The boxes that a cell lies in, in their order.
    pub(super) fn of(&self, grid: &Grid, cell: usize) -> impl Iterator<Item = usize> {
        let cell = grid.unravel(cell).map(|n| n as u32);
        let block = self.block(cell.map(|n| n >> BLOCK));
        let ids = &self.ids[self.starts[block] as usize..self.starts[block + 1] as usize];
        let ids = ids.iter().map(|id| *id as usize);
        ids.filter(move |id| {
            let within = |([first, last], n): (&[u32; 2], u32)| (*first..=*last).contains(&n);
            self.boxes[*id].iter().zip(cell).all(within)
        })
    }
}

/// Surfels by the cells of a grid.
#[derive(Debug)]
pub(super) struct SurfelGrid {
    grid: Grid,
    /// Regions and numbers of surfels and their places, cell after cell, and where each cell
    /// begins.
    order: Vec<(SurfelId, DVec3)>,
    starts: Vec<u32>,
}

/// The region of a surfel, and its number.
pub(super) type SurfelId = (u32, u32);

impl SurfelGrid {
    pub(super) fn new(grid: Grid, surfels: &[(u32, Surfel)]) -> Self {
        let places = surfels.iter().map(|(_, s)| grid.range(s.place, s.place));
        let cells: Vec<usize> = places.map(|p| grid.flat(p.map(|[i, _]| i))).collect();
        let mut order: Vec<usize> = (0..surfels.len()).collect();
        order.sort_by_key(|id| cells[*id]);
        let of = |id: usize| ((surfels[id].0, id as u32), surfels[id].1.place);
        let order = order.into_iter().map(of).collect();
        let mut starts = vec![0; grid.count() + 1];
        for cell in cells {
            starts[cell + 1] += 1;
        }
        for i in 1..starts.len() {
            starts[i] += starts[i - 1];
        }
        Self {
            grid,
            order,
            starts,
        }
    }

    /// Surfels within `distance` of `p`, region after region.
    pub(super) fn within(&self, p: DVec3, distance: f64) -> Vec<SurfelId> {
        let [xs, ys, zs] = self.grid.range(p - distance, p + distance);
        let mut found = Vec::new();
        for x in xs[0]..=xs[1] {
            for y in ys[0]..=ys[1] {
                let [first, last] = zs.map(|z| self.grid.flat([x, y, z]));
                let row = self.starts[first] as usize..self.starts[last + 1] as usize;
                let near = |place: DVec3| place.distance_squared(p) <= distance * distance;
                let near = self.order[row].iter().filter(|s| near(s.1));
                found.extend(near.map(|s| s.0));
            }
        }
        found.sort_by_key(|(region, _)| *region);
        found
    }
}

/// Cells along the longest side.
const CELLS: f64 = 32.0;

/// Lower bounds on the distance of a surface, on a coarse lattice.
#[derive(Debug, Clone)]
pub(super) struct DistanceBound {
    grid: Grid,
    size: DVec3,
    /// Cells per metre.
    per_metre: f64,
    /// Margin of the lattice around the surface.
    margin: f64,
    /// A lower bound on the distance of the surface from all places of each cell, metres.
    least: Vec<f32>,
}

impl DistanceBound {
    pub(super) fn new(mesh: &TriangleMesh, bvh: &Bvh, reach: f64) -> Self {
        let bounds: Aabb = mesh.bounds().grown(reach);
        let size = bounds.size();
        let cell = size.max_element() / CELLS;
        let shape = (size / cell).ceil().max(DVec3::ONE);
        let grid = Grid {
            low: bounds.min,
            edge: cell,
            shape: shape.to_array().map(|n| n as usize),
        };
        let least = (0..grid.count()).into_par_iter().map(|flat| {
            let distance = bvh.nearest(grid.middle(flat)).distance;
            // Half a diagonal; single precision rounds.
            ((distance - 0.87 * cell) * (1.0 - 1e-6)) as f32
        });
        Self {
            grid,
            size,
            per_metre: 1.0 / cell,
            margin: reach,
            least: least.collect(),
        }
    }

    /// A lower bound on the distance of the surface from a place, metres; infinite if the place is
    /// not a number.
    #[inline(always)]
    pub(super) fn lower_bound(&self, p: DVec3) -> f64 {
        let place = p - self.grid.low;
        let off = place - place.clamp(DVec3::ZERO, self.size);
        if off != DVec3::ZERO {
            let distance = off.length();
            return if distance.is_nan() {
                f64::INFINITY
            } else {
                self.margin + distance
            };
        }
        let index = (place * self.per_metre).to_array().map(|x| x as usize);
        let index = [0, 1, 2].map(|k| index[k].min(self.grid.shape[k] - 1));
        f64::from(self.least[self.grid.flat(index)])
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.least.as_slice())
    }
}

/// Largest radius of clusters, in units of the reach: patches are listed for the largest cluster.
const MOST_RADIUS: f64 = 1.6;

/// Weight of normals against places when samples are divided, in units of the reach.
const NORMALS: f64 = 0.3;

/// Sixteen samples; lengths are in units of the reach.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct Cluster {
    /// From the ball's centre.
    pub(super) position: [Lanes; 3],
    pub(super) normal: [Lanes; 3],
    pub(super) area: Lanes,
    /// Half the side of a square as large.
    pub(super) half: Lanes,
}

/// A ball that holds samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ball {
    /// Metres, in the part's frame.
    pub(super) centre: DVec3,
    /// Metres, and in units of the reach, enlarged by more than rounding takes from it.
    pub(super) radius: f64,
    pub(super) in_reaches: f32,
    /// The ball to visit next if this one is out of reach.
    pub(super) next: u32,
    /// Its cluster, or [`Ball::MANY`].
    pub(super) cluster: u32,
}

impl Ball {
    /// Marks a ball whose clusters are those of the balls up to `next`.
    pub(super) const MANY: u32 = u32::MAX;
}

/// All samples.
#[derive(Debug, Clone)]
pub(super) struct Clusters {
    /// In depth-first order.
    pub(super) balls: Vec<Ball>,
    pub(super) clusters: Vec<Cluster>,
    /// The largest radius of a cluster, metres.
    pub(super) radius: f64,
}

impl Clusters {
    pub(super) fn new(samples: &mut [SurfaceSample], reach: f64) -> Self {
        let mut clusters = Self {
            balls: Vec::new(),
            clusters: Vec::new(),
            radius: 0.0,
        };
        clusters.divide(samples, reach);
        clusters
    }

    /// Adds samples and the balls that hold them.
    fn divide(&mut self, samples: &mut [SurfaceSample], reach: f64) {
        // Bounding ball.
        let low = samples.iter().map(|s| s.position).reduce(DVec3::min);
        let high = samples.iter().map(|s| s.position).reduce(DVec3::max);
        let (Some(low), Some(high)) = (low, high) else {
            return;
        };
        let centre = 0.5 * (low + high);
        let distances = samples.iter().map(|s| s.position.distance(centre));
        let radius = distances.fold(0.0, f64::max);
        let place = self.balls.len();
        // A cluster if it is small, otherwise two halves.
        let few = samples.len() <= LANES;
        let single = few && (radius <= MOST_RADIUS * reach || samples.len() == 1);
        self.balls.push(Ball {
            centre,
            radius,
            in_reaches: (radius / reach) as f32 * (1.0 + 1e-5),
            next: 0,
            cluster: if single {
                self.clusters.len() as u32
            } else {
                Ball::MANY
            },
        });
        if single {
            self.clusters.push(Cluster::new(samples, centre, reach));
            self.radius = self.radius.max(radius);
        } else {
            let middle = split_in_half(samples, reach);
            let (a, b) = samples.split_at_mut(middle);
            self.divide(a, reach);
            self.divide(b, reach);
        }
        // Traversals skip the ball by going there.
        self.balls[place].next = self.balls.len() as u32;
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.balls.as_slice()) + size_of_val(self.clusters.as_slice())
    }
}

/// Partitions samples across the longest side of their box, in places and normals; returns where
/// the second half begins.
fn split_in_half(samples: &mut [SurfaceSample], reach: f64) -> usize {
    let key = |s: &SurfaceSample, k: usize| match k {
        0..3 => s.position[k],
        _ => s.area.normalize_or_zero()[k - 3] * NORMALS * reach,
    };
    let extent = |k: usize| {
        let range = samples.iter().map(|s| key(s, k));
        let range = range.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        range.1 - range.0
    };
    let longest = (0..6).map(|k| (extent(k), k));
    let (_, k) = longest.fold((-1.0, 0), |a, b| if b.0 > a.0 { b } else { a });
    // Full clusters where there are several.
    let half = samples.len() / 2;
    let middle = match samples.len() > LANES {
        true => half.next_multiple_of(LANES).min(samples.len() - 1),
        false => half,
    };
    samples.select_nth_unstable_by(middle, |a, b| key(a, k).total_cmp(&key(b, k)));
    middle
}

impl Cluster {
    /// Lanes without a sample have no area.
    fn new(samples: &[SurfaceSample], centre: DVec3, reach: f64) -> Self {
        let zero = [0.0; LANES];
        let mut cluster = Self {
            position: [zero; 3],
            normal: [[0.0; LANES], [0.0; LANES], [1.0; LANES]],
            area: zero,
            half: zero,
        };
        for (lane, s) in samples.iter().enumerate() {
            let at: Vec3 = ((s.position - centre) / reach).as_vec3();
            let area = s.area.length() / (reach * reach);
            let normal = s.area.normalize_or_zero();
            for k in 0..3 {
                cluster.position[k][lane] = at[k];
                cluster.normal[k][lane] = normal[k] as f32;
            }
            cluster.area[lane] = area as f32;
            cluster.half[lane] = (0.5 * area.sqrt()) as f32;
        }
        cluster
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_that_is_near_is_found_and_nothing_else() {
        let place = |i: u32| {
            let at = |prime: u32| f64::from(i * prime % 997) / 997.0;
            DVec3::new(at(31), 2.0 * at(57), 0.7 * at(101))
        };
        let surfel = |i: u32| Surfel {
            place: place(i),
            normal: DVec3::Z,
            area: f64::from(i),
        };
        let surfels: Vec<(u32, Surfel)> = (0..900).map(|i| (i % 3, surfel(i))).collect();
        for edge in [0.07, 0.4, 5.0] {
            let grid = Grid {
                low: DVec3::ZERO,
                edge,
                shape: [1.0, 2.0, 0.7].map(|l: f64| (l / edge).ceil() as usize),
            };
            let buckets = SurfelGrid::new(grid, &surfels);
            for p in [place(3), place(500), DVec3::new(-0.2, 1.0, 0.9)] {
                for distance in [0.01, 0.3, 1.1] {
                    let near = |id: &u32| surfels[*id as usize].1.place.distance(p) <= distance;
                    let near = (0..surfels.len() as u32).filter(near);
                    let mut near: Vec<SurfelId> = near.map(|id| (id % 3, id)).collect();
                    near.sort_unstable();
                    let mut found = buckets.within(p, distance);
                    assert!(found.is_sorted_by_key(|(region, _)| *region));
                    found.sort_unstable();
                    assert_eq!(found, near, "{edge} {p} {distance}");
                }
            }
        }
    }
}
