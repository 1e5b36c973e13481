//! Signed distance on a lattice, without the density.

use glam::DVec3;
use ndarray::{Array3, ArrayViewMut3};
use rayon::prelude::*;

use super::blocks::{BLOCK, Brick, Grid, Patch, Place, cut};
use super::sign_propagation::Signs;
use crate::field::lattice::{Lattice, zeros};
use crate::field::options::DensityError;
use crate::field::packet::distance::PacketDistance;
use crate::field::packet::points::LANES;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::monitor::Monitor;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;
use crate::surface::coplanar::pieces;

/// Packet coordinates are rounded to 1e-7 of half the packet's diagonal. Points nearer to the
/// boundary than this many of it are taken in f64, so that their distance, too, is good to 1e-4.
const NEAR: f32 = 1e-3;

/// Distance from the boundary of `mesh` at every node of `lattice`, metres, negative where the
/// generalized winding number exceeds 1/2; zero or either sign on the boundary itself. Good to 1e-6
/// of the part's size, far away to 1e-6 of the distance. Runs on rayon's current thread pool; the
/// result does not depend on the number of threads. Takes 4 bytes per node and one tree.
///
/// # Errors
/// If no triangle of the mesh has an area, the memory cannot be had, or the monitor cancels.
pub fn signed_distances(
    mesh: &TriangleMesh,
    lattice: &Lattice,
    monitor: &dyn Monitor,
) -> Result<Array3<f32>, DensityError> {
    let bvh = Bvh::merged(mesh, pieces::EXACT, Leaves::LargeOfMany);
    if bvh.faces.is_empty() {
        return Err(DensityError::EmptyMesh);
    }
    let bytes = 4 * lattice.len() as u64;
    let mut values = zeros(lattice.shape()).ok_or(DensityError::Memory { bytes })?;
    let packets = PacketDistance::new(&bvh);
    let (grid, region) = Grid::of(lattice);
    let mut blocks = cut(values.view_mut(), region.first);
    monitor.begin("signed distance", blocks.len() as u64);
    let batch = blocks.len().div_ceil(2048);
    blocks.par_chunks_mut(batch).try_for_each(|batch| {
        let mut scratch = Scratch::default();
        for (place, block) in batch.iter_mut() {
            if monitor.cancelled() {
                return Err(DensityError::Cancelled);
            }
            let patch = Patch {
                origin: bvh.normalized(grid.position(place.corner)),
                spacing: grid.spacing * bvh.scale(),
                shape: [BLOCK; 3],
            };
            fill(&bvh, &packets, &patch, &mut scratch, (*place, block));
        }
        monitor.advance(batch.len() as u64);
        Ok(())
    })?;
    Ok(values)
}

#[derive(Default)]
struct Scratch {
    bricks: Vec<Brick>,
    distance: Vec<f32>,
    signs: Signs,
}

fn fill(
    bvh: &Bvh,
    packets: &PacketDistance<'_>,
    patch: &Patch,
    scratch: &mut Scratch,
    (place, block): (Place, &mut ArrayViewMut3<'_, f32>),
) {
    let Scratch {
        bricks,
        distance,
        signs,
    } = scratch;
    patch.cut(bricks);
    distance.clear();
    distance.resize(patch.len(), 0.0);
    // Started anew for every block: results must not depend on which thread took which block.
    let mut hint = 0;
    for Brick { flat, points } in bricks.iter() {
        let found = packets.find_nearest(points, &mut hint);
        let near = NEAR * points.half_diagonal();
        for lane in 0..LANES {
            distance[flat[lane]] = if found[lane] > near {
                found[lane]
            } else {
                unsigned(bvh, patch.position(patch.unravel(flat[lane])))
            };
        }
    }
    signs.propagate(bvh, patch, None, |_| false, distance);
    // A power of two: exact.
    let metres = (1.0 / bvh.scale()) as f32;
    let [x, y, z] = place.offset;
    for ((i, j, k), value) in block.indexed_iter_mut() {
        *value = distance[patch.flat([x + i, y + j, z + k])] * metres;
    }
}

fn unsigned(bvh: &Bvh, q: DVec3) -> f32 {
    bvh.nearest_normalized(q).1.sqrt() as f32
}
