//! A way between two parts, as reports tell of it.

use std::sync::Arc;

use fft_correlate::{Placement, Pose};
use pegfit_path::PathResult;
use sdf_grid::{LengthUnit, TriangleMesh};

/// A way between two parts of a scene, with what reports need.
pub struct WayReport {
    /// The way, of the shapes.
    pub answer: PathResult,
    /// What the moving part is called.
    pub name: String,
    /// The fixed part's surface, in its own frame.
    pub fixed: Arc<TriangleMesh>,
    /// The moving part's.
    pub moving: Arc<TriangleMesh>,
    /// Where the scene puts both.
    pub placement: Placement,
    /// Of lengths on pages and pictures.
    pub unit: LengthUnit,
    /// How long the fields of its energies took.
    pub field_seconds: Option<f64>,
}

impl WayReport {
    /// The fixed part where the scene puts it.
    pub(super) fn placed_fixed(&self) -> TriangleMesh {
        put(&self.fixed, &self.placement.fixed)
    }

    /// The moving part where the scene puts it.
    pub(super) fn placed_moving(&self) -> TriangleMesh {
        put(&self.moving, &self.placement.moving)
    }
}

fn put(mesh: &TriangleMesh, pose: &Pose) -> TriangleMesh {
    mesh.transformed(pose.rotation, pose.translation)
}
