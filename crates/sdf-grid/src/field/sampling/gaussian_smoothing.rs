//! Fields smoothed by a Gaussian before they are sampled, so that a lattice can represent densities
//! that jump.
//!
//! The density is averaged over the cells of a lattice twice as fine, then filtered along z, y and
//! x to every second node. Only a few planes of the fine lattice exist at a time, and they are
//! computed only where [`upsampling`](super::upsampling) from coarser nodes does not suffice.

use std::ops::RangeInclusive;

use ndarray::{Array2, Array3, ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis, Zip};
use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Arrays, Grid, Region};
use super::upsampling::{BYTES, FINE, Upsampling};
use crate::field::lattice::{Lattice, zeros};
use crate::field::options::DensityError;

/// Fine nodes along x that are worked on together: two blocks deep.
const DEPTH: usize = 16;

/// The Gaussian is cut off beyond this many standard deviations.
const CUT_OFF: f64 = 3.5;

/// Weights of a filter along one axis.
#[derive(Debug, Clone)]
struct Filter {
    /// The Gaussian, from the leftmost fine node to the rightmost.
    value: Vec<f32>,
    /// What sharpening adds: minus half of it times the second derivative.
    bend: Option<Vec<f32>>,
}

impl Filter {
    fn new(deviation: f64, sharpening: f64, spacing: f64) -> Self {
        // Cells have averaged already.
        let variance = deviation * deviation - spacing * spacing / 12.0;
        let reach = (CUT_OFF * deviation / spacing).ceil() as i32;
        let places = (-reach..=reach).map(|i| f64::from(i) * spacing);
        let value: Vec<f64> = places
            .clone()
            .map(|x| (-0.5 * x * x / variance).exp())
            .collect();
        let sum: f64 = value.iter().sum();
        let curved = |(x, v): (f64, &f64)| (1.0 - x * x / variance) * v / variance / sum;
        let mut bend: Vec<f64> = places.clone().zip(&value).map(curved).collect();
        // A constant has no curvature, a parabola its own, whatever was cut off.
        let rest: f64 = bend.iter().sum();
        bend.iter_mut()
            .zip(&value)
            .for_each(|(b, v)| *b -= rest * v / sum);
        let square: f64 = places.zip(&bend).map(|(x, b)| x * x * b).sum();
        let scale = -sharpening / square;
        Self {
            value: value.iter().map(|v| (v / sum) as f32).collect(),
            bend: (sharpening > 0.0).then(|| bend.iter().map(|b| (b * scale) as f32).collect()),
        }
    }

    /// How many fine nodes it reaches to either side.
    fn reach(&self) -> usize {
        self.value.len() / 2
    }

    /// The first fine node that a node reads.
    fn first(&self, node: i64) -> i64 {
        FINE as i64 * node - self.reach() as i64
    }
}

/// A fine plane filtered along y and z: smoothed, and what sharpening along y and z adds.
struct Plane {
    value: Array2<Complex32>,
    bend: Array2<Complex32>,
}

/// Standard deviations that a lattice can be smoothed by, in spacings: below, it is as coarse as
/// without; above, the filter takes longer than the densities.
const DEVIATIONS: RangeInclusive<f64> = 0.3..=4.0;

/// How nodes are filled from a finer grid.
pub(super) struct Smoothing {
    filter: Filter,
    grid: Grid,
    /// The nodes to fill.
    nodes: Region,
    /// Nodes of the finer grid that are computed: the blocks of those that are read.
    fine: Region,
}

impl Smoothing {
    /// # Errors
    /// If the lattice cannot be smoothed by so much or so little.
    pub(super) fn new(
        lattice: &Lattice,
        deviation: f64,
        sharpening: f64,
    ) -> Result<Self, DensityError> {
        if !DEVIATIONS.contains(&(deviation / lattice.spacing())) {
            return Err(DensityError::Option {
                name: "deviation",
                expected: "0.3 to 4 lattice spacings",
                found: deviation,
            });
        }
        let (grid, nodes) = Grid::of(lattice);
        let filter = Filter::new(deviation, sharpening, grid.finer().spacing);
        let first = nodes.first.map(|n| filter.first(n));
        let last = nodes
            .last()
            .map(|n| filter.first(n) + 2 * filter.reach() as i64);
        Ok(Self {
            filter,
            grid,
            nodes,
            fine: Region::between(first, last).in_blocks(),
        })
    }

