//! Several fixed parts and one moving part: energies and wrenches added up.

use fft_correlate::{EnergySource, InScene, Placement, Pose, Response, Scratch};
use glam::DVec3;
use sdf_grid::Aabb;

use crate::scene::box_tree::BoxTree;
use crate::scene::shared::SharedSource;

/// One pair of a scene: its source and where the scene puts its shapes.
#[derive(Clone)]
pub struct Placed {
    /// Energy at poses of the shapes; `None` while it is not loaded.
    pub source: Option<SharedSource>,
    /// Where both shapes are in the scene.
    pub placement: Placement,
    /// Where the moving part's pivot must be, in the fixed shape's frame, for the pair to matter,
    /// metres. Outside, the source is not asked and counts as zero. `None`: everywhere.
    pub reach: Option<Aabb>,
}

/// The sum of several pairs. Pairs whose reach the moving part's pivot is not in are not looked at.
///
/// Among the pairs in reach the coverage is the greatest of those that are loaded, times the share
/// that is: a pair that is in reach and not loaded, in whole or in the part that matters, pulls it
/// below one and adds no force. Leaving a box where the pair's energy is not near zero makes a step
/// in the sum: make boxes as wide as the source's own domain.
#[derive(Clone)]
pub struct SumSource {
    pivot: DVec3,
    pairs: Vec<PlacedPair>,
    /// Over the pairs with a reach, by [`SumSource::bounded`].
    tree: BoxTree,
    bounded: Vec<usize>,
    unbounded: Vec<usize>,
}

/// A pair as it is asked.
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
    pub fn new(pivot: DVec3, pairs: Vec<Placed>) -> Self {
        let all = 0..pairs.len();
        let (bounded, unbounded): (Vec<_>, Vec<_>) = all.partition(|&i| pairs[i].reach.is_some());
        let boxes: Vec<Aabb> = bounded
            .iter()
            .filter_map(|&i| {
                pairs[i]
                    .reach
                    .map(|r| placed_box(&r, &pairs[i].placement.fixed))
            })
            .collect();
        let pairs = pairs.into_iter().map(PlacedPair::new);
        Self {
            pivot,
            pairs: pairs.collect(),
            tree: BoxTree::new(&boxes),
            bounded,
            unbounded,
        }
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
        let mut count = 0;
        self.visit(pose, |_, _| count += 1);
        count
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
        self.visit(pose, |i, pair| {
            in_reach += 1;
            if pair.is_there() && counts(i) {
                loaded += 1;
                add(&mut sum, &pair.answer(pose, &mut scratch.0[i]));
            }
        });
        if loaded < in_reach {
            sum.coverage *= f64::from(loaded) / f64::from(in_reach);
        }
        sum
    }

    /// Working memory for [`SumSource::respond`].
    pub(super) fn pair_scratches(&self) -> SumScratch {
        SumScratch(self.pairs.iter().map(PlacedPair::scratch).collect())
    }

    /// The pairs in reach, in the order of their boxes.
    pub(super) fn visit(&self, pose: &Pose, mut each: impl FnMut(usize, &PlacedPair)) {
        let point = pose.apply(self.pivot);
        for &index in &self.unbounded {
            each(index, &self.pairs[index]);
        }
        self.tree.visit(point, |k| {
            let index = self.bounded[k];
            let pair = &self.pairs[index];
            if pair.reaches(point) {
                each(index, pair);
            }
        });
    }
}

/// The box in the scene around a box of a part that `placement` puts there.
pub(crate) fn placed_box(reach: &Aabb, placement: &Pose) -> Aabb {
    let corner = |i: usize| {
        let pick = |axis: usize| {
            if i & (1 << axis) == 0 {
                reach.min[axis]
            } else {
                reach.max[axis]
            }
        };
        placement.apply(DVec3::new(pick(0), pick(1), pick(2)))
    };
    // Turning a point there and back may round it out of the box.
    let slack = 1e-12 * (1.0 + reach.diagonal() + placement.translation.length());
    Aabb::around((0..8).map(corner)).grown(slack)
}

pub(super) fn add(sum: &mut Response, part: &Response) {
    sum.energy += part.energy;
    sum.wrench += part.wrench;
    sum.coverage = sum.coverage.max(part.coverage);
}

impl PlacedPair {
    fn new(placed: Placed) -> Self {
        let Placed {
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

    pub(super) fn scratch(&self) -> Scratch {
        let source = self.source.as_ref();
        source.map(EnergySource::scratch).unwrap_or_default()
    }

    /// Whether there is a source.
    pub(super) fn is_there(&self) -> bool {
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

    /// In the scene's frame; nothing while it is not loaded.
    pub(super) fn answer(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
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
        let mut all = true;
        self.visit(pose, |i, pair| all &= pair.is_loaded(pose, &scratches[i]));
        all
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

    fn pairs(spring: &Arc<Spring>) -> Vec<Placed> {
        let shared = SharedSource::new(Arc::clone(spring) as Arc<dyn EnergySource>);
        let at = |x: f64, reach| Placed {
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
