//! The surface patches of a part that are visible from a place, listed by cells of a grid.

use std::borrow::Cow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::curved::{NEAR, OsculatingTorus, Surfel, circle_coordinates};
use super::lookup::{BlockLists, Grid, SurfelGrid, SurfelId};
use super::polylines::{Arc, allowed_offset, join_chains, simplify_near};
use super::regions::{FlatRegion, Regions, Ring};
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::prefetch::fetch_all;

/// Reference point of a flat region's winding numbers, in units of the reach from the foot of the
/// cell's middle. Odd numbers, so that edges do not pass through it by accident.
const REFERENCE: DVec2 = DVec2::new(0.013_71, 0.007_13);

/// Range of boundary edges on a developed surface over the range in space: on the inside of the
/// strongest bend an arc is longer than its chord.
const FARTHER: f64 = 1.4;

/// Angle around a torus beyond which nothing is visible.
const BEHIND: f64 = 2.5;

/// Extension of arcs beyond the visible range, so that no sample has an end of one in reach.
const BEYOND: f64 = 4.0;

/// Offset of the reference point from the middle of an arc.
const OFF_ARC: f32 = 0.373_1;

/// A region visible from a cell, flat or developed from a torus. Lengths are in units of the reach,
/// places relative to the middle of the cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Patch {
    /// A point of its plane or torus.
    pub(super) origin: Vec3,
    /// Two directions in it and its normal, outwards; right-handed.
    pub(super) axes: [Vec3; 3],
    /// How much it is bent along either, positive if it is convex.
    pub(super) curvature: Vec2,
    /// Reference point of winding numbers, on the patch from its origin.
    pub(super) reference: Vec2,
    /// Winding number there: 0 or 1, rarely more.
    pub(super) inside: f32,
    /// Its boundary edges in reach.
    pub(super) first: u32,
    pub(super) count: u32,
}

/// A straight or circular piece of a patch's boundary, the patch to its left, along the patch's two
/// directions.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoundaryEdge {
    pub(super) from: Vec2,
    pub(super) to: Vec2,
    pub(super) middle: Vec2,
    /// Unit vector in the middle.
    pub(super) along: Vec2,
    pub(super) length: f32,
    /// Its curvature, positive where the patch is convex. No sample has an end of an arc in reach.
    pub(super) bend: f32,
    /// Whether the patch's reference is beyond its line.
    pub(super) reference_outside: bool,
}

/// Patches with their boundary edges.
#[derive(Debug, Clone, Default)]
pub(super) struct PatchList {
    pub(super) patches: Vec<Patch>,
    pub(super) boundary: Vec<BoundaryEdge>,
}

/// Numbers of what may be visible from the cells of each block.
#[derive(Debug)]
struct NearbyRegions {
    flat: BlockLists,
    /// Of [`Regions::faces`].
    faces: BlockLists,
    boundary: BlockLists,
}

/// A surface and all that patches are built from.
#[derive(Debug)]
struct Surface {
    vertices: Vec<DVec3>,
    regions: Regions,
    grid: Grid,
    near: NearbyRegions,
    /// Surfels of the regions, and the tori fitted to them so far.
    surfels: SurfelGrid,
    tori: Vec<OnceLock<Option<OsculatingTorus>>>,
    /// The kernel's reach, metres.
    unit: f64,
    /// Range of visibility, metres.
    range: f64,
}

impl Surface {
    fn new(vertices: Vec<DVec3>, regions: Regions, grid: Grid, unit: f64, range: f64) -> Self {
        let flat = regions.flat.iter().map(|r| r.bounds.grown(range));
        let faces = regions.faces.iter().map(|(_, r)| r.bounds.grown(range));
        let edges = regions.boundary.iter().map(|(_, ends)| {
            let ends = ends.map(|v| vertices[v as usize]);
            Aabb::around(ends).grown(FARTHER * range)
        });
        Self {
            near: NearbyRegions {
                flat: BlockLists::new(&grid, flat),
                faces: BlockLists::new(&grid, faces),
                boundary: BlockLists::new(&grid, edges),
            },
            surfels: SurfelGrid::new(grid, &regions.surfels),
            tori: vec![OnceLock::new(); regions.surfels.len()],
            vertices,
            regions,
            grid,
            unit,
            range,
        }
    }

