//! Several fixed parts and one moving part: energies and wrenches added up.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use fft_correlate::{EnergySource, InScene, Placement, Pose, Response, Scratch};
use glam::DVec3;
use sdf_grid::Aabb;

/// One pair of a scene: its source and where the scene puts its shapes.
///
/// See the example of [`SumSource`].
#[derive(Clone)]
pub struct PlacedSource {
    /// Energy at poses of the shapes; `None` while it is not loaded.
    pub source: Option<SharedSource>,
    /// Where both shapes are in the scene.
    pub placement: Placement,
    /// Where the moving part's pivot must be, in the fixed shape's frame, for the pair to matter,
    /// metres. Outside, the source is not asked and counts as zero. `None`: everywhere.
    pub reach: Option<Aabb>,
}

/// The sum of several pairs. Pairs are skipped while the moving part's pivot is outside their
/// reach.
///
/// Among the pairs in reach the coverage is the greatest of those that are loaded, times the share
/// that is: a pair that is in reach and not loaded, in whole or in the part that matters, pulls it
/// below one and adds no force. Leaving a box where the pair's energy is not near zero makes a step
/// in the sum: make boxes as wide as the source's own domain.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::{Placement, Pose};
/// use glam::DVec3;
/// use haptic::{PlacedSource, SharedSource, SumSource};
/// use sdf_grid::Aabb;
///
/// // Two pairs with one source: the first matters everywhere, the second within 1 cm.
/// let source = SharedSource::new(Arc::new(SumSource::new(DVec3::ZERO, vec![])));
/// let pair = |reach| PlacedSource {
///     source: Some(source.clone()),
///     placement: Placement::IDENTITY,
///     reach,
/// };
/// let near = Aabb::around([DVec3::ZERO]).grown(0.01);
/// let sum = SumSource::new(DVec3::ZERO, vec![pair(None), pair(Some(near))]);
/// let in_reach = |z| sum.in_reach(&Pose::from_translation(DVec3::Z * z));
/// assert_eq!((in_reach(0.0), in_reach(0.02)), (2, 1));
/// ```
#[derive(Clone)]
pub struct SumSource {
    pivot: DVec3,
    pairs: Vec<PlacedPair>,
}

/// A pair ready for evaluation.
#[derive(Clone)]
pub(super) struct PlacedPair {
    source: Option<InScene<SharedSource>>,
    placement: Placement,
    reach: Option<Aabb>,
    /// Scene to fixed shape.
    inverse: Pose,
}

/// Working memory of the pairs, in their order.
pub(super) struct SumScratch(pub(super) Vec<Scratch>);

impl SumSource {
    /// The sum of `pairs`; none give zero everywhere. `pivot` is the point of the moving part, as
    /// placed (metres, what poses move), that reaches speak of.
    pub fn new(pivot: DVec3, pairs: Vec<PlacedSource>) -> Self {
        let pairs = pairs.into_iter().map(PlacedPair::new).collect();
        Self { pivot, pairs }
    }

    /// Pairs in the sum.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// In the order in which they were given.
    pub(super) fn pairs(&self) -> &[PlacedPair] {
        &self.pairs
    }

    /// How many pairs are in reach at `pose`.
    pub fn in_reach(&self, pose: &Pose) -> usize {
        self.reached(pose).count()
    }

    /// The sum over the pairs in reach for which `counts` holds; the others count as not loaded.
    pub(super) fn respond(
        &self,
        pose: &Pose,
        scratch: &mut SumScratch,
        counts: impl Fn(usize) -> bool,
    ) -> Response {
        let mut sum = Response::default();
        let (mut in_reach, mut loaded) = (0u32, 0u32);
        for (i, pair) in self.reached(pose) {
            in_reach += 1;
            if pair.has_source() && counts(i) {
                loaded += 1;
                add(&mut sum, &pair.evaluate(pose, &mut scratch.0[i]));
            }
        }
        if loaded < in_reach {
            sum.coverage *= f64::from(loaded) / f64::from(in_reach);
        }
        sum
    }

