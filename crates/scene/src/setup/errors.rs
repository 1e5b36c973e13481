//! Errors of the libraries as errors of a scene.

use fft_correlate::tolerance::ToleranceError;
use fft_correlate::{DockingError, PairBuildError, PairSetupError, TablePlanError};

use crate::error::SceneError;
use crate::scene::Scene;

/// Name of the density fields in errors of memory.
const FIELDS: &str = "the density fields";

/// Name of the correlation there.
const CORRELATION: &str = "the correlation";

impl Scene {
    pub(super) fn memory_error(&self, what: &'static str, needed: u64, limit: u64) -> SceneError {
        SceneError::Memory {
            path: self.path.clone(),
            what,
            needed,
            limit,
        }
    }

    pub(crate) fn fields_error(&self, error: PairBuildError) -> SceneError {
        match error {
            PairBuildError::Memory { needed, limit, .. } => {
                self.memory_error(FIELDS, needed, limit)
            }
            PairBuildError::TooSmall {
                part,
                size,
                spacing,
            } => SceneError::TooSmall {
                path: self.path.clone(),
                part,
                name: match part {
                    "fixed" => self.fixed.name.clone(),
                    _ => self.moving.name.clone(),
                },
                size,
                spacing,
                unit: self.unit,
            },
            other => SceneError::refused(&self.path, "", other),
        }
    }

    pub(super) fn pair_error(&self, error: PairSetupError) -> SceneError {
        match error {
            PairSetupError::Cancelled => SceneError::Cancelled,
            PairSetupError::Build(e) => self.fields_error(e),
            PairSetupError::Energy(e) => SceneError::refused(&self.path, "energy", e),
        }
    }

    pub(super) fn design_error(&self, error: TablePlanError) -> SceneError {
        match error {
            TablePlanError::Window(e) => SceneError::refused(&self.path, "window", e),
            TablePlanError::Rotations(e) => SceneError::refused(&self.path, "rotations", e),
            TablePlanError::Correlate(e) => SceneError::refused(&self.path, "window", e),
            TablePlanError::Memory { needed, limit } => {
                self.memory_error(CORRELATION, needed, limit)
            }
        }
    }

    pub(super) fn docking_error(&self, error: DockingError) -> SceneError {
        match error {
            DockingError::Cancelled => SceneError::Cancelled,
            DockingError::Build(e) => self.fields_error(e),
            DockingError::Energy(e) => SceneError::refused(&self.path, "energy", e),
            DockingError::Rotations(e) => SceneError::refused(&self.path, "rotations", e),
            DockingError::Window(e) => SceneError::refused(&self.path, "window", e),
            DockingError::Memory { needed, limit } => self.memory_error(CORRELATION, needed, limit),
            other => SceneError::refused(&self.path, "docking", other),
        }
    }

    pub(super) fn tolerance_error(&self, error: ToleranceError) -> SceneError {
        match error {
            ToleranceError::Cancelled => SceneError::Cancelled,
            ToleranceError::Missed {
                asked,
                reached,
                limit,
            } => SceneError::Tolerance {
                path: self.path.clone(),
                asked,
                reached,
                limit,
            },
            ToleranceError::Pair(e) => self.pair_error(e),
            ToleranceError::Plan(e) => self.design_error(e),
            ToleranceError::Table(e) => SceneError::refused(&self.path, "probing", e),
            ToleranceError::Direct(e) => SceneError::refused(&self.path, "", e),
            ToleranceError::Threads(e) => SceneError::refused(&self.path, "", e),
        }
    }
}
