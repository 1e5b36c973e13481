//! Fields smoothed by a Gaussian before they are sampled, so that a lattice can represent densities
//! that jump.
//!
//! The density is averaged over the cells of a lattice twice as fine, then filtered along z, y and
//! x to every second node. Only a few planes of the fine lattice exist at a time, and they are
//! computed only where [`upsampling`](super::upsampling) from coarser nodes does not suffice.

use std::ops::RangeInclusive;

use glam::DVec3;
use ndarray::{Array2, Array3, ArrayView2, ArrayViewMut2, ArrayViewMut3, Axis, Zip};
use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Arrays, block_count};
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

    /// Fine nodes before the first node of the lattice: of the nodes between which they lie, whole
    /// steps.
    fn margin(&self) -> usize {
        self.reach().next_multiple_of(FINE)
    }

    /// The first fine node that the first node of the lattice reads.
    fn first(&self) -> usize {
        self.margin() - self.reach()
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

/// How a lattice is filled from a finer one.
pub(super) struct Smoothing {
    filter: Filter,
    /// The first node of the fine lattice, metres.
    origin: DVec3,
    spacing: f64,
    /// Nodes of the fine lattice.
    shape: [usize; 3],
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
        let spacing = lattice.spacing() / FINE as f64;
        let filter = Filter::new(deviation, sharpening, spacing);
        let margin = filter.margin();
        Ok(Self {
            origin: lattice.origin() - margin as f64 * spacing,
            shape: lattice.shape().map(|n| FINE * (n - 1) + 1 + 2 * margin),
            filter,
            spacing,
        })
    }

    /// Shapes of the slabs of the fine lattice, one behind the other along x.
    fn slabs(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        let [nx, ny, nz] = self.shape;
        (0..nx)
            .step_by(DEPTH)
            .map(move |first| [DEPTH.min(nx - first), ny, nz])
    }

    /// Number of blocks that `sample` of [`Smoothing::fill`] computes.
    pub(super) fn blocks(&self) -> u64 {
        let fine: u64 = self.slabs().map(block_count).sum();
        fine + block_count(Upsampling::shape(self.shape))
    }

    /// Bytes that [`Smoothing::fill`] takes beside the arrays.
    pub(super) fn bytes(&self) -> u64 {
        let nodes = |shape: [usize; 3]| shape.iter().fold(1, |n, s| s.saturating_mul(n)) as u64;
        let [nx, ny, nz] = self.shape;
        let slab = nodes([DEPTH.min(nx), ny, nz]);
        (nodes(Upsampling::shape(self.shape)) + slab).saturating_mul(BYTES as u64)
    }

    /// Fills arrays of zeros up to where densities end: beyond the boundary, on its other side, and
    /// beyond the halo by half as much, where next to nothing is left. A filter reaches the corners
    /// of a box; what ends within a distance moves with the part, and is as small as it can be in
    /// every direction. `sample` fills the values of a lattice: at its nodes, or if there are nodes
    /// between which it lies, beginning so many fine planes from their start, means over its cells.
    pub(super) fn fill(
        &self,
        lattice: &Lattice,
        mut arrays: Arrays<'_>,
        [spread, halo]: [f32; 2],
        mut sample: impl FnMut(
            &Lattice,
            Arrays<'_>,
            Option<(&Upsampling, usize)>,
        ) -> Result<(), DensityError>,
    ) -> Result<(), DensityError> {
        let filter = &self.filter;
        // The coarse lattice, from which smooth blocks are interpolated.
        let upsampling = Upsampling::new(
            lattice,
            filter.margin(),
            self.shape,
            &mut arrays.signed_distance,
            |coarse, arrays| sample(coarse, arrays, None),
        )?;
        // Slabs of the fine lattice, filtered one after the other.
        for (slab, shape) in self.slabs().enumerate() {
            let first = slab * DEPTH;
            let origin = self.origin + DVec3::X * (first as f64 * self.spacing);
            let memory = || DensityError::Memory {
                bytes: shape.iter().fold(20, |b, n| b.saturating_mul(*n as u64)),
            };
            let slab = Lattice::new(origin, self.spacing, shape).map_err(|_| memory())?;
            let mut exterior = zeros(&slab).ok_or_else(memory)?;
            let mut interior = zeros(&slab).ok_or_else(memory)?;
            let mut distance = zeros(&slab).ok_or_else(memory)?;
            sample(
                &slab,
                Arrays {
                    exterior: exterior.view_mut(),
                    interior: interior.view_mut(),
                    signed_distance: distance.view_mut(),
                },
                Some((&upsampling, first)),
            )?;
            add_slab(filter, first, &exterior, &mut arrays.exterior);
            add_slab(filter, first, &interior, &mut arrays.interior);
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
}

/// Adds what the planes of a slab give to the nodes within the filter's reach.
fn add_slab(
    filter: &Filter,
    first: usize,
    slab: &Array3<Complex32>,
    to: &mut ArrayViewMut3<'_, Complex32>,
) {
    let (nodes, ny, nz) = to.dim();
    for (i, fine) in slab.outer_iter().enumerate() {
        if fine.iter().all(|v| *v == Complex32::ZERO) {
            continue;
        }
        let plane = filter_plane(filter, &fine, [ny, nz]);
        // Node n is the sum over fine planes from FINE n on, counted from the first that is read.
        let Some(place) = (first + i).checked_sub(filter.first()) else {
            continue;
        };
        let last = (place / FINE).min(nodes - 1);
        let taps = filter.value.len();
        let begin = (place + 1).saturating_sub(taps).div_ceil(FINE);
        for n in begin..=last {
            let tap = place - FINE * n;
            let (v, b) = (filter.value[tap], filter.bend.as_ref().map(|b| b[tap]));
            add_plane(&mut to.index_axis_mut(Axis(0), n), &plane, v, b);
        }
    }
}

/// Adds a filtered plane to a plane of nodes.
fn add_plane(to: &mut ArrayViewMut2<'_, Complex32>, plane: &Plane, value: f32, bend: Option<f32>) {
    to.scaled_add((value + bend.unwrap_or(0.0)).into(), &plane.value);
    if bend.is_some() {
        to.scaled_add(value.into(), &plane.bend);
    }
}

/// A fine plane filtered along z and y to `ny` by `nz` nodes.
fn filter_plane(filter: &Filter, fine: &ArrayView2<'_, Complex32>, [ny, nz]: [usize; 2]) -> Plane {
    let rows: Vec<[Vec<Complex32>; 2]> = (0..fine.nrows())
        .into_par_iter()
        .map(|y| filter_row(filter, fine.row(y).to_slice().unwrap_or_default(), nz))
        .collect();
    let (mut value, mut bend) = (Array2::zeros([ny, nz]), Array2::zeros([ny, nz]));
    let lines = value
        .outer_iter_mut()
        .into_par_iter()
        .zip(bend.outer_iter_mut());
    lines.enumerate().for_each(|(y, (mut value, mut bend))| {
        let near = &rows[filter.first() + FINE * y..][..filter.value.len()];
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

fn axpy(weight: f32, from: &[Complex32], to: &mut [Complex32]) {
    for (t, f) in to.iter_mut().zip(from) {
        *t += f * weight;
    }
}

/// A fine row filtered to `nz` nodes: smoothed, and what sharpening adds.
fn filter_row(filter: &Filter, fine: &[Complex32], nz: usize) -> [Vec<Complex32>; 2] {
    let sum = |weights: &[f32], k: usize| {
        let near = &fine[filter.first() + FINE * k..][..weights.len()];
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
