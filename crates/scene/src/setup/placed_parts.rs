//! All parts of a scene where they are assembled.

use std::sync::Arc;

use fft_correlate::Pose;
use sdf_grid::{Aabb, LengthUnit, TriangleMesh};

use crate::error::SceneError;
use crate::scene::{Part, Scene};
use crate::setup::meshes::read_part;
use crate::setup::scene_setup::shown_in;
use crate::setup::warning::SceneWarning;

/// All parts of a scene where they are assembled: fixed ones where it puts them, the moving one at the
/// fit. A part of several meshes is one solid.
#[derive(Debug, Clone)]
pub struct PlacedParts {
    /// Names and surfaces, metres: the first fixed part, the other ones, then the moving part.
    pub parts: Vec<(String, Arc<TriangleMesh>)>,
    /// The unit for reports: the scene's, but millimetres instead of small fractions of a metre.
    pub display_unit: LengthUnit,
    /// What the scene's user should know.
    pub warnings: Vec<SceneWarning>,
}

impl PlacedParts {
    /// Reads the meshes of a scene.
    ///
    /// # Errors
    /// If a mesh cannot be used.
    pub fn read(scene: &Scene) -> Result<Self, SceneError> {
        let mut warnings = Vec::new();
        let mut placed = |part: &Part, pose: &Pose| -> Result<_, SceneError> {
            let mesh = read_part(scene, part, &mut warnings)?;
            let mesh = mesh.transformed(pose.rotation, pose.translation);
            Ok((part.name.clone(), Arc::new(mesh)))
        };
        let mut parts = Vec::new();
        for part in scene.fixed_parts() {
            parts.push(placed(part, &part.pose)?);
        }
        let seat = scene.fit.assembled * scene.moving.pose;
        parts.push(placed(&scene.moving, &seat)?);
        let boxes = parts.iter().map(|(_, mesh)| mesh.bounds());
        let bounds = boxes.fold(Aabb::EMPTY, |all, one| all.union(&one));
        Ok(Self {
            display_unit: shown_in(scene.unit, &bounds),
            parts,
            warnings,
        })
    }
}
