//! The two parts, limits and step that all stages of a search share.

use fft_correlate::Pose;

use crate::collision::checker::{CollisionChecker, ContactLimits};
use crate::search::exit::{Exit, ExitDistance};
use crate::search::visited::DuplicateFilter;

/// What paths are searched, shortened and smoothed in.
#[derive(Clone, Copy)]
pub(crate) struct SearchSpace<'a> {
    pub(crate) checker: &'a CollisionChecker,
    pub(crate) exits: &'a ExitDistance,
    pub(crate) duplicates: &'a DuplicateFilter,
    pub(crate) limits: ContactLimits,
    /// Largest motion of any point between two poses that are checked, metres.
    pub(crate) step: f64,
    pub(crate) stop: &'a (dyn Fn() -> bool + Sync),
}

impl SearchSpace<'_> {
    /// The shortest translation that takes the part from a pose out of the fixed part's extent.
    pub(crate) fn exit(&self, pose: &Pose) -> Exit {
        self.exits.exit(self.checker, pose)
    }

    /// The same space, in which overlaps up to `level` metres are allowed.
    pub(crate) fn at_level(&self, level: f64) -> Self {
        let tolerance = self.limits.tolerance;
        Self {
            limits: ContactLimits { level, tolerance },
            ..*self
        }
    }
}

/// Two parts prepared for tests.
#[cfg(test)]
pub(crate) mod testing {
    use std::sync::Arc;

    use sdf_grid::TriangleMesh;

    use super::*;
    use crate::collision::body::Body;

    pub(crate) struct Pair {
        pub(crate) checker: CollisionChecker,
        exits: ExitDistance,
        duplicates: DuplicateFilter,
    }

    impl Pair {
        /// The fixed part at `place`, the moving one in its own frame.
        pub(crate) fn new(parts: (TriangleMesh, TriangleMesh), place: &Pose, spacing: f64) -> Self {
            let fixed = parts.0.transformed(place.rotation, place.translation);
            let [fixed, moving] = [fixed, parts.1].map(|mesh| Body::of_mesh(Arc::new(mesh)));
            let checker = CollisionChecker::new(fixed, moving, spacing);
            Self {
                exits: ExitDistance::new(&checker),
                duplicates: DuplicateFilter::new(&checker),
                checker,
            }
        }

        /// Overlaps up to `level` metres, which is the tolerance too, are allowed.
        pub(crate) fn space(&self, level: f64, step: f64) -> SearchSpace<'_> {
            SearchSpace {
                checker: &self.checker,
                exits: &self.exits,
                duplicates: &self.duplicates,
                limits: ContactLimits {
                    level,
                    tolerance: level,
                },
                step,
                stop: &|| false,
            }
        }
    }
}