    /// The patches visible from a cell.
    fn visible_from(&self, cell: usize) -> PatchList {
        let middle = self.grid.middle(cell);
        let mut list = PatchList::default();
        // Flat regions.
        for id in self.near.flat.of(&self.grid, cell) {
            self.add_flat(&mut list, &self.regions.flat[id], middle);
        }
        // Curved regions, each from its surfel nearest to the cell.
        let faces: Vec<usize> = self.near.faces.of(&self.grid, cell).collect();
        let boundary: Vec<usize> = self.near.boundary.of(&self.grid, cell).collect();
        let surfels = self.surfels.within(middle, self.range);
        for of_one in surfels.chunk_by(|a, b| a.0 == b.0) {
            let off = |s: &SurfelId| self.surfel(s.1).place.distance_squared(middle);
            let nearest = of_one.iter().map(|s| (off(s), s));
            let Some((_, (region, id))) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            let nearest = self.surfel(*id).scaled(middle, self.unit);
            let mut scaled = of_one
                .iter()
                .map(|s| self.surfel(s.1).scaled(middle, self.unit));
            // As a cylinder or a torus, if one fits within the visible range.
            let torus = match self.regions.cylinders.get(region) {
                Some(cylinder) => cylinder.tangent_torus_from(middle / self.unit, nearest.place),
                None => self
                    .torus(*region, *id)
                    .map(|torus| torus.translated(nearest.place))
                    .filter(|torus| torus.approximates(&mut scaled)),
            };
            // Otherwise as decimated flat faces.
            match torus {
                Some(torus) => {
                    let edges = of_region(&boundary, &self.regions.boundary, *region);
                    self.add_curved(&mut list, &torus, nearest, middle, edges);
                }
                None => {
                    for face in of_region(&faces, &self.regions.faces, *region) {
                        self.add_flat(&mut list, face, middle);
                    }
                }
            }
        }
        list
    }

    fn surfel(&self, id: u32) -> &Surfel {
        &self.regions.surfels[id as usize].1
    }

    /// The torus about a surfel, relative to its place and in units of the reach: the same from
    /// wherever it is the nearest.
    fn torus(&self, region: u32, id: u32) -> Option<OsculatingTorus> {
        let fit = || {
            let about = self.surfel(id).place;
            let near = self.surfels.within(about, NEAR * self.unit);
            let others = near.into_iter().filter(|o| o.0 == region && o.1 != id);
            let all = std::iter::once((region, id)).chain(others);
            let all = all.map(|o| self.surfel(o.1).scaled(about, self.unit));
            OsculatingTorus::fit(&all.collect::<Vec<_>>())
        };
        *self.tori[id as usize].get_or_init(fit)
    }

    /// Adds a flat region.
    fn add_flat(&self, list: &mut PatchList, region: &FlatRegion, middle: DVec3) {
        // Foot and height of the cell above the plane.
        let [u, v, normal] = region.axes;
        let unit = self.unit;
        let from = (middle - region.origin) / unit;
        let (foot, height) = (DVec2::new(from.dot(u), from.dot(v)), from.dot(normal));
        let range = self.range / unit;
        if height.abs() > range {
            return;
        }
        // Boundary edges within the visible disc.
        let most = (range * range - height * height).max(0.0).sqrt();
        let first = list.boundary.len();
        let mut sides = Vec::new();
        let here = unit * foot;
        let (near, far): (Vec<&Ring>, Vec<&Ring>) =
            (region.rings.iter()).partition(|r| r.may_be_near(here, unit * most));
        for ring in near {
            let corners = ring.corners.iter();
            let ring: Vec<DVec2> = corners.map(|p| *p / unit - foot).collect();
            list.add_ring(&ring, most, &mut sides);
        }
        // Not between an arc and its chords.
        let arc = list.boundary[first..].iter().find(|b| b.bend != 0.0);
        let reference = arc.map_or(REFERENCE, |b| {
            // The patch is to the left.
            (b.middle + OFF_ARC * b.along.perp()).as_dvec2()
        });
        // Winding number at the reference point.
        let mut turns: i32 = sides.iter().map(|s| ray_crossing(*s, reference)).sum();
        let there = unit * reference + here;
        for ring in far.iter().filter(|r| r.may_be_near(there, 0.0)) {
            let next = ring.corners.iter().cycle().skip(1);
            let sides = ring.corners.iter().zip(next);
            turns += sides
                .map(|(a, b)| ray_crossing([*a, *b], there))
                .sum::<i32>();
        }
        let inside = turns as f32;
        let count = list.boundary.len() - first;
        if inside != 0.0 || count > 0 {
            list.add_patch(Patch {
                origin: (-height * normal).as_vec3(),
                axes: region.axes.map(DVec3::as_vec3),
                curvature: Vec2::ZERO,
                reference: reference.as_vec2(),
                inside,
                first: first as u32,
                count: count as u32,
            });
        }
    }

