//! The truth of a pair.

use fft_correlate::{Pose, ScoreModel, Wrench};
use rayon::prelude::*;
use sdf_grid::{DensityError, DensityKernel, TriangleMesh};

use super::sums::{Sums, Weights};
use super::walk::Walk;
use crate::error::TruthError;
use crate::geometry::facet::Faces;
use crate::halo::halo_of;
use crate::options::{Cells, Densities, TruthOptions};
use crate::table::octree::DensityTable;
use crate::table::one_sided::OneSided;

/// One part: its shape and its densities.
#[derive(Debug, Clone)]
pub(super) struct TablePart {
    pub(super) exact: OneSided,
    pub(super) table: DensityTable,
    pub(super) faces: Faces,
}

/// Energy, force and torque of a pair of closed polyhedral meshes, by integration over the pieces
/// into which both surfaces cut space.
#[derive(Debug, Clone)]
pub struct Truth {
    pub(super) fixed: TablePart,
    pub(super) moving: TablePart,
    pub(super) weights: Weights,
    pub(super) cells: Cells,
    /// Whether densities change from place to place.
    pub(super) varies: bool,
    gamma: f64,
}

/// What is true at a pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrueResponse {
    /// `E = -gamma Re f`, joules (eq_6).
    pub energy: f64,
    /// Force and torque on the moving part, about its origin, fixed frame (eq_9a, eq_9b): the exact
    /// derivative. Where faces of both parts coincide the energy has a crease, and this is the mean
    /// of the slopes to both sides.
    pub wrench: Wrench,
}

impl Truth {
    /// Prepares a pair.
    ///
    /// # Errors
    /// If the model or an option is out of range, or a part has no surface.
    pub fn new(
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
        model: &ScoreModel,
        options: &TruthOptions,
    ) -> Result<Self, TruthError> {
        model.validate()?;
        let kernel = DensityKernel::new(model.sigma)?;
        let (a, b) = (fixed.bounds(), moving.bounds());
        let smaller = if a.diagonal() < b.diagonal() { &a } else { &b };
        let cells = options.cells(smaller.size().min_element())?;
        let halo = halo_of(model, [fixed, moving], options.halo)?;
        let part = |mesh: &TriangleMesh| {
            let faces = Faces::new(mesh);
            if faces.facets.is_empty() {
                return Err(TruthError::Density(DensityError::EmptyMesh));
            }
            let exact = OneSided::new(mesh, &kernel, options.densities, halo);
            let table = DensityTable::new(mesh, &exact, cells, halo);
            Ok(TablePart {
                exact,
                table,
                faces,
            })
        };
        Ok(Self {
            fixed: part(fixed)?,
            moving: part(moving)?,
            weights: Weights::new(model),
            cells,
            varies: options.densities == Densities::Model,
            gamma: model.gamma,
        })
    }

    /// Energy and wrench at `pose`, on the calling thread.
    pub fn at(&self, pose: &Pose) -> TrueResponse {
        let Sums { score, wrench } = Walk::over(self, pose);
        TrueResponse {
            energy: -self.gamma * score,
            wrench: wrench * self.gamma,
        }
    }

    /// [`Truth::at`] of every pose, on rayon's current thread pool.
    pub fn at_all(&self, poses: &[Pose]) -> Vec<TrueResponse> {
        poses.par_iter().map(|pose| self.at(pose)).collect()
    }

    /// Cells of both octrees.
    pub fn cell_count(&self) -> usize {
        self.fixed.table.len() + self.moving.table.len()
    }
}
