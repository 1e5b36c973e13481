//! The values of a field: halo, boundary and cell averages.

use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Arrays, Block, block_count, blocks};
use super::patch::{Anchor, Patch};
use super::patch_density::{PatchDensity, PatchValues};
use super::smoothed::Smoothing;
use crate::field::error::DensityError;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::field::lattice::Lattice;
use crate::field::options::Sampling;
use crate::field::packet::density::PacketDensity;
use crate::field::point::boundary;
use crate::field::point::tree::PointDensity;
use crate::field::recipe::FieldRecipe;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::monitor::Monitor;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;

/// A cell whose node is nearer to the boundary than this many spacings may be cut by it (the half
/// diagonal is 0.866).
const CUT: f64 = 0.87;

/// In cells of the fine lattice nearer to the boundary than this many spacings the density may vary
/// as much within the cell as from cell to cell, next to edges.
const UNEVEN: f64 = 2.0;

/// Sub-points per axis of a cut cell.
const SUB: usize = 4;

/// The same of the fine lattice that is smoothed, whose sub-points are cut in two themselves.
const FINE_SUB: usize = 2;

/// What is flat for a tolerance, in units of the normalized part, whose longest side is 1 to 2. A
/// part of 50 mm in a file of metres with eight decimals is rounded by up to 2.3e-7. Signed
/// distances are to be within 1e-6 of the longest side; a field at 1e-5 and thin kernels shows a
/// surface that has moved by 1e-7.
fn flat(tolerance: f64) -> f64 {
    3e-7 * (1e4 * tolerance).powf(0.8).min(1.0)
}

/// From this tolerance on most of a field is distances and far clusters, below it near faces.
const COARSE: f64 = 3e-4;

/// Computes the values of a field by its recipe, which is that of `mesh` and `kernel`, into arrays
/// of zeros.
pub(crate) fn fill(
    recipe: &FieldRecipe,
    arrays: Arrays<'_>,
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    monitor: &dyn Monitor,
) -> Result<(), DensityError> {
    let tolerance = recipe.tolerance;
    let table = || CumulativeKernel::new(*kernel);
    let leaves = if tolerance < COARSE {
        Leaves::Small
    } else {
        Leaves::LargeOfMany
    };
    let surface = || Bvh::merged(mesh, flat(tolerance), leaves);
    let (bvh, table) = rayon::join(surface, table);
    if bvh.faces.is_empty() {
        return Err(DensityError::EmptyMesh);
    }
    let tree = (&bvh, &table);
    let Sampling::Smoothed {
        deviation,
        sharpening,
    } = recipe.sampling
    else {
        let sampler = Sampler::new(recipe, recipe.lattice, tree);
        monitor.begin("density", block_count(recipe.lattice.shape()));
        return sample(&sampler, arrays, monitor);
    };
    let smoothing = Smoothing::new(&recipe.lattice, deviation, sharpening)?;
    let count = smoothing.slabs().map(block_count).sum();
    monitor.begin("density", count);
    smoothing.fill(arrays, |slab, arrays| {
        sample(&Sampler::new(recipe, *slab, tree), arrays, monitor)
    })
}

/// Computes the values of a lattice.
fn sample(
    sampler: &Sampler<'_>,
    arrays: Arrays<'_>,
    monitor: &dyn Monitor,
) -> Result<(), DensityError> {
    let mut blocks = blocks(arrays);
    // Few enough reports for the monitor, whatever the lattice.
    let batch = blocks.len().div_ceil(2048);
    let batches = blocks.par_chunks_mut(batch);
    batches.try_for_each_init(Scratch::default, |scratch, batch| {
        for block in batch.iter_mut() {
            if monitor.cancelled() {
                return Err(DensityError::Cancelled);
            }
            sampler.block(block, scratch);
        }
        monitor.advance(batch.len() as u64);
        Ok(())
    })
}

/// The part of the halo in which the exterior keeps its full value.
const UNFADED: f64 = 0.7;

/// The smooth cut-off of the exterior at signed distance `xi`: 1 up to 70 % of `halo`, 0 from
/// `halo` on, a quintic step between. A function of distance only, so it moves with the part.
fn taper(xi: f64, halo: f64) -> f64 {
    let t = ((xi / halo - UNFADED) / (1.0 - UNFADED)).clamp(0.0, 1.0);
    1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// A cell cut by the boundary in two parts, as if this lay parallel to its sides: at `place` half
/// cells from the middle, outwards. Next to a face the interior density is the exterior one's
/// conjugate, whatever the model's thickness.
fn share([exterior, interior]: [Complex32; 2], place: f32) -> [Complex32; 2] {
    let outside = 0.5 + 0.5 * place;
    let exterior = if place > 0.0 {
        exterior
    } else {
        interior.conj()
    };
    [exterior * outside, exterior.conj() * (1.0 - outside)]
}

struct Sampler<'a> {
    patches: PatchDensity<'a>,
    bvh: &'a Bvh,
    lattice: Lattice,
    halo: f64,
    sampling: Sampling,
}

