//! Several fixed parts and one moving part: energies and wrenches added up.

use std::sync::Arc;

use fft_correlate::{EnergySource, Pose, Response, Scratch, Wrench};
use glam::DVec3;

/// One pair of a scene: a fixed part's source and where the fixed part stands.
#[derive(Clone)]
pub struct Placed {
    /// Energy of the moving part in the fixed part's frame.
    pub source: Arc<dyn EnergySource>,
    /// Pose of the fixed part in the scene.
    pub placement: Pose,
    /// Where the moving part's origin must be, in the fixed part's frame, for the pair to matter:
    /// least and greatest corner of a box, metres. Outside, the source is not asked and counts as
    /// not covering. `None`: everywhere.
    pub reach: Option<(DVec3, DVec3)>,
}

/// The sum of several pairs. A pair whose reach the moving part is not in costs one box test.
///
/// The coverage is the greatest of the pairs': the sum is known where any pair is. Leaving a box
/// where the pair's energy is not near zero makes a step in the sum: make boxes as wide as the
/// source's own domain.
#[derive(Clone)]
pub struct SumSource {
    pairs: Vec<Pair>,
}

#[derive(Clone)]
struct Pair {
    placed: Placed,
    /// Scene to fixed part.
    inverse: Pose,
}

impl SumSource {
    /// The sum of `pairs`; none give zero everywhere.
    pub fn new(pairs: Vec<Placed>) -> Self {
        let pairs = pairs.into_iter().map(|placed| Pair {
            inverse: placed.placement.inverse(),
            placed,
        });
        Self {
            pairs: pairs.collect(),
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

    /// How many pairs are asked at `pose`.
    pub fn in_reach(&self, pose: &Pose) -> usize {
        self.pairs.iter().filter(|p| p.reaches(pose)).count()
    }
}

impl Pair {
    fn reaches(&self, pose: &Pose) -> bool {
        let Some((least, greatest)) = self.placed.reach else {
            return true;
        };
        let at = self.inverse.apply(pose.translation);
        at.cmpge(least).all() && at.cmple(greatest).all()
    }
}

impl EnergySource for SumSource {
    fn scratch(&self) -> Scratch {
        let nested = self.pairs.iter().map(|p| p.placed.source.scratch());
        Scratch {
            nested: nested.collect(),
            ..Scratch::default()
        }
    }

    fn evaluate(&self, pose: &Pose, scratch: &mut Scratch) -> Response {
        let mut sum = Response::default();
        for (pair, scratch) in self.pairs.iter().zip(&mut scratch.nested) {
            if !pair.reaches(pose) {
                continue;
            }
            let part = pair
                .placed
                .source
                .evaluate(&(pair.inverse * *pose), scratch);
            // Both torques are about the moving part's origin: only the axes turn.
            let turn = pair.placed.placement.rotation;
            sum.energy += part.energy;
            sum.wrench += Wrench {
                torque: turn * part.wrench.torque,
                force: turn * part.wrench.force,
            };
            sum.coverage = sum.coverage.max(part.coverage);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fft_correlate::Twist;
    use glam::DQuat;
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

    fn scene() -> (Arc<Spring>, SumSource) {
        let spring = Arc::new(Spring::default());
        let at = |x: f64, reach| Placed {
            source: Arc::clone(&spring) as Arc<dyn EnergySource>,
            placement: Pose::new(DQuat::from_rotation_z(x), DVec3::new(x, 0.2, 0.0)),
            reach,
        };
        let near = Some((DVec3::splat(-0.5), DVec3::splat(0.5)));
        let mut pairs = vec![at(0.1, None), at(0.3, near)];
        pairs.extend((0..62).map(|k| at(10.0 + f64::from(k), near)));
        (Arc::clone(&spring), SumSource::new(pairs))
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
        assert!(SumSource::new(Vec::new()).is_empty());
    }
}
