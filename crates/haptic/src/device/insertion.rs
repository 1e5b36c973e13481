//! How the moving part gets into its fit.

use fft_correlate::{EnergySource, Pose};
use glam::DVec3;
use sdf_grid::TriangleMesh;

use crate::device::script::Geometry;

/// How far a careless hand tilts the part, radians.
const CARELESS_TILT: f64 = 0.08;

impl Geometry {
    /// The way of `moving` into its fit at `seated`: along `axis` (unit, fixed frame) over `depth`
    /// metres. An axis that is not given is the coordinate direction along which the part can be
    /// withdrawn with the least climb in energy; a depth that is not is the part's extent along it.
    pub fn of_fit(
        source: &dyn EnergySource,
        moving: &TriangleMesh,
        seated: Pose,
        axis: Option<DVec3>,
        depth: Option<f64>,
    ) -> Self {
        let size = moving
            .transformed(seated.rotation, DVec3::ZERO)
            .bounds()
            .size();
        let axis = axis.unwrap_or_else(|| -easiest_way_out(source, &seated, size));
        let along = axis.abs().dot(size);
        let across = size.length_squared() - along * along;
        Self {
            seated,
            axis,
            depth: depth.unwrap_or(along),
            radius: 0.25 * (0.5 * across.max(0.0)).sqrt(),
            tilt: CARELESS_TILT,
        }
    }
}

/// Climbs that differ by less than this share of the depth of the fit are alike: a part symmetric
/// front to back differs by rounding only.
const ALIKE: f64 = 1e-3;

/// Of the six coordinate directions, the one whose highest energy on the way out is lowest; the
/// first such one of +z, -z, +y, -y, +x, -x.
fn easiest_way_out(source: &dyn EnergySource, seated: &Pose, size: DVec3) -> DVec3 {
    const STEPS: u32 = 60;
    let mut scratch = source.scratch();
    let depth = source.evaluate(seated, &mut scratch).energy.abs();
    let mut climb = |direction: DVec3| {
        let reach = direction.abs().dot(size);
        (1..=STEPS)
            .map(|i| {
                let away = direction * (reach * f64::from(i) / f64::from(STEPS));
                let pose = Pose {
                    translation: seated.translation + away,
                    ..*seated
                };
                source.evaluate(&pose, &mut scratch).energy
            })
            .fold(f64::NEG_INFINITY, f64::max)
    };
    let mut best = (climb(DVec3::Z), DVec3::Z);
    for direction in [DVec3::NEG_Z, DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::NEG_X] {
        let energy = climb(direction);
        if energy < best.0 - ALIKE * depth {
            best = (energy, direction);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use fft_correlate::{
        DirectEvaluator, DirectOptions, PairBuilder, Response, ScoreModel, Scratch,
    };
    use glam::DQuat;
    use sdf_grid::{Silent, shapes};

    use super::*;

    /// Uphill in all directions but -y.
    struct Gutter;

    impl EnergySource for Gutter {
        fn scratch(&self) -> Scratch {
            Scratch::default()
        }

        fn evaluate(&self, pose: &Pose, _: &mut Scratch) -> Response {
            let t = pose.translation;
            Response {
                energy: t.x.abs() + t.z.abs() + t.y.max(0.0),
                ..Response::default()
            }
        }
    }

    #[test]
    fn the_way_in_is_against_the_easiest_way_out() {
        let part = shapes::cuboid(DVec3::new(0.01, 0.03, 0.02)).unwrap();
        let found = Geometry::of_fit(&Gutter, &part, Pose::IDENTITY, None, None);
        assert_eq!(found.axis, DVec3::Y);
        assert!((found.depth - 0.03).abs() < 1e-12, "{}", found.depth);
        let given = Geometry::of_fit(&Gutter, &part, Pose::IDENTITY, Some(DVec3::Z), Some(0.5));
        assert_eq!((given.axis, given.depth), (DVec3::Z, 0.5));
    }

    /// A hole open at both ends that lies along an axis: of two ways out that are alike, the first.
    #[test]
    fn a_part_goes_into_its_hole_along_the_hole() {
        let (hole, peg) = shapes::PegInHole::Rectangular.pair(0.0).unwrap();
        let builder = PairBuilder {
            spacing: Some(0.004),
            ..PairBuilder::default()
        };
        for (turn, axis) in [
            (DQuat::IDENTITY, DVec3::NEG_Z),
            (DQuat::from_rotation_arc(DVec3::Z, DVec3::X), DVec3::NEG_X),
            (DQuat::from_rotation_arc(DVec3::Z, DVec3::Y), DVec3::NEG_Y),
        ] {
            let [hole, peg] = [&hole, &peg].map(|mesh| mesh.transformed(turn, DVec3::ZERO));
            let pair = builder
                .build(&hole, &peg, &ScoreModel::GUIDED, &Silent)
                .unwrap();
            let source = DirectEvaluator::new(&pair, &DirectOptions::REAL_TIME).unwrap();
            let found = Geometry::of_fit(&source, &peg, Pose::IDENTITY, None, None);
            assert_eq!(found.axis, axis);
            assert!((found.depth - 0.03).abs() < 1e-9, "{}", found.depth);
        }
    }
}
