//! What a packet asks of all faces and clusters.

use fearless_simd::{f32x16, mask32x16, prelude::*};

use super::tree::PacketTree;

/// What all faces share for one packet: distances and what follows from them.
pub(crate) struct Query<S: Simd> {
    /// Distances; zero in lanes to leave out.
    pub(crate) xi: f32x16<S>,
    /// Which lanes count.
    pub(crate) counts: mask32x16<S>,
    /// `1 / xi`.
    pub(crate) inverse: f32x16<S>,
    /// The square of the distance within which boundary points count.
    pub(crate) reach_squared: f32x16<S>,
    /// Gauss points per half length in units of `xi`.
    pub(crate) density: f32,
}

/// The kernel varies over `sqrt(sigma)` along an edge, and whatever sigma over about this to the
/// power of -1/2, in units of the distance.
const BROAD: f32 = 3.0;

impl<S: Simd> Query<S> {
    #[inline(always)]
    pub(crate) fn new(tree: &PacketTree<'_>, xi: f32x16<S>) -> Self {
        let kernel = &tree.kernel;
        let reach = xi * (1.0 + kernel.reach * kernel.sigma);
        Self {
            xi,
            counts: xi.simd_gt(0.0),
            inverse: 1.0 / xi.max(1e-12),
            reach_squared: reach * reach,
            density: tree.settings.density as f32 * (1.0 / kernel.sigma + BROAD).sqrt(),
        }
    }
}
