//! The values of a field: halo, boundary and cell averages.

use std::ops::Range;

use num_complex::Complex32;
use rayon::prelude::*;

use super::blocks::{Anchors, Arrays, BLOCK, Block, Grid, Patch, blocks};
use super::gaussian_smoothing::Smoothing;
use super::patch_density::{PatchDensity, PatchValues};
use super::upsampling::Upsampling;
use crate::field::kernel::{CumulativeKernel, DensityKernel};
use crate::field::lattice::Lattice;
use crate::field::options::{DensityError, Sampling};
use crate::field::packet::density::PacketDensity;
use crate::field::point::density::{PointDensity, STEP};
use crate::field::provenance::FieldProvenance;
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

/// There a cell's mean is its node's density unless a neighbour's differs by more than this share:
/// then the two are apart by a quarter of it at most.
const EVEN: f32 = 0.05;

/// Sub-points per axis of a cut cell.
const SUB: usize = 4;

/// The same of the fine lattice that is smoothed, whose sub-points are cut in two themselves.
const FINE_SUB: usize = 2;

/// What is flat for a tolerance, in units of the normalized part, whose longest side is 1 to 2. A
/// part of 50 mm in a file of metres with eight decimals is rounded by up to 2.3e-7. Signed
/// distances are to be within 1e-6 of the longest side; a field at 1e-5 and thin kernels shows a
/// surface that has moved by 1e-7.
fn flatness_for(tolerance: f64) -> f64 {
    3e-7 * (1e4 * tolerance).powf(0.8).min(1.0)
}

/// From this tolerance on most of a field is distances and far clusters, below it near faces.
const COARSE: f64 = 3e-4;

/// Computes the values of a field by its provenance, which is that of `mesh` and `kernel`, into arrays
/// of zeros.
pub(crate) fn fill(
    provenance: &FieldProvenance,
    arrays: Arrays<'_>,
    mesh: &TriangleMesh,
    kernel: &DensityKernel,
    monitor: &dyn Monitor,
) -> Result<(), DensityError> {
    // The surface in a tree, and the kernel.
    let tolerance = provenance.tolerance;
    let table = || CumulativeKernel::new(*kernel);
    let leaves = if tolerance < COARSE {
        Leaves::Small
    } else {
        Leaves::LargeOfMany
    };
    let surface = || Bvh::merged(mesh, flatness_for(tolerance), leaves);
    let (bvh, table) = rayon::join(surface, table);
    if bvh.faces.is_empty() {
        return Err(DensityError::EmptyMesh);
    }
    let tree = (&bvh, &table);
    // Point values and cell averages are sampled directly.
    let Sampling::Smoothed {
        deviation,
        sharpening,
    } = provenance.sampling
    else {
        let (grid, region) = Grid::of(&provenance.lattice);
        let sampler = Sampler::new(provenance, grid, tree);
        monitor.begin("density", region.block_count());
        return sample(&sampler, arrays, region.first, monitor);
    };
    // Smoothed fields are sampled on a finer lattice and filtered.
    let smoothing = Smoothing::new(&provenance.lattice, deviation, sharpening)?;
    let ends = [provenance.sampling.spread(), provenance.halo].map(|v| v as f32);
    let typical = kernel.half_space().norm() as f32;
    monitor.begin("density", smoothing.blocks());
    smoothing.fill(arrays, ends, typical, |grid, first, arrays, upsampling| {
        let mut sampler = Sampler::new(provenance, *grid, tree);
        if upsampling.is_none() {
            sampler.sampling = Sampling::Point;
        }
        sampler.upsampling = upsampling;
        sample(&sampler, arrays, first, monitor)
    })
}

/// Bytes that [`fill`] takes beside the arrays.
pub(crate) fn working_bytes(lattice: &Lattice, sampling: Sampling) -> u64 {
    let Sampling::Smoothed {
        deviation,
        sharpening,
    } = sampling
    else {
        return 0;
    };
    Smoothing::new(lattice, deviation, sharpening).map_or(0, |s| s.bytes())
}

/// Computes the values of arrays that begin at node `first`.
fn sample(
    sampler: &Sampler<'_>,
    arrays: Arrays<'_>,
    first: [i64; 3],
    monitor: &dyn Monitor,
) -> Result<(), DensityError> {
    let mut blocks = blocks(arrays, first);
    // Few enough reports for the monitor, whatever the lattice.
    let batch = blocks.len().div_ceil(2048);
    let batches = blocks.par_chunks_mut(batch);
    batches.try_for_each_init(Scratch::default, |scratch, batch| {
        for block in batch.iter_mut() {
            if monitor.cancelled() {
                return Err(DensityError::Cancelled);
            }
            sampler.fill_block(block, scratch);
        }
        monitor.advance(batch.len() as u64);
        Ok(())
    })
}

/// The part of the halo in which the exterior keeps its full value.
const UNTAPERED: f64 = 0.7;

