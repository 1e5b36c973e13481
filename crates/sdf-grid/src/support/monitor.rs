//! How a long computation reports progress and learns that it should stop.

/// Receives progress from a long computation and may ask it to stop.
///
/// Implementations are called from many threads; `advance` is called at most a few thousand times
/// per computation, never in an inner loop.
///
/// ```
/// use std::sync::atomic::{AtomicU64, Ordering};
///
/// use glam::DVec3;
/// use sdf_grid::*;
///
/// #[derive(Default)]
/// struct Steps(AtomicU64);
///
/// impl Monitor for Steps {
///     fn advance(&self, steps: u64) {
///         self.0.fetch_add(steps, Ordering::Relaxed);
///     }
/// }
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let lattice = Lattice::covering(&cube.bounds(), 0.002, 0.002)?;
/// let (kernel, steps) = (DensityKernel::new(0.2)?, Steps::default());
/// DensityField::compute(&cube, &kernel, &lattice, &DensityOptions::default(), &steps)?;
/// assert!(steps.0.into_inner() > 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Monitor: Sync {
    /// `steps` more units of work are finished, out of the `total` announced by [`Monitor::begin`].
    fn advance(&self, steps: u64) {
        let _ = steps;
    }

    /// A stage named `stage` of `total` units begins.
    fn begin(&self, stage: &str, total: u64) {
        let _ = (stage, total);
    }

    /// True once the caller wants the computation to end early. Checked between units of work;
    /// the computation then returns its `Cancelled` error and leaves finished results in place.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Reports nothing and never cancels.
///
/// See the example of [`DensityField`](crate::DensityField).
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Monitor for Silent {}
