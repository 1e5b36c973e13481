//! How densities are read between the nodes of their lattices.

use glam::DVec3;

/// How densities are read between the nodes of their lattices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interpolation {
    /// From eight nodes; passes through the values.
    Trilinear,
    /// By quadratic B-splines from 27 nodes: smooths by a quarter of a squared spacing per axis,
    /// everywhere alike.
    Quadratic,
}

/// Weights up to which [`Interpolation::reach_of_weight`] is told apart.
const SMALL: f64 = 0.01;

impl Interpolation {
    /// Distance per axis beyond which a node counts for nothing, cells.
    pub(crate) fn reach(self) -> f64 {
        match self {
            Self::Trilinear => 1.0,
            Self::Quadratic => 1.5,
        }
    }

    /// Distance in any direction beyond which a node counts by a weight of `least` at most, cells.
    pub(crate) fn reach_of_weight(self, least: f64) -> f64 {
        let Self::Quadratic = self else {
            return 3f64.sqrt() * self.reach();
        };
        // Of all places with one small weight the farthest lie along a diagonal of one, two or three
        // axes, the others in the middle. Near its end a spline is half the squared distance from it.
        let least = least.min(SMALL);
        let farthest = (1..=3).map(|axes: i32| {
            let axis = (least / 0.75f64.powi(3 - axes)).powf(1.0 / f64::from(axes));
            f64::from(axes).sqrt() * (1.5 - (2.0 * axis).sqrt())
        });
        farthest.fold(1.0, f64::max)
    }

    /// Nodes per axis that are read.
    pub(crate) fn nodes(self) -> usize {
        match self {
            Self::Trilinear => 2,
            Self::Quadratic => 3,
        }
    }

    /// The first of them along each axis, for a place given as a fractional index.
    pub(crate) fn first(self, at: DVec3) -> DVec3 {
        match self {
            Self::Trilinear => at.floor(),
            Self::Quadratic => (at + 0.5).floor() - 1.0,
        }
    }

    /// Weight of the `n`th of them for a place `f` cells beyond the first, and its slope.
    pub(crate) fn tap(self, f: f64, n: usize) -> (f64, f64) {
        match (self, n) {
            (Self::Trilinear, 0) => (1.0 - f, -1.0),
            (Self::Trilinear, _) => (f, 1.0),
            (Self::Quadratic, 1) => (0.75 - (f - 1.0).powi(2), -2.0 * (f - 1.0)),
            (Self::Quadratic, _) => {
                let rest = 1.5 - (f - n as f64).abs();
                (0.5 * rest * rest, rest * (n as f64 - f).signum())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    /// Weight of a node at a place relative to it.
    fn weight(interpolation: Interpolation, place: DVec3) -> f64 {
        let first = interpolation.first(place);
        let of = |a: usize| {
            let n = -first[a];
            let read = (0.0..interpolation.nodes() as f64).contains(&n);
            read.then(|| interpolation.tap(place[a] - first[a], n as usize).0)
        };
        (0..3).map(|a| of(a).unwrap_or(0.0)).product()
    }

    #[test]
    fn beyond_the_reach_of_a_weight_there_is_none_larger() {
        let mut rng = SmallRng::seed_from_u64(3);
        for least in [0.0, 1e-8, 1e-6, 1e-4, 1e-3, 1e-2, 0.2, 1.0] {
            for interpolation in [Interpolation::Trilinear, Interpolation::Quadratic] {
                let reach = interpolation.reach_of_weight(least);
                assert!((1.0..=3f64.sqrt() * interpolation.reach()).contains(&reach));
                for _ in 0..100_000 {
                    let mut c = || rng.random_range(-1.5..1.5);
                    let place = DVec3::new(c(), c(), c());
                    let found = weight(interpolation, place);
                    assert!(
                        place.length() <= reach || found <= least.max(1e-12) * (1.0 + 1e-9),
                        "{interpolation:?} {least}: {found} at {place}"
                    );
                }
            }
        }
    }
}