    /// Adds a curved region that is a torus within the visible range; `on` is a surfel of it, `edges`
    /// its boundary near by.
    fn add_curved<'a>(
        &self,
        list: &mut PatchList,
        torus: &OsculatingTorus,
        on: Surfel,
        middle: DVec3,
        edges: impl Iterator<Item = &'a [u32; 2]>,
    ) {
        // Boundary vertices, developed.
        let mut edges: Vec<[u32; 2]> = edges.copied().collect();
        let mut places = FxHashMap::default();
        for v in edges.iter().flatten() {
            let p = self.vertices[*v as usize];
            let develop = || torus.developed((p - middle) / self.unit).0;
            places.entry(*v).or_insert_with(develop);
        }
        let place = |v: &u32| places[v];
        // Edges near the ends of a developed circle are out of sight.
        let before = |v: &u32| (place(v) * torus.curvature).abs().max_element() < BEHIND;
        edges.retain(|e| e.iter().all(before));
        // Boundary chains within the visible range.
        let (about, _) = torus.developed(DVec3::ZERO);
        let most = FARTHER * self.range / self.unit;
        let first = list.boundary.len();
        for chain in join_chains(&edges) {
            let chain: Vec<DVec2> = chain.iter().map(place).collect();
            list.add_chain(&chain, about, most);
        }
        list.add_patch(Patch {
            origin: torus.origin.as_vec3(),
            axes: torus.axes.map(DVec3::as_vec3),
            curvature: torus.curvature.as_vec2(),
            reference: torus.developed(on.place).0.as_vec2(),
            inside: 1.0,
            first: first as u32,
            count: (list.boundary.len() - first) as u32,
        });
    }
}

/// Those of some numbered things that belong to a region, of which all are in order.
fn of_region<'a, T>(
    ids: &'a [usize],
    all: &'a [(u32, T)],
    region: u32,
) -> impl Iterator<Item = &'a T> {
    let first = ids.partition_point(|id| all[*id].0 < region);
    let things = ids[first..].iter().map(|id| &all[*id]);
    things.take_while(move |t| t.0 == region).map(|t| &t.1)
}

impl Patch {
    /// A place relative to the origin, developed, and the height above it.
    #[inline(always)]
    pub(super) fn developed(&self, p: Vec3) -> (Vec2, f32) {
        let [x, y, z] = self.axes.map(|a| p.dot(a));
        let [lifted, b] = circle_coordinates(y, z, self.curvature.y);
        let [height, a] = circle_coordinates(x, lifted, self.curvature.x);
        (Vec2::new(a, b), height)
    }
}

impl PatchList {
    /// Memory that is held, bytes.
    fn bytes(&self) -> usize {
        let lists = size_of_val(self.patches.as_slice()) + size_of_val(self.boundary.as_slice());
        size_of::<Self>() + lists
    }

    /// Adds a patch whose boundary edges are the last.
    fn add_patch(&mut self, patch: Patch) {
        for edge in &mut self.boundary[patch.first as usize..] {
            edge.reference_outside = edge.place(patch.reference)[0] < 0.0;
        }
        self.patches.push(patch);
    }

    /// Adds the part of a closed chain within `most` of the origin, and to `sides` the whole
    /// simplified chain.
    fn add_ring(&mut self, ring: &[DVec2], most: f64, sides: &mut Vec<[DVec2; 2]>) {
        let n = ring.len();
        let side = |i: usize| [ring[i % n], ring[(i + 1) % n]];
        let near = |i: usize| is_near(side(i), most);
        let start = (0..n).find(|i| !near(*i)).map_or(0, |i| i + 1);
        let mut chain = Vec::new();
        for i in start..start + n {
            let [a, b] = side(i);
            if near(i) {
                if chain.is_empty() {
                    chain.push(a);
                }
                chain.push(b);
                continue;
            }
            sides.extend(self.add_chain(&chain, DVec2::ZERO, most));
            sides.push([a, b]);
            chain.clear();
        }
        sides.extend(self.add_chain(&chain, DVec2::ZERO, most));
    }

