//! A surface prepared for packets.

use super::cluster::Cluster;
use super::distance::PacketDistance;
use super::groups::{self, Group, WIDTH};
use super::kernel::PacketKernel;
use super::settings::Settings;
use super::twins::{self, Twin};
use crate::field::kernel::CumulativeKernel;
use crate::surface::bvh::tree::Bvh;

/// All that the walk for the density of a packet looks at.
pub(crate) struct PacketTree<'a> {
    pub(crate) bvh: &'a Bvh,
    pub(crate) distance: PacketDistance<'a>,
    pub(crate) groups: Vec<Group>,
    /// Far fields of the members of every group.
    pub(crate) clusters: Vec<[Cluster; WIDTH]>,
    pub(crate) twins: Vec<[Twin; 4]>,
    pub(crate) kernel: PacketKernel,
    pub(crate) settings: Settings,
    /// Whether all this is more than the nearest caches hold.
    pub(crate) is_large: bool,
}

/// Faces of which, and of whose tree, the nearest caches hold no more: about two megabytes.
const MANY: usize = 3000;

impl<'a> PacketTree<'a> {
    /// Prepares for a relative L2 error of `tolerance`.
    pub(crate) fn new(bvh: &'a Bvh, table: &CumulativeKernel, tolerance: f64) -> Self {
        let settings = Settings::new(tolerance, table.kernel().sigma());
        let near = || (twins::twins(&bvh.faces), PacketDistance::new(bvh));
        // Side by side: both have parts that one thread does.
        let far = || groups::groups(bvh);
        let ((groups, clusters), (twins, distance)) = rayon::join(far, near);
        Self {
            bvh,
            distance,
            clusters,
            groups,
            twins,
            kernel: PacketKernel::new(table, &settings, tolerance),
            settings,
            is_large: bvh.faces.len() > MANY,
        }
    }
}
