//! The contact sum of two parts.

use std::borrow::Cow;
use std::mem::MaybeUninit;

use fearless_simd::prelude::*;
use fearless_simd::{Level, f32x16};
use fearless_simd_macros::simd;
use glam::{DMat3, DQuat, DVec3};

use super::kernel::REACH;
use super::lookup::{Ball, Clusters, DistanceBound};
use super::patch_integral::{PlacedCluster, sum_cluster};
use super::patches::{PatchList, VisiblePatches};
use super::regions::Regions;
use super::sampling::sample_surface;
use crate::contact::error::ContactError;
use crate::contact::samples::FLAT;
use crate::dispatch_lanes;
use crate::mesh::aabb::Aabb;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::support::level;
use crate::surface::bvh::build::Leaves;
use crate::surface::bvh::tree::Bvh;
use crate::surface::coplanar::pieces::EXACT;

/// The sum over both surfaces of two parts, `∬ (n1·n2) g(|q - y|) dA1 dA2`, at any pose of one part
/// in the frame of the other.
///
/// ```
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{ContactSum, shapes};
///
/// let cube = shapes::cuboid(DVec3::splat(0.01))?;
/// let sum = ContactSum::new(&cube, &cube, 0.0005, 0.001)?;
/// // Face to face the normals oppose each other: negative, cubic metres.
/// let at = |x| sum.sum(DQuat::IDENTITY, DVec3::new(x, 0.0, 0.0)).value;
/// assert!(at(0.01) < 0.0 && at(0.0) > 0.0);
/// // Beyond its reach there is nothing.
/// assert_eq!(at(0.011 + sum.reach()), 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ContactSum {
    pub(super) visible: VisiblePatches,
    distance_bound: DistanceBound,
    clusters: Clusters,
    /// Metres.
    reach: f64,
    level: Level,
}

/// A contact sum and its derivatives, for densities that jump by one across both surfaces.
///
/// See the example of [`ContactSum`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactSums {
    /// The sum, cubic metres.
    pub value: f64,
    /// Its derivative by the translation, square metres.
    pub gradient: DVec3,
    /// Its derivative by a rotation of the sampled part about the origin of its own frame, along
    /// the axes of the surface's frame; cubic metres per radian.
    pub moment: DVec3,
}

impl ContactSum {
    /// Prepares the sum over samples of `sampled`, about `distance` wide, of the kernel's integral
    /// over `surface`, for densities that are smoothed together by a Gaussian of standard deviation
    /// `width` (both metres).
    ///
    /// # Errors
    /// If a length is not positive and finite, a mesh has no triangle with an area, or there would
    /// be too many pieces.
    pub fn new(
        surface: &TriangleMesh,
        sampled: &TriangleMesh,
        width: f64,
        distance: f64,
    ) -> Result<Self, ContactError> {
        if !(width.is_finite() && width > 0.0) {
            return Err(ContactError::Width { found: width });
        }
        let reach = REACH * width;
        let flat = |mesh: &TriangleMesh| FLAT * mesh.bounds().size().max_element();
        let mut samples = sample_surface(sampled, flat(sampled), distance, reach)?;
        let clusters = Clusters::new(&mut samples, reach);
        let bvh = Bvh::merged(surface, EXACT, Leaves::Small);
        let regions = Regions::new(surface, flat(surface), reach)?;
        Ok(Self {
            visible: VisiblePatches::new(surface, regions, [reach, clusters.radius]),
            distance_bound: DistanceBound::new(surface, &bvh, reach),
            clusters,
            reach,
            level: level::native(),
        })
    }

    /// The same, of which at most about so many bytes are kept of what poses come to (1 GiB unless this
    /// is called): what is beyond is listed anew each time, many times slower.
    pub fn keeping(mut self, bytes: u64) -> Self {
        self.visible.most_kept = usize::try_from(bytes).unwrap_or(usize::MAX);
        self
    }