    /// Adds the part of a chain within `most` of `about`, simplified; returns the whole chain in
    /// straight pieces.
    fn add_chain(&mut self, chain: &[DVec2], about: DVec2, most: f64) -> Vec<[DVec2; 2]> {
        let sides = |chain: &[DVec2]| chain.windows(2).map(|w| [w[0], w[1]]).collect();
        if let Some(arc) = BoundaryEdge::bent(chain, about, most) {
            self.boundary.push(arc);
            return sides(chain);
        }
        let kept: Vec<[DVec2; 2]> = sides(&simplify_near(chain, about));
        let pieces = kept.iter();
        let pieces = pieces.filter_map(|s| BoundaryEdge::within(*s, about, most));
        self.boundary.extend(pieces);
        kept
    }
}

impl BoundaryEdge {
    /// The part of the segment from `a` to `b` within `most` of `about`.
    fn within([a, b]: [DVec2; 2], about: DVec2, most: f64) -> Option<Self> {
        let along = (b - a).try_normalize()?;
        let length = a.distance(b);
        let (start, across) = ((a - about).dot(along), (a - about).perp_dot(along));
        let visible = (most * most - across * across).max(0.0).sqrt();
        let from = (-visible - start).max(0.0);
        let to = (visible - start).min(length);
        if across.abs() > most || from >= to {
            return None;
        }
        // Corners that stay are those of their neighbours to the last bit.
        let at = |l: f64| if l >= length { b } else { a + along * l };
        Some(Self {
            from: at(from).as_vec2(),
            to: at(to).as_vec2(),
            middle: (a + along * (0.5 * (from + to))).as_vec2(),
            along: along.as_vec2(),
            length: (to - from) as f32,
            bend: 0.0,
            reference_outside: false,
        })
    }

    /// A chain as an arc of a circle, if it is one throughout the range `most` around `about`.
    fn bent(chain: &[DVec2], about: DVec2, most: f64) -> Option<Self> {
        let [a, .., b] = *chain else {
            return None;
        };
        let arc = Arc::through(a, chain[chain.len() / 2], b)?;
        let through = a.distance(about) > most && b.distance(about) > most;
        let near = |p: DVec2| arc.off(p).abs() <= allowed_offset(p, about);
        let fits = || {
            chain
                .windows(2)
                .all(|w| near(w[0]) && near(w[0].midpoint(w[1])) && w[0] != w[1])
        };
        (through && fits()).then(|| Self {
            from: a.as_vec2(),
            to: b.as_vec2(),
            middle: arc.middle.as_vec2(),
            along: arc.along.as_vec2(),
            length: (arc.length + BEYOND) as f32,
            bend: arc.bend as f32,
            reference_outside: false,
        })
    }
}

/// Whether a segment comes within `most` of the origin.
fn is_near([a, b]: [DVec2; 2], most: f64) -> bool {
    let way = b - a;
    let (before, square) = (-a.dot(way), way.length_squared());
    let nearest = if before <= 0.0 {
        a.length_squared()
    } else if before >= square {
        b.length_squared()
    } else {
        return a.perp_dot(b).powi(2) <= most * most * square;
    };
    nearest <= most * most
}

/// Signed crossing of a segment with the ray from a place along the first axis: one with the place
/// to its left, minus one to its right. The sum over a closed chain is its winding number.
fn ray_crossing([a, b]: [DVec2; 2], from: DVec2) -> i32 {
    let (a, b) = (a - from, b - from);
    match (a.y <= 0.0, b.y <= 0.0) {
        (true, false) if a.perp_dot(b) > 0.0 => 1,
        (false, true) if a.perp_dot(b) < 0.0 => -1,
        _ => 0,
    }
}

/// Edge of a cell, in units of the reach, unless the part is so large that there would be too many.
const CELL: f64 = 0.5;

/// Most cells that a surface is divided into.
const MOST_CELLS: f64 = 1e6;

/// Bytes of lists from which on no more are kept, unless asked otherwise.
const MOST_KEPT: usize = 1 << 30;

/// Cells, one after the other, whose lists have a place in memory as soon as one of them does.
const RUN: usize = 16;

/// The list of a cell, once a pose came there; none if no surface is visible.
type CellList = OnceLock<Option<Box<PatchList>>>;

/// Patches by the cells from which they are in reach, listed when a place in a cell is first asked for.
#[derive(Debug)]
pub(super) struct VisiblePatches {
    surface: Surface,
    /// Cells per metre, and their edge in units of the reach.
    per_metre: f64,
    in_reaches: f64,
    runs: Vec<OnceLock<Box<[CellList; RUN]>>>,
    /// Bytes of the lists and runs that are kept, and from which on no more are.
    kept: AtomicUsize,
    pub(super) most_kept: usize,
}

