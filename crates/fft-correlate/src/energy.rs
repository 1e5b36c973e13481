//! What the haptic loop and every scorer ask: the energy and wrench at a pose.

use std::any::Any;

use crate::{Pose, Wrench};

/// Energy, its negative gradient, and how far the pose is covered by the source.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Response {
    /// `E = -gamma Re f`, joules (eq_6).
    pub energy: f64,
    /// Force and torque on the moving part, about its origin, fixed frame (eq_9a, eq_9b).
    pub wrench: Wrench,
    /// 1 inside the source's domain, falling smoothly to 0 outside, where the energy has gone to
    /// the source's far value and the wrench to zero. 0 ..= 1.
    pub coverage: f64,
}

/// Working memory of one thread for one source; made once, reused for every evaluation.
#[derive(Debug, Default)]
pub struct Scratch {
    /// Single-precision work space; its layout belongs to the source that made it.
    pub f32s: Vec<f32>,
    /// Work spaces of the members of a source that is made of several.
    pub nested: Vec<Scratch>,
    /// What one thread keeps of a source that changes while it is used; see
    /// [`EnergySource::refresh`].
    pub view: Option<Box<dyn Any + Send>>,
}

/// Anything that gives energy and wrench at a pose: a table, a direct evaluator, a sum of several.
///
/// The wrench is minus the gradient of the energy under [`Pose::perturbed`]. `evaluate` allocates
/// nothing, takes no lock, and returns finite numbers for every valid pose.
pub trait EnergySource: Send + Sync {
    /// Working memory for [`EnergySource::evaluate`], one per thread.
    fn scratch(&self) -> Scratch;

    /// Energy, wrench and coverage at `pose`.
    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response;

    /// Takes over what has changed in the source since the last call, and says by how much that
    /// changed the response at `pose` (new minus old); `None`, as always for a source that never
    /// changes, if nothing did. Between two calls `evaluate` is one function of the pose. Like
    /// `evaluate` it allocates nothing and takes no lock.
    fn refresh(&self, _pose: &Pose, _scratch: &mut Scratch) -> Option<Response> {
        None
    }

    /// Whether all that the response depends on, at `pose` and a little around it, is in memory.
    /// True for a source that is always whole. Where it is false the response may be that of a pose
    /// far away, without notice of where that begins. Like `evaluate` it allocates nothing and takes
    /// no lock.
    fn is_loaded(&self, _pose: &Pose, _scratch: &Scratch) -> bool {
        true
    }

    /// What the source interpolates or computes, as a number: two sources that exist at the same time
    /// and have the same one give the same response wherever both are loaded.
    fn field(&self) -> usize {
        std::ptr::from_ref(self).cast::<()>() as usize
    }
}