    /// Working memory for [`SumSource::respond`].
    pub(super) fn pair_scratches(&self) -> SumScratch {
        SumScratch(self.pairs.iter().map(PlacedPair::scratch).collect())
    }

    /// The pairs in reach with their indices, in the order in which they were given.
    pub(super) fn reached(&self, pose: &Pose) -> impl Iterator<Item = (usize, &PlacedPair)> {
        let pivot = pose.apply(self.pivot);
        let pairs = self.pairs.iter().enumerate();
        pairs.filter(move |(_, pair)| pair.reaches(pivot))
    }
}

pub(super) fn add(sum: &mut Response, part: &Response) {
    sum.energy += part.energy;
    sum.wrench += part.wrench;
    sum.coverage = sum.coverage.max(part.coverage);
}

impl PlacedPair {
    fn new(placed: PlacedSource) -> Self {
        let PlacedSource {
            source,
            placement,
            reach,
        } = placed;
        Self {
            source: source.map(|source| InScene::new(source, placement)),
            placement,
            reach,
            inverse: placement.fixed.inverse(),
        }
    }

    fn reaches(&self, pivot: DVec3) -> bool {
        let reach = self.reach;
        reach.is_none_or(|r| r.contains(self.inverse.apply(pivot)))
    }

    fn scratch(&self) -> Scratch {
        let source = self.source.as_ref();
        source.map(EnergySource::scratch).unwrap_or_default()
    }

    pub(super) fn has_source(&self) -> bool {
        self.source.is_some()
    }

    /// Whether there is a source, and all of it that matters at `pose` is in memory.
    pub(super) fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let source = self.source.as_ref();
        source.is_some_and(|s| s.is_loaded(pose, scratch))
    }

    /// Whether both are the same source at the same place, whatever of it is in memory.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        match (&self.source, &other.source) {
            (Some(a), Some(b)) => {
                a.source().id() == b.source().id()
                    && self.placement == other.placement
                    && self.reach == other.reach
            }
            (None, None) => true,
            _ => false,
        }
    }

    /// The pair's response, scene frame; zero while it is not loaded.
    pub(super) fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        match &self.source {
            Some(source) => source.evaluate(pose, scratch),
            None => Response::default(),
        }
    }
}

impl EnergySource for SumSource {
    fn scratch(&self) -> Scratch {
        Scratch::new(self.pair_scratches())
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        self.respond(pose, scratch.get_mut(), |_| true)
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        let SumScratch(scratches) = scratch.get();
        self.reached(pose)
            .all(|(i, pair)| pair.is_loaded(pose, &scratches[i]))
    }
}

/// The number of a source, given once while the program runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct SourceId(u64);

impl SourceId {
    pub(crate) fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        // 2^64 sources are more than any run loads.
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// An energy source that several pairs, or successive sums, may share.
///
/// Clones are the same source. Two that were made by [`SharedSource::new`] are two, even if the
/// second one comes to lie where the first one was in memory.
///
/// See the example of [`SumSource`].
#[derive(Clone)]
pub struct SharedSource {
    id: SourceId,
    source: Arc<dyn EnergySource>,
}

impl SharedSource {
    /// A source that was not there before.
    pub fn new(source: Arc<dyn EnergySource>) -> Self {
        Self {
            id: SourceId::new(),
            source,
        }
    }

    /// The same source with another part of it in memory: `source` must give what this one gives
    /// wherever both are [loaded](EnergySource::is_loaded).
    #[must_use]
    pub fn with_part(&self, source: Arc<dyn EnergySource>) -> Self {
        Self {
            id: self.id,
            source,
        }
    }

    pub(crate) fn id(&self) -> SourceId {
        self.id
    }

