//! Where slopes of an energy lead where it has edges.

use std::collections::VecDeque;

use crate::geometry::se3::Pose;

/// Slopes that are remembered.
const MANY: usize = 24;

/// Steps towards the shortest mean of slopes.
const STEPS: usize = 1000;

/// Turn about the pivot times the radius, then displacement of the pivot, metres; or a slope along
/// these.
pub(super) type Vec6 = [f64; 6];

pub(super) fn dot(a: &Vec6, b: &Vec6) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The last slopes that were met.
#[derive(Default)]
pub(super) struct Slopes(VecDeque<(Pose, Vec6)>);

impl Slopes {
    pub(super) fn push(&mut self, at: Pose, slope: Vec6) {
        if self.0.len() == MANY {
            self.0.pop_front();
        }
        self.0.push_back((at, slope));
    }

    /// The shortest vector in the convex hull of those that are near, by moving weight from the one
    /// that is farthest ahead to the one farthest behind (Mitchell, Demyanov and Malozemov 1974).
    pub(super) fn shortest(&self, near: impl Fn(&Pose) -> bool) -> Vec6 {
        let near = self.0.iter().filter(|(p, _)| near(p));
        let slopes: Vec<&Vec6> = near.map(|(_, s)| s).collect();
        let Some((last, before)) = slopes.split_last() else {
            return [0.0; 6];
        };
        let mut weights = vec![0.0; before.len()];
        weights.push(1.0);
        let mut mean = **last;
        let mut along = vec![0.0; slopes.len()];
        for _ in 0..STEPS {
            for (a, s) in along.iter_mut().zip(&slopes) {
                *a = dot(s, &mean);
            }
            let by = |a: &usize, b: &usize| along[*a].total_cmp(&along[*b]);
            let held = (0..slopes.len()).filter(|i| weights[*i] > 0.0);
            let ends = [(0..slopes.len()).min_by(by), held.max_by(by)];
            let [Some(behind), Some(ahead)] = ends else {
                break;
            };
            let change: Vec6 = std::array::from_fn(|i| slopes[behind][i] - slopes[ahead][i]);
            let gain = along[ahead] - along[behind];
            if gain <= 1e-6 * dot(&mean, &mean) {
                break;
            }
            let share = (gain / dot(&change, &change)).min(weights[ahead]);
            weights[ahead] -= share;
            weights[behind] += share;
            mean = std::array::from_fn(|i| mean[i] + share * change[i]);
        }
        mean
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shortest(slopes: &[[f64; 3]]) -> [f64; 3] {
        let mut met = Slopes::default();
        for [x, y, z] in slopes {
            met.push(Pose::IDENTITY, [0.0, *x, 0.0, *y, 0.0, *z]);
        }
        let [_, x, _, y, _, z] = met.shortest(|_| true);
        [x, y, z]
    }

    /// Against what is plain to see: of two, of four walls, and of some that hold one another.
    #[test]
    fn the_shortest_mean_is_found() {
        let near = |a: [f64; 3], b: [f64; 3]| {
            let off: f64 = a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum();
            off.sqrt() < 1e-3
        };
        assert!(near(shortest(&[[3.0, 4.0, 0.0]]), [3.0, 4.0, 0.0]));
        assert!(near(
            shortest(&[[1.0, 2.0, 0.0], [-1.0, 2.0, 0.0]]),
            [0.0, 2.0, 0.0]
        ));
        assert!(near(
            shortest(&[[1.0, 2.0, 0.0], [2.0, 4.0, 0.0]]),
            [1.0, 2.0, 0.0]
        ));
        let walls = [[30.0, 20.0], [-30.0, 20.0], [30.0, -20.0], [-30.0, -20.0]];
        let floor = walls.map(|[x, y]| [x, y, 0.01]);
        assert!(
            near(shortest(&floor), [0.0, 0.0, 0.01]),
            "{:?}",
            shortest(&floor)
        );
        let held = [
            [30.0, 20.0, -1.0],
            [-30.0, 20.0, 2.0],
            [0.0, -50.0, 0.5],
            [1.0, 0.0, -3.0],
        ];
        assert!(near(shortest(&held), [0.0; 3]), "{:?}", shortest(&held));
        assert_eq!(shortest(&[]), [0.0; 3]);
    }

    #[test]
    fn the_oldest_are_forgotten_and_the_far_left_out() {
        let mut met = Slopes::default();
        met.push(Pose::IDENTITY, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        for _ in 0..MANY {
            met.push(Pose::IDENTITY, [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
        assert_eq!(met.0.len(), MANY);
        assert_eq!(met.shortest(|_| true)[0], 2.0);
        assert_eq!(met.shortest(|_| false), [0.0; 6]);
    }
}
