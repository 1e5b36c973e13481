//! Filling the octree, level by level.

use std::collections::HashMap;

use glam::DVec3;
use num_complex::Complex64;
use rayon::prelude::*;
use sdf_grid::TriangleMesh;

use super::fit::{Fit, evaluate};
use super::octree::{Cell, DensityTable, NONE, Node};
use super::one_sided::{OneSided, Side};
use super::sharp::{Near, SharpEdges};
use crate::geometry::facet::{Faces, Facet, octants};
use crate::options::Cells;

/// The middle of the root from the part's, and its edge, in extents: such that faces of parts with
/// round numbers lie on no cell's.
const OFFSET: DVec3 = DVec3::new(0.0137, -0.0093, 0.0117);
const EDGE: f64 = 1.0371;

/// A node whose cell is not yet decided.
struct Open {
    cell: Cell,
    /// Lower corner, in steps of the finest samples.
    at: [u32; 3],
    facets: Vec<Facet>,
    near: Near,
}

/// A sample: its place in steps of the finest samples, 20 bits each, and the side.
type Key = u64;

fn key(at: [u32; 3], side: Side) -> Key {
    let [x, y, z] = at.map(u64::from);
    ((side as u64) << 60) | (x << 40) | (y << 20) | z
}

fn unkey(key: Key) -> ([u32; 3], Side) {
    let part = |shift: u32| (key >> shift & 0xf_ffff) as u32;
    let side = Side::BOTH[(key >> 60 & 1) as usize];
    ([part(40), part(20), part(0)], side)
}

struct Builder<'a> {
    table: DensityTable,
    part: &'a OneSided,
    cells: Cells,
    halo: f64,
    /// Depth of the smallest cells.
    last: u32,
    samples: HashMap<Key, Complex64>,
}

impl DensityTable {
    /// Fits the densities of a part, whose exterior ends at `halo`.
    pub(crate) fn new(mesh: &TriangleMesh, part: &OneSided, cells: Cells, halo: f64) -> Self {
        let faces = Faces::new(mesh);
        let bounds = mesh.bounds();
        let extent = bounds.size().max_element() + 2.0 * halo;
        let half = 0.5 * EDGE * extent;
        let table = Self {
            centre: bounds.center() + OFFSET * extent,
            half,
            nodes: vec![Node::open()],
            fits: Vec::new(),
            edges: SharpEdges::new(mesh, &faces, cells.tube),
        };
        let mut builder = Builder {
            cells,
            halo,
            last: cells.depth(2.0 * half),
            samples: HashMap::new(),
            table,
            part,
        };
        let mut open = vec![Open {
            cell: builder.table.root(),
            at: [0; 3],
            near: match part.varies() {
                true => builder.table.edges.all(),
                false => Near::default(),
            },
            facets: faces.facets,
        }];
        for depth in 0..=builder.last {
            open = builder.level(open, depth);
        }
        builder.table.summarize(0);
        builder.table
    }

    /// Sides and depths of inner nodes.
    fn summarize(&mut self, index: usize) -> (u8, u8) {
        let first = self.nodes[index].first;
        if first != NONE {
            let (mut sides, mut deepest) = (0, 0);
            for child in first..first + 8 {
                let (s, d) = self.summarize(child as usize);
                sides |= s;
                deepest = deepest.max(d);
            }
            self.nodes[index].sides = sides;
            self.nodes[index].deepest = deepest;
        }
        (self.nodes[index].sides, self.nodes[index].deepest)
    }
}

impl Node {
    fn open() -> Self {
        Self {
            first: NONE,
            deepest: 0,
            sides: 0,
            fits: [NONE; 2],
            facets: Vec::new(),
            near: Near::default(),
        }
    }
}