impl VisiblePatches {
    /// Of each cell, the patches within `reach` (metres) of spheres of `radius` (metres) around places
    /// in it.
    pub(super) fn new(mesh: &TriangleMesh, regions: Regions, [reach, radius]: [f64; 2]) -> Self {
        // A grid over all places in reach.
        let all = mesh.bounds().grown(reach + radius);
        let wanted = CELL * reach;
        let count = (all.size() / wanted).element_product();
        let cell = wanted * (count / MOST_CELLS).cbrt().max(1.0);
        let shape = (all.size() / cell).ceil().max(DVec3::ONE);
        let grid = Grid {
            low: all.min,
            edge: cell,
            shape: shape.to_array().map(|n| n as usize),
        };
        // Half a diagonal, and a little for rounding.
        let range = (reach + radius + 0.87 * cell) * (1.0 + 1e-6);
        Self {
            surface: Surface::new(mesh.vertices().to_vec(), regions, grid, reach, range),
            per_metre: 1.0 / cell,
            in_reaches: cell / reach,
            runs: (0..grid.count().div_ceil(RUN))
                .map(|_| OnceLock::new())
                .collect(),
            kept: AtomicUsize::new(0),
            most_kept: MOST_KEPT,
        }
    }

    /// Lists what is visible from every cell of a box (metres), or from all: places in it are then looked
    /// up without delay.
    pub(super) fn prepare(&self, region: Option<&Aabb>) {
        let grid = &self.surface.grid;
        let all = grid.shape.map(|n| [0, n - 1]);
        let [xs, ys, zs] = region.map_or(all, |region| grid.range(region.min, region.max));
        (xs[0]..=xs[1]).into_par_iter().for_each(|x| {
            for y in ys[0]..=ys[1] {
                for z in zs[0]..=zs[1] {
                    self.list(grid.flat([x, y, z]));
                }
            }
        });
    }

    /// What is visible from a cell; none if no surface is. Lists that are too many to be kept are
    /// made anew each time.
    #[inline(always)]
    fn list(&self, flat: usize) -> Option<Cow<'_, PatchList>> {
        let run = self.runs[flat / RUN].get();
        match run.and_then(|run| run[flat % RUN].get()) {
            Some(list) => list.as_deref().map(Cow::Borrowed),
            None => self.make_list(flat),
        }
    }

    #[cold]
    fn make_list(&self, flat: usize) -> Option<Cow<'_, PatchList>> {
        let make = || {
            let list = self.surface.visible_from(flat);
            (!list.patches.is_empty()).then_some(list)
        };
        if self.kept.load(Relaxed) >= self.most_kept {
            return make().map(Cow::Owned);
        }
        let run = self.runs[flat / RUN].get_or_init(|| {
            self.kept.fetch_add(size_of::<[CellList; RUN]>(), Relaxed);
            Box::new([const { OnceLock::new() }; RUN])
        });
        let list = run[flat % RUN].get_or_init(|| {
            let mut list = Box::new(make()?);
            list.patches.shrink_to_fit();
            list.boundary.shrink_to_fit();
            self.kept.fetch_add(list.bytes(), Relaxed);
            Some(list)
        });
        list.as_deref().map(Cow::Borrowed)
    }

    /// The patches visible from a place, and the place relative to the middle of its cell in units
    /// of the reach; none if no surface is in reach. Prefetches the patches.
    #[inline(always)]
    pub(super) fn look_up(&self, p: DVec3) -> Option<(Cow<'_, PatchList>, Vec3)> {
        let grid = &self.surface.grid;
        let place = (p - grid.low) * self.per_metre;
        let shape = DVec3::from_array(grid.shape.map(|n| n as f64));
        // False for what is not a number.
        if !(place.cmpge(DVec3::ZERO).all() && place.cmplt(shape).all()) {
            return None;
        }
        let list = self.list(grid.flat(place.to_array().map(|v| v as usize)))?;
        fetch_all(&list.patches);
        fetch_all(&list.boundary);
        let within = (place - place.floor() - 0.5) * self.in_reaches;
        Some((list, within.as_vec3()))
    }

    /// Memory that is held, bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.runs.as_slice()) + self.kept.load(Relaxed)
    }
}