    /// Slabs of the fine nodes, one behind the other along x.
    fn slabs(&self) -> impl Iterator<Item = Region> + '_ {
        let ([x, y, z], [nx, ny, nz]) = (self.fine.first, self.fine.shape);
        (0..nx).step_by(DEPTH).map(move |first| Region {
            first: [x + first as i64, y, z],
            shape: [DEPTH.min(nx - first), ny, nz],
        })
    }

    /// Number of blocks that `sample` of [`Smoothing::fill`] computes.
    pub(super) fn blocks(&self) -> u64 {
        let fine: u64 = self.slabs().map(|slab| slab.block_count()).sum();
        fine + Upsampling::region(&self.fine).block_count()
    }

    /// Bytes that [`Smoothing::fill`] takes beside the arrays.
    pub(super) fn bytes(&self) -> u64 {
        let slab = self.slabs().next().map_or(0, |slab| slab.len());
        (Upsampling::region(&self.fine).len().saturating_add(slab)).saturating_mul(BYTES as u64)
    }

    /// Fills arrays of zeros up to where densities end: beyond the boundary, on its other side, and
    /// beyond the halo by half as much, where next to nothing is left. A filter reaches the corners
    /// of a box; what ends within a distance moves with the part, and is as small as it can be in
    /// every direction. `typical` is a density of that kernel. `sample` fills arrays from a node of
    /// a grid on: with values at the nodes, or with means over their cells where there are coarser
    /// nodes between which they lie.
    pub(super) fn fill(
        &self,
        mut arrays: Arrays<'_>,
        [spread, halo]: [f32; 2],
        typical: f32,
        mut sample: impl FnMut(
            &Grid,
            [i64; 3],
            Arrays<'_>,
            Option<&Upsampling>,
        ) -> Result<(), DensityError>,
    ) -> Result<(), DensityError> {
        // The coarse nodes, from which smooth blocks are interpolated.
        let upsampling = Upsampling::new(
            &self.grid,
            &self.fine,
            (&self.nodes, &mut arrays.signed_distance),
            typical,
            |first, arrays| sample(&self.grid, first, arrays, None),
        )?;
        // Slabs of the fine nodes, filtered one after the other.
        let finer = self.grid.finer();
        for slab in self.slabs() {
            let memory = || DensityError::Memory {
                bytes: slab.len().saturating_mul(BYTES as u64),
            };
            let mut exterior = zeros(slab.shape).ok_or_else(memory)?;
            let mut interior = zeros(slab.shape).ok_or_else(memory)?;
            let mut distance = zeros(slab.shape).ok_or_else(memory)?;
            let fine = Arrays {
                exterior: exterior.view_mut(),
                interior: interior.view_mut(),
                signed_distance: distance.view_mut(),
            };
            sample(&finer, slab.first, fine, Some(&upsampling))?;
            self.add_slab(slab.first, &exterior, &mut arrays.exterior);
            self.add_slab(slab.first, &interior, &mut arrays.interior);
        }
        // Cuts off what lies beyond the filter and the halo.
        Zip::from(&arrays.signed_distance)
            .and(&mut arrays.exterior)
            .and(&mut arrays.interior)
            .par_for_each(|distance, exterior, interior| {
                if !(-spread..=halo + 0.5 * spread).contains(distance) {
                    *exterior = Complex32::ZERO;
                }
                if *distance > spread {
                    *interior = Complex32::ZERO;
                }
            });
        Ok(())
    }

    /// Adds what the planes of a slab from a node on give to the nodes within the filter's reach.
    fn add_slab(
        &self,
        first: [i64; 3],
        slab: &Array3<Complex32>,
        to: &mut ArrayViewMut3<'_, Complex32>,
    ) {
        let filter = &self.filter;
        let (fine, reach) = (FINE as i64, filter.reach() as i64);
        let [begin, end] = [self.nodes.first[0], self.nodes.last()[0]];
        for (plane, place) in slab.outer_iter().zip(first[0]..) {
            if plane.iter().all(|v| *v == Complex32::ZERO) {
                continue;
            }
            let near = (place - reach + fine - 1).div_euclid(fine).max(begin)
                ..=(place + reach).div_euclid(fine).min(end);
            if near.is_empty() {
                continue;
            }
            let plane = self.filter_plane(&plane, first);
            for n in near {
                let tap = (place - filter.first(n)) as usize;
                let (v, b) = (filter.value[tap], filter.bend.as_ref().map(|b| b[tap]));
                let mut nodes = to.index_axis_mut(Axis(0), (n - begin) as usize);
                add_plane(&mut nodes, &plane, v, b);
            }
        }
    }

    /// A fine plane, which begins at a node, filtered along z and y.
    fn filter_plane(&self, fine: &ArrayView2<'_, Complex32>, first: [i64; 3]) -> Plane {
        let filter = &self.filter;
        let [_, ny, nz] = self.nodes.shape;
        // From the first fine node that is there to the first that is read.
        let skipped = |axis: usize| (filter.first(self.nodes.first[axis]) - first[axis]) as usize;
        let (skipped_y, skipped_z) = (skipped(1), skipped(2));
        let rows: Vec<[Vec<Complex32>; 2]> = (0..fine.nrows())
            .into_par_iter()
            .map(|y| {
                let row = fine.row(y).to_slice().unwrap_or_default();
                filter_row(filter, &row[skipped_z..], nz)
            })
            .collect();
        let (mut value, mut bend) = (Array2::zeros([ny, nz]), Array2::zeros([ny, nz]));
        let lines = value
            .outer_iter_mut()
            .into_par_iter()
            .zip(bend.outer_iter_mut());
        lines.enumerate().for_each(|(y, (mut value, mut bend))| {
            let near = &rows[skipped_y + FINE * y..][..filter.value.len()];
            for (k, [v, b]) in near.iter().enumerate() {
                axpy(filter.value[k], v, value.as_slice_mut().unwrap_or_default());
                if let Some(weights) = &filter.bend {
                    axpy(weights[k], v, bend.as_slice_mut().unwrap_or_default());
                    axpy(filter.value[k], b, bend.as_slice_mut().unwrap_or_default());
                }
            }
        });
        Plane { value, bend }
    }
}

/// Adds a filtered plane to a plane of nodes.
fn add_plane(to: &mut ArrayViewMut2<'_, Complex32>, plane: &Plane, value: f32, bend: Option<f32>) {
    to.scaled_add((value + bend.unwrap_or(0.0)).into(), &plane.value);
    if bend.is_some() {
        to.scaled_add(value.into(), &plane.bend);
    }
}

fn axpy(weight: f32, from: &[Complex32], to: &mut [Complex32]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += f * weight;
    }
}

/// A fine row, from the first node that is read on, filtered to `nz` nodes: smoothed, and what sharpening adds.
fn filter_row(filter: &Filter, fine: &[Complex32], nz: usize) -> [Vec<Complex32>; 2] {
    let sum = |weights: &[f32], k: usize| {
        let near = &fine[FINE * k..][..weights.len()];
        let terms = near.iter().zip(weights).map(|(v, w)| v * w);
        terms.fold(Complex32::ZERO, |a, b| a + b)
    };
    let value = (0..nz).map(|k| sum(&filter.value, k)).collect();
    let bend = match &filter.bend {
        Some(weights) => (0..nz).map(|k| sum(weights, k)).collect(),
        None => Vec::new(),
    };
    [value, bend]
}