    /// Looks ahead at what lies near a box of the surface's frame (metres), or near the whole surface:
    /// at poses at which the sampled part lies in the box, [`ContactSum::sum`] then allocates nothing.
    /// Sums are the same to the last bit.
    pub fn prepare(&self, region: Option<&Aabb>) {
        self.visible.prepare(region);
    }

    /// Number of samples of the sampled part, and of clusters of up to sixteen of them.
    pub fn samples(&self) -> [usize; 2] {
        let clusters = &self.clusters.clusters;
        let full = clusters.iter().flat_map(|c| c.area).filter(|a| *a > 0.0);
        [full.count(), clusters.len()]
    }

    /// Distance between the surfaces beyond which the sum is zero, metres.
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Memory that is held, bytes: more as poses come to new places.
    pub fn bytes(&self) -> usize {
        self.visible.bytes() + self.distance_bound.bytes() + self.clusters.bytes()
    }

    /// The sum where `y` of the sampled part's frame lies at `rotation * y + translation` of the
    /// surface's frame, and its exact derivatives. What is visible from a place is listed when the first
    /// pose comes there, and kept.
    pub fn sum(&self, rotation: DQuat, translation: DVec3) -> ContactSums {
        dispatch_lanes!(self.level, simd => sum_clusters(simd, self, DMat3::from_quat(rotation), translation))
    }
}

/// A cluster that may be in reach.
struct ReachableCluster<'a> {
    placed: PlacedCluster<'a>,
    visible: Cow<'a, PatchList>,
    /// Of its centre from the origin of its part, metres, in the surface's frame.
    lever: DVec3,
}

/// The clusters that may be in reach.
struct ReachableClusters<'a> {
    sum: &'a ContactSum,
    turn: DMat3,
    translation: DVec3,
    /// The ball to look at.
    next: usize,
}

impl<'a> ReachableClusters<'a> {
    /// The next one, whose patches are on their way.
    #[inline(always)]
    fn next(&mut self) -> Option<ReachableCluster<'a>> {
        let sum = self.sum;
        while let Some(ball) = sum.clusters.balls.get(self.next) {
            let lever = self.turn * ball.centre;
            let centre = lever + self.translation;
            if sum.distance_bound.lower_bound(centre) >= sum.reach + ball.radius {
                self.next = ball.next as usize;
                continue;
            }
            self.next += 1;
            if ball.cluster == Ball::MANY {
                continue;
            }
            let Some((visible, at)) = sum.visible.look_up(centre) else {
                continue;
            };
            let placed = PlacedCluster {
                cluster: &sum.clusters.clusters[ball.cluster as usize],
                turn: self.turn.as_mat3(),
                at,
                radius: ball.in_reaches,
            };
            return Some(ReachableCluster {
                placed,
                visible,
                lever,
            });
        }
        None
    }
}

#[simd]
fn sum_clusters<S: Simd>(
    simd: S,
    sum: &ContactSum,
    turn: DMat3,
    translation: DVec3,
) -> ContactSums {
    // What does not fit into registers is kept on the stack, which is aligned for this only: a
    // vector that crosses a cache line costs two accesses.
    std::hint::black_box(&mut MaybeUninit::<f32x16<S>>::uninit());
    let mut in_reach = ReachableClusters {
        sum,
        turn,
        translation,
        next: 0,
    };
    let reach = sum.reach;
    let mut sums = ContactSums::default();
    let mut found = in_reach.next();
    while let Some(ReachableCluster {
        placed,
        visible,
        lever,
    }) = found
    {
        found = in_reach.next();
        let part = sum_cluster(simd, &visible, &placed);
        let square = reach * reach;
        let gradient = part.gradient.as_dvec3() * square;
        let moment = part.moment.as_dvec3() * (square * reach);
        sums.value += f64::from(part.value) * (square * reach);
        sums.gradient += gradient;
        sums.moment += moment + lever.cross(gradient);
    }
    sums
}
