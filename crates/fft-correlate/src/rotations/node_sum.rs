//! What a rotation node keeps: the coefficient of a cubic B-spline over its chart.
//!
//! A spline whose coefficients are the values of a wave of phase `w` per node is too small by
//! `(2 + cos w) / 3`. To undo that exactly would tie every node to all others of its chart.
//! Instead, a coefficient is the value less a share of the Laplacian in chart coordinates, by
//! differences over half a node: each node stands for itself, at the edge of a chart as in its
//! middle, and can be computed by anyone.

use glam::{DQuat, DVec3};

use crate::geometry::rotation_sum::RotationSum;
use crate::rotations::chart::{Chart, Projection};

/// How much of the Laplacian, in nodes. A sixth is exact for long waves; with a little more,
/// shorter ones, which decide the error of torques, fare better, and long ones err by less than
/// half precision does.
const LAPLACIAN: f64 = 0.175;

/// How far away it looks, in nodes.
const ASIDE: f64 = 0.5;

/// Corners of a tetrahedron: with four places the sum over them less four times the middle is the
/// Laplacian along all three axes; half turns about any of the axes leave it as it is.
const TETRAHEDRON: [DVec3; 4] = [
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.0, -1.0, -1.0),
    DVec3::new(-1.0, 1.0, -1.0),
    DVec3::new(-1.0, -1.0, 1.0),
];

/// The sum of a node of a chart, which lies at `index`.
pub(super) fn node_sum(chart: &Chart, index: [usize; 3]) -> RotationSum {
    let node = chart.node(index);
    let along: Vec<DVec3> = axes(chart).collect();
    let places: Vec<DVec3> = match along.len() {
        3 => TETRAHEDRON.map(|corner| corner / 3f64.sqrt()).to_vec(),
        _ => along.iter().flat_map(|e| [*e, -e]).collect(),
    };
    let Some(first) = along.first() else {
        return RotationSum::one(node);
    };
    // The places' second moment along each axis.
    let moment: f64 = places.iter().map(|p| (ASIDE * p.dot(*first)).powi(2)).sum();
    let at =
        |place: &DVec3| chart.rotation(chart.coordinates(index) + ASIDE * chart.spacing * *place);
    let others: Vec<DQuat> = places.iter().map(at).collect();
    RotationSum::less(node, &others, LAPLACIAN / (0.5 * moment))
}

/// Axes along which a chart has nodes.
fn axes(chart: &Chart) -> impl Iterator<Item = DVec3> {
    let twist = chart.projection == Projection::Twist;
    let along = move |k: &usize| chart.shape[*k] > 1 && (*k == 2 || !twist);
    (0..3).filter(along).map(|k| DVec3::AXES[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotations::domain::RotationDomain;
    use crate::rotations::grid::RotationGrid;

    /// Coordinates and their squares, whose Laplacian is known: the sum takes nothing from the
    /// former and twice the share of the Laplacian from the latter.
    #[test]
    fn sums_take_the_share_of_the_laplacian() {
        let chart = |shape, projection| Chart {
            projection,
            center: DQuat::from_xyzw(0.3, -0.2, 0.5, 0.7).normalize(),
            frame: DQuat::from_xyzw(-0.1, 0.6, 0.2, 0.4).normalize(),
            spacing: 0.04,
            origin: [8.0, 8.0, 8.0],
            shape,
            periodic: false,
            rows: Vec::new(),
        };
        for (shape, projection, axes) in [
            ([17, 17, 17], Projection::Gnomonic, 0..3),
            ([17, 17, 1], Projection::Gnomonic, 0..2),
            ([1, 1, 17], Projection::Twist, 2..3),
            ([1, 1, 1], Projection::Twist, 0..0),
        ] {
            let mut chart = chart(shape, projection);
            for (k, n) in shape.iter().enumerate() {
                chart.origin[k] = if *n == 1 { 0.0 } else { chart.origin[k] };
            }
            let index = shape.map(|n| n / 3);
            let sum = node_sum(&chart, index);
            let of = |f: &dyn Fn([f64; 3]) -> f64| -> f64 {
                let value = |(q, w): &(DQuat, f64)| w * f(chart.locate(*q).0);
                sum.terms().iter().map(value).sum()
            };
            assert!((of(&|_| 1.0) - 1.0).abs() < 1e-12);
            for k in axes {
                let x = index[k] as f64;
                assert!((of(&|at| at[k]) - x).abs() < 1e-9);
                let square = of(&|at| at[k] * at[k]);
                assert!((square - (x * x - 2.0 * LAPLACIAN)).abs() < 1e-9);
            }
        }
    }

    /// Half turns take the sums of a full grid's nodes to those of their partners, so that one
    /// transform of the moving part serves four nodes.
    #[test]
    fn half_turns_share_sums() {
        let center = DQuat::from_xyzw(0.3, -0.1, 0.7, 0.4).normalize();
        let full = RotationDomain::Full {
            center: center.to_array(),
            step_deg: 22.0,
        };
        let grid = RotationGrid::new(&full, None).unwrap();
        let groups = grid.half_turn_groups();
        assert!(groups.iter().all(|g| g.members.len() == 4));
        for group in groups {
            let first = grid.node_sum(group.members[0].1);
            for (turn, row) in group.members {
                assert!(first.turned(turn).agrees(&grid.node_sum(row)));
            }
        }
    }
}