    /// Its address.
    #[cfg(test)]
    pub(crate) fn place(&self) -> usize {
        Arc::as_ptr(&self.source).addr()
    }
}

impl EnergySource for SharedSource {
    fn scratch(&self) -> Scratch {
        self.source.scratch()
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        self.source.evaluate(pose, scratch)
    }

    fn refresh(&self, pose: &Pose, scratch: &mut Scratch) -> Option<Response> {
        self.source.refresh(pose, scratch)
    }

    fn is_loaded(&self, pose: &Pose, scratch: &Scratch) -> bool {
        self.source.is_loaded(pose, scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fft_correlate::{Twist, Wrench};
    use glam::DQuat;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// `E = |p|² + p·q(x axis) `, turning with its frame; counts how often it is asked.
    #[derive(Default)]
    struct Spring(AtomicU32);

    impl EnergySource for Spring {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            self.0.fetch_add(1, Ordering::Relaxed);
            let (p, axis) = (pose.translation, pose.rotation * DVec3::X);
            Response {
                energy: p.length_squared() + p.dot(axis),
                wrench: Wrench {
                    torque: -axis.cross(p),
                    force: -2.0 * p - axis,
                },
                coverage: 0.5,
            }
        }
    }

    const MOVING: Pose = Pose {
        rotation: DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8),
        translation: DVec3::new(0.01, 0.02, -0.03),
    };

    const PIVOT: DVec3 = DVec3::new(0.01, -0.02, 0.03);

    fn pairs(spring: &Arc<Spring>) -> Vec<PlacedSource> {
        let shared = SharedSource::new(Arc::clone(spring) as Arc<dyn EnergySource>);
        let at = |x: f64, reach| PlacedSource {
            source: Some(shared.clone()),
            placement: Placement {
                fixed: Pose::new(DQuat::from_rotation_z(x), DVec3::new(x, 0.2, 0.0)),
                moving: MOVING,
            },
            reach,
        };
        let near = Some(Aabb {
            min: DVec3::splat(-0.5),
            max: DVec3::splat(0.5),
        });
        let mut pairs = vec![at(0.1, None), at(0.3, near)];
        pairs.extend((0..62).map(|k| at(10.0 + f64::from(k), near)));
        pairs
    }

    fn scene() -> (Arc<Spring>, SumSource) {
        let spring = Arc::new(Spring::default());
        let pairs = pairs(&spring);
        (spring, SumSource::new(PIVOT, pairs))
    }

    #[test]
    fn the_wrench_is_minus_the_gradient_of_the_sum() {
        let (_, sum) = scene();
        let mut scratch = sum.scratch();
        let pose = Pose::new(DQuat::from_rotation_x(0.6), DVec3::new(0.1, 0.05, -0.2));
        let wrench = sum.evaluate(&pose, &mut scratch).wrench;
        let h = 1e-5;
        for k in 0..6 {
            let mut v = [0.0; 6];
            v[k] = h;
            let step = Twist {
                angular: DVec3::new(v[0], v[1], v[2]),
                linear: DVec3::new(v[3], v[4], v[5]),
            };
            let mut at = |t: &Twist| sum.evaluate(&pose.perturbed(t), &mut scratch).energy;
            let slope = (at(&step) - at(&(-step))) / (2.0 * h);
            // Central differences of order h²; numbers of order one.
            assert!(
                (slope + wrench.dot(&(step * (1.0 / h)))).abs() < 1e-8,
                "{k}"
            );
        }
    }

    #[test]
    fn pairs_out_of_reach_are_not_asked() {
        let (spring, sum) = scene();
        let mut scratch = sum.scratch();
        let here = Pose::from_translation(DVec3::new(0.2, 0.2, 0.0));
        assert_eq!((sum.len(), sum.in_reach(&here)), (64, 2));
        let response = sum.evaluate(&here, &mut scratch);
        assert_eq!(spring.0.load(Ordering::Relaxed), 2);
        assert_eq!(response.coverage, 0.5);
        assert!(SumSource::new(PIVOT, Vec::new()).is_empty());
    }
}
