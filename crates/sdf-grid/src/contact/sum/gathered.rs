//! Pieces of a surface taken together.

use glam::DVec3;

use crate::contact::samples::SurfaceSample;

/// Sums over the pieces of a point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Gathered {
    /// Places times areas.
    pub(super) moment: DVec3,
    pub(super) area: DVec3,
    pub(super) size: f64,
}

impl Gathered {
    pub(super) fn add(&mut self, piece: &SurfaceSample) {
        let size = piece.area.length();
        self.moment += piece.position * size;
        self.area += piece.area;
        self.size += size;
    }

    pub(super) fn sample(&self) -> Option<SurfaceSample> {
        (self.size > 0.0).then(|| SurfaceSample {
            position: self.moment / self.size,
            area: self.area,
        })
    }
}