/// The smooth cut-off of the exterior at signed distance `xi`: 1 up to 70 % of `halo`, 0 from
/// `halo` on, a quintic step between. A function of distance only, so it moves with the part.
pub(crate) fn taper(xi: f64, halo: f64) -> f64 {
    let t = ((xi / halo - UNTAPERED) / (1.0 - UNTAPERED)).clamp(0.0, 1.0);
    1.0 - t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

/// A cell cut by the boundary in two parts, as if this lay parallel to its sides: at `place` half
/// cells from the middle, outwards. Next to a face the interior density is the exterior one's
/// conjugate, whatever the model's thickness.
fn split_cell([exterior, interior]: [Complex32; 2], place: f32) -> [Complex32; 2] {
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
    grid: Grid,
    halo: f64,
    sampling: Sampling,
    /// Coarser nodes between which those of the grid lie.
    upsampling: Option<&'a Upsampling>,
}

/// Working memory of one batch of blocks.
#[derive(Default)]
struct Scratch {
    nodes: PatchValues,
    sub_points: PatchValues,
    /// Means over the cells for which the node does not stand.
    means: Vec<Option<[Complex32; 2]>>,
}

impl<'a> Sampler<'a> {
    fn new(
        provenance: &FieldProvenance,
        grid: Grid,
        (bvh, table): (&'a Bvh, &'a CumulativeKernel),
    ) -> Self {
        let scale = bvh.scale();
        let patches = PatchDensity::new(
            bvh,
            PacketDensity::new(bvh, table, provenance.tolerance),
            PointDensity::new(bvh, table),
            provenance.halo * scale,
            STEP * grid.spacing * scale,
            [provenance.tolerance, table.kernel().sigma()],
        );
        Self {
            patches,
            bvh,
            grid,
            halo: provenance.halo,
            sampling: provenance.sampling,
            upsampling: None,
        }
    }

    fn fill_block(&self, block: &mut Block<'_>, scratch: &mut Scratch) {
        if (self.upsampling).is_some_and(|upsampling| upsampling.fill(block)) {
            return;
        }
        // All nodes of the block, wanted or not: values do not depend on which are.
        let patch = Patch {
            origin: self.bvh.normalized(self.grid.position(block.place.corner)),
            spacing: self.grid.spacing * self.bvh.scale(),
            shape: [BLOCK; 3],
        };
        // Started anew for every block: results must not depend on which thread took which block.
        let mut hint = 0;
        self.patches
            .evaluate(&patch, None, &mut hint, &mut scratch.nodes);
        self.cell_averages(&patch, &mut hint, scratch);
        let faded = (UNTAPERED * self.halo * self.bvh.scale()) as f32;
        // A power of two: exact.
        let metres = (1.0 / self.bvh.scale()) as f32;
        let offset = block.place.offset;
        for ((x, y, z), signed_distance) in block.signed_distance.indexed_iter_mut() {
            let flat = patch.flat([x + offset[0], y + offset[1], z + offset[2]]);
            let distance = scratch.nodes.distance[flat];
            let parts = scratch.means[flat].unwrap_or_else(|| {
                let mut parts = scratch.nodes.parts(flat);
                if distance > faded {
                    parts[0] *= self.taper_factor(distance);
                }
                parts
            });
            *signed_distance = distance * metres;
            [block.exterior[[x, y, z]], block.interior[[x, y, z]]] = parts;
        }
    }

    /// Mean densities over the cells of a patch of nodes for which these do not stand: of
    /// neighbours along z together, whose sub-points fill packets.
    fn cell_averages(&self, patch: &Patch, hint: &mut usize, scratch: &mut Scratch) {
        scratch.means.clear();
        scratch.means.resize(patch.len(), None);
        let nz = patch.shape[2];
        for row in (0..patch.len()).step_by(nz) {
            let mut z = row;
            while z < row + nz {
                let first = z;
                while z < row + nz && self.is_averaged(patch, &scratch.nodes, z) {
                    z += 1;
                }
                if z > first {
                    self.average(patch, first..z, hint, scratch);
                }
                z += 1;
            }
        }
    }

    /// Whether the mean over a node's cell is not the density at the node.
    fn is_averaged(&self, patch: &Patch, nodes: &PatchValues, flat: usize) -> bool {
        let distance = nodes.distance[flat].abs();
        let within = |cells: f64| distance < (cells * patch.spacing) as f32;
        match self.sampling {
            Sampling::Point => false,
            Sampling::CellAverage => within(CUT),
            Sampling::Smoothed { .. } => {
                within(CUT) || within(UNEVEN) && !nodes.is_even(patch, flat, EVEN)
            }
        }
    }

    /// Mean densities over the cells of nodes (C order) in a row along z.
    fn average(&self, nodes: &Patch, cells: Range<usize>, hint: &mut usize, scratch: &mut Scratch) {
        let (sub, shares) = match self.sampling {
            Sampling::Smoothed { .. } => (FINE_SUB, true),
            _ => (SUB, false),
        };
        let first = nodes.position(nodes.unravel(cells.start));
        // Evenly spaced, so that no sub-point lies on a node plane or a cell face.
        let patch = Patch {
            origin: first - nodes.spacing * (0.5 - 0.5 / sub as f64),
            spacing: nodes.spacing / sub as f64,
            shape: [sub, sub, sub * cells.len()],
        };
        // Densities at the sub-points.
        let anchors = Anchors {
            patch: nodes,
            distance: &scratch.nodes.distance,
            cells: cells.clone(),
        };
        let (means, values) = (&mut scratch.means[cells], &mut scratch.sub_points);
        self.patches.evaluate(&patch, Some(anchors), hint, values);
        let half = 0.5 * patch.spacing as f32;
        // Means over each cell.
        means.fill(Some([Complex32::ZERO; 2]));
        for (flat, distance) in values.distance.iter().enumerate() {
            let mut parts = values.parts(flat);
            if shares && distance.abs() < half && *distance != 0.0 {
                parts = split_cell(parts, distance / half);
            }
            let cell = flat % patch.shape[2] / sub;
            if let Some(mean) = &mut means[cell] {
                mean[0] += parts[0] * self.taper_factor(*distance);
                mean[1] += parts[1];
            }
        }
        let weight = 1.0 / sub.pow(3) as f32;
        for mean in means.iter_mut().flatten().flatten() {
            *mean *= weight;
        }
    }

    /// The halo's cut-off at signed normalized `distance`.
    fn taper_factor(&self, distance: f32) -> f32 {
        taper(f64::from(distance) / self.bvh.scale(), self.halo) as f32
    }
}
