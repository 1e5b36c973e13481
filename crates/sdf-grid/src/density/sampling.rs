//! From points to lattice values: blocks, halo, boundary and cell averages.

use glam::DVec3;
use ndarray::{ArrayViewMut3, Axis};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;

use super::point::PointDensity;
use super::reference::UnitDensity;
use super::{DensityError, DensityField, Sampling, boundary};
use crate::bvh::Bvh;
use crate::{DensityKernel, Lattice, Monitor, TriangleMesh};

/// Nodes along each edge of a block, the unit of work.
const BLOCK: usize = 8;

/// A cell whose node is nearer to the boundary than this many spacings may be cut by it (the half
/// diagonal is 0.866).
const CUT: f64 = 0.87;

/// Sub-points per axis of a cut cell.
const SUB: usize = 4;

/// Computes every value of `field`, whose arrays are zero.
pub(crate) fn fill(
    field: &mut DensityField,
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    _tolerance: f64,
    monitor: &dyn Monitor,
) -> Result<(), DensityError> {
    let bvh = Bvh::build(mesh);
    if bvh.triangles.is_empty() {
        return Err(DensityError::EmptyMesh);
    }
    let sampler = Sampler {
        point: PointDensity::new(&bvh, kernel),
        bvh: &bvh,
        lattice: field.lattice,
        halo: field.halo,
        sampling: field.sampling,
    };
    let mut blocks = blocks(field);
    monitor.begin("density", blocks.len() as u64);
    // Few enough reports for the monitor, whatever the lattice.
    let batch = blocks.len().div_ceil(2048);
    blocks.par_chunks_mut(batch).try_for_each(|batch| {
        for block in batch.iter_mut() {
            if monitor.cancelled() {
                return Err(DensityError::Cancelled);
            }
            sampler.block(block);
        }
        monitor.advance(batch.len() as u64);
        Ok(())
    })
}

/// The smooth cut-off of the exterior at signed distance `xi`: 1 up to 70 % of `halo`, 0 from
/// `halo` on, a quintic step between. A function of distance only, so it moves with the part.
pub(crate) fn taper(xi: f64, halo: f64) -> f64 {
    let t = ((xi / halo - 0.7) / 0.3).clamp(0.0, 1.0);
    1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// A block of the field's arrays and where it starts.
struct Block<'a> {
    start: [usize; 3],
    exterior: ArrayViewMut3<'a, Complex32>,
    interior: ArrayViewMut3<'a, Complex32>,
    signed_distance: ArrayViewMut3<'a, f32>,
}

/// The field's arrays cut into blocks.
fn blocks(field: &mut DensityField) -> Vec<Block<'_>> {
    let exterior = cut(field.exterior.view_mut());
    let interior = cut(field.interior.view_mut());
    let distance = cut(field.signed_distance.view_mut());
    let parts = exterior.into_iter().zip(interior).zip(distance);
    parts
        .map(
            |(((start, exterior), (_, interior)), (_, signed_distance))| Block {
                start,
                exterior,
                interior,
                signed_distance,
            },
        )
        .collect()
}

/// Disjoint views of at most [`BLOCK`] nodes per axis, each with the index it starts at.
fn cut<T>(view: ArrayViewMut3<'_, T>) -> Vec<([usize; 3], ArrayViewMut3<'_, T>)> {
    (0..3).fold(vec![([0; 3], view)], |parts, axis| {
        let slices = |(start, view)| cut_axis(start, view, axis);
        parts.into_iter().flat_map(slices).collect()
    })
}

fn cut_axis<T>(
    mut start: [usize; 3],
    mut rest: ArrayViewMut3<'_, T>,
    axis: usize,
) -> Vec<([usize; 3], ArrayViewMut3<'_, T>)> {
    let mut parts = Vec::new();
    while rest.len_of(Axis(axis)) > BLOCK {
        let (head, tail) = rest.split_at(Axis(axis), BLOCK);
        parts.push((start, head));
        start[axis] += BLOCK;
        rest = tail;
    }
    parts.push((start, rest));
    parts
}

struct Sampler<'a> {
    point: PointDensity<'a>,
    bvh: &'a Bvh,
    lattice: Lattice,
    halo: f64,
    sampling: Sampling,
}

impl Sampler<'_> {
    fn block(&self, block: &mut Block<'_>) {
        let (nx, ny, nz) = block.exterior.dim();
        for index in (0..nx * ny * nz).map(|f| [f / (ny * nz), f / nz % ny, f % nz]) {
            let node = [0, 1, 2].map(|k| block.start[k] + index[k]);
            let (distance, density) = self.node(self.lattice.position(node));
            block.signed_distance[index] = distance as f32;
            block.exterior[index] = single(density.exterior);
            block.interior[index] = single(density.interior);
        }
    }

    /// Signed distance (metres) at the node and the density its cell stands for.
    fn node(&self, p: DVec3) -> (f64, UnitDensity) {
        let spacing = self.lattice.spacing();
        let (distance, density) = self.at(p);
        if self.sampling == Sampling::Point || distance.abs() >= CUT * spacing {
            return (distance, density);
        }
        let mut sum = UnitDensity::default();
        for sub in 0..SUB * SUB * SUB {
            let density = self.at(p + sub_point(sub) * spacing).1;
            sum.exterior += density.exterior;
            sum.interior += density.interior;
        }
        let count = (SUB * SUB * SUB) as f64;
        let mean = UnitDensity {
            exterior: sum.exterior / count,
            interior: sum.interior / count,
        };
        (distance, mean)
    }

    /// Signed distance (metres) and density with the halo's cut-off at `p` (metres).
    fn at(&self, p: DVec3) -> (f64, UnitDensity) {
        let q = self.bvh.normalized(p);
        let scale = self.bvh.scale();
        let far = self.bvh.nodes[0].distance_squared(q).sqrt() / scale >= self.halo;
        if far {
            return (self.bvh.signed_distance(p), UnitDensity::default());
        }
        let step = boundary::STEP * self.lattice.spacing() * scale;
        let (distance, mut density) = self.point.at(q, step);
        let distance = distance / scale;
        density.exterior *= taper(distance, self.halo);
        (distance, density)
    }
}

/// Place of sub-point `index` in a unit cell about its node. Even spacing, so that no sub-point
/// lies on a node plane or cell face.
fn sub_point(index: usize) -> DVec3 {
    let place = |i: usize| (i as f64 + 0.5) / SUB as f64 - 0.5;
    DVec3::new(
        place(index / (SUB * SUB)),
        place(index / SUB % SUB),
        place(index % SUB),
    )
}

fn single(z: Complex64) -> Complex32 {
    Complex32::new(z.re as f32, z.im as f32)
}