impl Builder<'_> {
    /// Decides all cells of one depth; what is to be decided next.
    fn level(&mut self, open: Vec<Open>, depth: u32) -> Vec<Open> {
        let sides: Vec<u8> = open.par_iter().map(|o| self.sides(o)).collect();
        let large = |cell: &Cell| 2.0 * cell.half > self.cells.largest;
        let wanted: Vec<bool> = open
            .iter()
            .zip(&sides)
            .map(|(o, s)| *s != 0 && !(large(&o.cell) && depth < self.last))
            .collect();
        self.sample(&open, &sides, &wanted, depth);
        let mut next = Vec::new();
        for ((item, sides), wanted) in open.into_iter().zip(sides).zip(wanted) {
            let coarse = wanted && depth < self.last && self.is_coarse(&item, sides, depth);
            if sides != 0 && (!wanted || coarse) {
                self.divide(item, depth, &mut next);
                continue;
            }
            let fits = Side::BOTH.map(|side| {
                if sides >> side as u8 & 1 == 0 {
                    return NONE;
                }
                let fit = self.fit(item.at, depth, side);
                self.table.fits.push(fit);
                self.table.fits.len() as u32 - 1
            });
            let node = &mut self.table.nodes[item.cell.node as usize];
            node.sides = sides;
            node.deepest = depth as u8;
            node.fits = fits;
            node.facets = item.facets;
            node.near = item.near;
        }
        next
    }

    fn sides(&self, open: &Open) -> u8 {
        if !open.facets.is_empty() {
            return 3;
        }
        let xi = self.part.bvh.signed_distance(open.cell.centre);
        if xi - open.cell.radius() >= self.halo {
            return 0;
        }
        1 << Side::from_distance(xi) as u8
    }

    /// Finest samples along an edge of a cell, a power of two and at least four.
    fn span(&self, depth: u32) -> u32 {
        4 << (self.last - depth)
    }

    /// Places of a cell's nodes, then (`tests`) those at the middles of its eight parts.
    fn places(&self, at: [u32; 3], depth: u32, tests: bool) -> impl Iterator<Item = [u32; 3]> {
        let quarter = self.span(depth) / 4;
        let place = move |n: usize, base: usize, step: u32, from: u32| {
            let [i, j, k] = [n / (base * base), n / base % base, n % base].map(|v| v as u32);
            let along = |c: u32, i: u32| c + from + step * i;
            [along(at[0], i), along(at[1], j), along(at[2], k)]
        };
        let nodes = (0..27).map(move |n| place(n, 3, 2 * quarter, 0));
        let middles = if tests { 0..8 } else { 0..0 };
        nodes.chain(middles.map(move |n| place(n, 2, 2 * quarter, quarter)))
    }

    /// Takes the samples that are not yet known.
    fn sample(&mut self, open: &[Open], sides: &[u8], wanted: &[bool], depth: u32) {
        let mut keys: Vec<Key> = Vec::new();
        for ((item, sides), wanted) in open.iter().zip(sides).zip(wanted) {
            for side in Side::BOTH {
                if *wanted && sides >> side as u8 & 1 == 1 {
                    let places = self.places(item.at, depth, depth < self.last);
                    keys.extend(places.map(|p| key(p, side)));
                }
            }
        }
        keys.sort_unstable();
        keys.dedup();
        keys.retain(|k| !self.samples.contains_key(k));
        let step = 2.0 * self.table.half / f64::from(self.span(0));
        let corner = self.table.centre - self.table.half;
        let values: Vec<_> = keys
            .par_iter()
            .map(|k| {
                let (at, side) = unkey(*k);
                let p = corner + DVec3::from_array(at.map(f64::from)) * step;
                self.part.at(p, side)
            })
            .collect();
        self.samples.extend(keys.into_iter().zip(values));
    }

    fn fit(&self, at: [u32; 3], depth: u32, side: Side) -> Fit {
        let mut fit = [Complex64::ZERO; 27];
        for (value, place) in fit.iter_mut().zip(self.places(at, depth, false)) {
            *value = self.samples[&key(place, side)];
        }
        fit
    }

    /// Whether the fit of a side misses the densities at the middles of the cell's parts, or the
    /// cell holds a sharp edge.
    fn is_coarse(&self, open: &Open, sides: u8, depth: u32) -> bool {
        let allowed = self.cells.tolerance;
        let (edges, near) = (&self.table.edges, &open.near);
        let cell = &open.cell;
        if !self.part.varies() || edges.covers(near, cell.centre, cell.radius()) {
            return false;
        }
        let missed = |side: Side| {
            let fit = self.fit(open.at, depth, side);
            let tests = self.places(open.at, depth, true).skip(27).enumerate();
            tests.into_iter().any(|(n, place)| {
                let value = self.samples[&key(place, side)];
                let half = |i: usize| (i as f64) - 0.5;
                let u = DVec3::new(half(n / 4), half(n / 2 % 2), half(n % 2));
                let p = cell.centre + u * cell.half;
                !edges.covers(near, p, 0.0)
                    && (evaluate(&fit, u, 1.0).value - value).norm() > allowed
            })
        };
        let on = |side: Side| sides >> side as u8 & 1 == 1;
        edges.crosses(near, cell.centre, cell.half)
            || Side::BOTH.into_iter().any(|s| on(s) && missed(s))
    }

    fn divide(&mut self, item: Open, depth: u32, next: &mut Vec<Open>) {
        let first = self.table.nodes.len() as u32;
        self.table.nodes[item.cell.node as usize].first = first;
        let step = self.span(depth) / 2;
        let flat = 1e-12 * self.table.half;
        let parts = octants(&item.facets, item.cell.centre, flat);
        for (index, facets) in parts.into_iter().enumerate() {
            self.table.nodes.push(Node::open());
            let bit = |axis: usize| (index >> axis & 1) as u32 * step;
            let cell = item.cell.octant(index, first + index as u32);
            next.push(Open {
                near: self
                    .table
                    .edges
                    .near(&item.near, cell.centre, cell.radius()),
                cell,
                at: std::array::from_fn(|axis| item.at[axis] + bit(axis)),
                facets,
            });
        }
    }
}