/// Working memory of one batch of blocks.
#[derive(Default)]
struct Scratch {
    nodes: PatchValues,
    sub_points: PatchValues,
}

impl<'a> Sampler<'a> {
    fn new(
        recipe: &FieldRecipe,
        lattice: Lattice,
        (bvh, table): (&'a Bvh, &'a CumulativeKernel),
    ) -> Self {
        let scale = bvh.scale();
        let patches = PatchDensity::new(
            bvh,
            PacketDensity::new(bvh, table, recipe.tolerance),
            PointDensity::new(bvh, table),
            recipe.halo * scale,
            boundary::STEP * lattice.spacing() * scale,
            [recipe.tolerance, table.kernel().sigma()],
        );
        Self {
            patches,
            bvh,
            lattice,
            halo: recipe.halo,
            sampling: recipe.sampling,
        }
    }

    fn block(&self, block: &mut Block<'_>, scratch: &mut Scratch) {
        let shape: [usize; 3] = block.exterior.dim().into();
        let patch = Patch {
            origin: self.bvh.normalized(self.lattice.position(block.start)),
            spacing: self.lattice.spacing() * self.bvh.scale(),
            shape,
        };
        // Started anew for every block: results must not depend on which thread took which block.
        let mut hint = 0;
        self.patches
            .evaluate(&patch, None, &mut hint, &mut scratch.nodes);
        let averaged = match self.sampling {
            Sampling::CellAverage => (CUT * patch.spacing) as f32,
            Sampling::Smoothed { .. } => (UNEVEN * patch.spacing) as f32,
            Sampling::Point => 0.0,
        };
        let faded = (UNFADED * self.halo * self.bvh.scale()) as f32;
        // A power of two: exact.
        let metres = (1.0 / self.bvh.scale()) as f32;
        let [_, ny, nz] = shape;
        let lines = (block.exterior.rows_mut().into_iter())
            .zip(block.interior.rows_mut())
            .zip(block.signed_distance.rows_mut());
        for (line, ((mut exterior, mut interior), mut signed_distance)) in lines.enumerate() {
            for z in 0..nz {
                let flat = line * nz + z;
                let distance = scratch.nodes.distance[flat];
                let mut parts = scratch.nodes.parts(flat);
                if distance.abs() < averaged {
                    let position = patch.position([line / ny, line % ny, z]);
                    let node = Anchor { position, distance };
                    let values = &mut scratch.sub_points;
                    parts = self.cell_average(node, patch.spacing, &mut hint, values);
                } else if distance > faded {
                    parts[0] *= self.fading(distance);
                }
                signed_distance[z] = distance * metres;
                [exterior[z], interior[z]] = parts;
            }
        }
    }

    /// Mean density over the cell about `node`, whose edges are `spacing` long (normalized).
    fn cell_average(
        &self,
        node: Anchor,
        spacing: f64,
        hint: &mut usize,
        values: &mut PatchValues,
    ) -> [Complex32; 2] {
        let (sub, shares) = match self.sampling {
            Sampling::Smoothed { .. } => (FINE_SUB, true),
            _ => (SUB, false),
        };
        // Evenly spaced, so that no sub-point lies on a node plane or a cell face.
        let patch = Patch {
            origin: node.position - spacing * (0.5 - 0.5 / sub as f64),
            spacing: spacing / sub as f64,
            shape: [sub; 3],
        };
        self.patches.evaluate(&patch, Some(node), hint, values);
        let half = 0.5 * patch.spacing as f32;
        let mut sums = [Complex32::ZERO; 2];
        for (flat, distance) in values.distance.iter().enumerate() {
            let mut parts = values.parts(flat);
            if shares && distance.abs() < half && *distance != 0.0 {
                parts = share(parts, distance / half);
            }
            sums[0] += parts[0] * self.fading(*distance);
            sums[1] += parts[1];
        }
        let weight = 1.0 / values.distance.len() as f32;
        sums.map(|sum| sum * weight)
    }

    /// The halo's cut-off at signed normalized `distance`.
    fn fading(&self, distance: f32) -> f32 {
        taper(f64::from(distance) / self.bvh.scale(), self.halo) as f32
    }
}
