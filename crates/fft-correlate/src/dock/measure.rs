//! What is told about a docked pose: how wide its well is, how much the parts overlap.

use glam::DVec3;

use crate::{EnergySource, Pair, Pose, Scratch};

/// How far from `pose`, along the axis of the fixed frame on which the energy rises fastest, it
/// rises to half, metres, without rotation; none if it does not within `reach`. Resolved to a
/// hundredth of the reach.
pub(super) fn half_width(
    source: &dyn EnergySource,
    scratch: &mut Scratch,
    pose: &Pose,
    energy: f64,
    reach: f64,
) -> Option<f64> {
    const STEPS: usize = 100;
    let directions = [DVec3::X, DVec3::Y, DVec3::Z];
    (1..=STEPS)
        .map(|i| reach * i as f64 / STEPS as f64)
        .find(|&s| {
            directions.iter().any(|d| {
                [s, -s].into_iter().any(|s| {
                    let moved = Pose {
                        translation: pose.translation + *d * s,
                        ..*pose
                    };
                    source.evaluate(&moved, scratch).energy >= 0.5 * energy
                })
            })
        })
}

/// Share of the moving part's inside that lies inside the fixed part, 0 ..= 1, counted at nodes:
/// those deeper than half a cell in the moving part, and of them those deeper than half a cell in
/// the fixed part. Faces in contact thus do not count.
pub(super) fn overlap(pair: &Pair, pose: &Pose) -> f64 {
    let (moving, fixed) = (pair.moving(), pair.fixed());
    let deep = -0.5 * pair.spacing() as f32;
    let (mut inside, mut both) = (0u64, 0u64);
    for ((i, j, k), d) in moving.signed_distance.indexed_iter() {
        if *d > deep {
            continue;
        }
        inside += 1;
        let place = pose.apply(moving.lattice().position([i, j, k]));
        let node = fixed.lattice().fractional_index(place).round();
        if node.min_element() < 0.0 {
            continue;
        }
        let node = node.to_array().map(|n| n as usize);
        both += u64::from(fixed.signed_distance.get(node).is_some_and(|d| *d <= deep));
    }
    both as f64 / inside.max(1) as f64
}

#[cfg(test)]
mod tests {
    use sdf_grid::{Silent, shapes};

    use super::*;
    use crate::{PairBuilder, Response, ScoreModel};

    #[test]
    fn cubes_overlap_by_the_share_that_is_shared() {
        let cube = shapes::cuboid(DVec3::splat(0.01)).unwrap();
        let builder = PairBuilder {
            spacing: Some(5e-4),
            halo: Some(2e-3),
            ..PairBuilder::default()
        };
        let pair = builder
            .build(&cube, &cube, &ScoreModel::GUIDED, &Silent)
            .unwrap();
        for (shift, share) in [(0.0, 1.0), (4e-3, 0.6), (9.9e-3, 0.0), (0.1, 0.0)] {
            let found = overlap(&pair, &Pose::from_translation(DVec3::X * shift));
            // One layer of 20 nodes may fall on either side.
            assert!((found - share).abs() < 0.06, "{shift}: {found}");
        }
    }

    #[test]
    fn width_of_a_known_well() {
        struct Cone;
        impl EnergySource for Cone {
            fn scratch(&self) -> Scratch {
                Scratch::default()
            }
            fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
                let t = pose.translation * DVec3::new(1.0, 4.0, 2.0);
                Response {
                    energy: -(1.0 - t.length()).max(0.0),
                    ..Response::default()
                }
            }
        }
        let width =
            |reach| half_width(&Cone, &mut Scratch::default(), &Pose::IDENTITY, -1.0, reach);
        assert!((width(1.0).unwrap() - 0.125).abs() < 0.011);
        assert_eq!(width(0.1), None);
    }
}
