//! What the symmetry of two parts is good for: fewer rotations in a table, equal fits.

use glam::DVec3;
use sdf_grid::{SymmetryAxis, SymmetryOrder, TriangleMesh, symmetry};

use crate::geometry::se3::Pose;
use crate::rotations::domain::{AxisSymmetry, Part, RotationDomain};

/// Deviation from symmetry that counts as none, in lattice spacings: what a lattice cannot tell
/// apart is symmetric enough.
const TOLERANCE: f64 = 0.02;

/// The highest order by which a rotation grid can be shortened.
const HIGHEST_ORDER: u32 = 64;

/// The symmetry axes of a part that lattices of `spacing` metres do not tell from exact ones,
/// highest order first.
pub fn symmetry_on_lattice(mesh: &TriangleMesh, spacing: f64) -> Vec<SymmetryAxis> {
    symmetry::detect(mesh, TOLERANCE * spacing)
}

/// The symmetry by which a table of `rotations` leaves out nodes: the axis of highest order of
/// either part, the fixed one's of two alike. Lists and spins are taken as they are written.
pub fn table_symmetry(
    rotations: &RotationDomain,
    fixed: &[SymmetryAxis],
    moving: &[SymmetryAxis],
) -> Option<AxisSymmetry> {
    use RotationDomain::{Ball, Full};
    if !matches!(rotations, Ball { .. } | Full { .. }) {
        return None;
    }
    let of = |part, axes: &[SymmetryAxis]| {
        axes.first().map(|axis| AxisSymmetry {
            part,
            axis: axis.direction.to_array(),
            point: axis.point.to_array(),
            order: match axis.order {
                SymmetryOrder::Continuous => 0,
                SymmetryOrder::Finite(n) => n,
            },
        })
    };
    // An order beyond what grids accept is of no use to them.
    [of(Part::Moving, moving), of(Part::Fixed, fixed)]
        .into_iter()
        .flatten()
        .filter(|s| s.order <= HIGHEST_ORDER)
        .max_by_key(|s| if s.order == 0 { u32::MAX } else { s.order })
}

/// Distance of the pivot (metres) and angle (radians) between `pose` and `fit`, or that of the fits
/// that differ by a motion of `group` which is nearest in angle; `group` maps the moving part onto
/// itself ([`crate::symmetry_group`]).
pub fn from_fit(pose: &Pose, fit: &Pose, pivot: DVec3, group: &[Pose]) -> (f64, f64) {
    group
        .iter()
        .map(|turn| *fit * *turn)
        .map(|same| {
            let away = same.apply(pivot).distance(pose.apply(pivot));
            (away, same.angle_to(pose))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or((f64::NAN, f64::NAN))
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use crate::dock::rotations::symmetry_group;

    use super::*;

    fn axis(direction: DVec3, order: SymmetryOrder) -> SymmetryAxis {
        SymmetryAxis {
            point: DVec3::ZERO,
            direction,
            order,
        }
    }

    #[test]
    fn the_highest_order_that_a_grid_accepts_is_taken() {
        let four = [axis(DVec3::Z, SymmetryOrder::Finite(4))];
        let two = [axis(DVec3::X, SymmetryOrder::Finite(2))];
        let many = [axis(DVec3::X, SymmetryOrder::Finite(100))];
        let round = [axis(DVec3::Y, SymmetryOrder::Continuous)];
        let ball = RotationDomain::ball(20.0, 5.0);
        let chosen = |fixed: &[_], moving: &[_]| {
            table_symmetry(&ball, fixed, moving).map(|s| (s.part, s.order))
        };
        assert_eq!(chosen(&four, &two), Some((Part::Fixed, 4)));
        assert_eq!(chosen(&two, &two), Some((Part::Fixed, 2)));
        assert_eq!(chosen(&round, &four), Some((Part::Fixed, 0)));
        assert_eq!(chosen(&many, &two), Some((Part::Moving, 2)));
        assert_eq!(chosen(&[], &[]), None);
        let list = RotationDomain::List {
            rotations: vec![[0.0, 0.0, 0.0, 1.0]],
            margin_deg: 5.0,
        };
        assert_eq!(table_symmetry(&list, &four, &two), None);
    }

    #[test]
    fn a_fit_turned_by_two_axes_is_still_the_fit() {
        let axes = [
            axis(DVec3::Z, SymmetryOrder::Finite(4)),
            axis(DVec3::X, SymmetryOrder::Finite(2)),
        ];
        let fit = Pose::from_translation(DVec3::new(0.01, 0.0, 0.0));
        let turn = DQuat::from_rotation_x(std::f64::consts::PI)
            * DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let pose = fit * Pose::new(turn, DVec3::ZERO);
        let (away, angle) = from_fit(&pose, &fit, DVec3::ZERO, &symmetry_group(&axes));
        assert!(away < 1e-12 && angle < 1e-6, "{away} {angle}");
    }
}
