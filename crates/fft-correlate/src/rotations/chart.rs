//! Coordinates on a patch of rotations in which nodes form a box, and the coefficients of their cubic
//! B-splines.
//!
//! A spline whose coefficients are the values of a wave of phase `w` per node is too small by
//! `(2 + cos w) / 3`. To undo that exactly would tie every node to all others of its chart.
//! Instead, a coefficient is the value less a share of the Laplacian in chart coordinates, by
//! differences over half a node: each node stands for itself, at the edge of a chart as in its
//! middle, and can be computed by anyone.

use glam::{DQuat, DVec3};

use crate::geometry::half_turn::RotationSum;

/// The coordinates' formula. With `r` the rotation from the chart's centre, seen in the chart's
/// axes:
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Projection {
    /// `x_k = atan(r_k / r_w)`: half the angle along each axis, gnomonic with evened spacing.
    /// Covers rotations by less than 180 degrees; one cell of the cubed 3-sphere is `|x_k| <=
    /// pi/4`.
    Gnomonic,
    /// `x_2 = atan(r_z / r_w)` of the turn about z alone, in (-pi/2, pi/2]: half the twist angle.
    Twist,
}

/// A box of nodes in chart coordinates and the table row of each.
#[derive(Debug, Clone)]
pub(crate) struct Chart {
    pub(crate) projection: Projection,
    /// The rotation at the origin of the coordinates.
    pub(crate) center: DQuat,
    /// Turns chart axes into the fixed frame.
    pub(crate) frame: DQuat,
    /// Coordinate distance between nodes, radians of half angle.
    pub(crate) spacing: f64,
    /// Index of the coordinates' origin along each axis.
    pub(crate) origin: [f64; 3],
    /// Nodes along each axis; 1 where nothing changes.
    pub(crate) shape: [usize; 3],
    /// The last axis closes on itself.
    pub(crate) periodic: bool,
    /// Row of each node of the box in C order, or [`Chart::ABSENT`].
    pub(crate) rows: Vec<u32>,
}

impl Chart {
    /// Marks a node that no query inside the domain reads.
    pub(crate) const ABSENT: u32 = u32::MAX;

    /// Nodes in the box, absent ones included.
    pub(crate) fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Coordinates of a node, radians of half angle.
    pub(crate) fn coordinates(&self, index: [usize; 3]) -> DVec3 {
        let index = DVec3::from_array(index.map(|i| i as f64));
        (index - DVec3::from_array(self.origin)) * self.spacing
    }

    /// Index of a node from its place in C order.
    pub(crate) fn unravel(&self, flat: usize) -> [usize; 3] {
        let [_, ny, nz] = self.shape;
        [flat / (ny * nz), flat / nz % ny, flat % nz]
    }

    /// Rotation of a node.
    pub(crate) fn node(&self, index: [usize; 3]) -> DQuat {
        self.rotation(self.coordinates(index))
    }

    /// The rotation with these coordinates.
    pub(crate) fn rotation(&self, x: DVec3) -> DQuat {
        let relative = match self.projection {
            Projection::Gnomonic => {
                let u = DVec3::new(x.x.tan(), x.y.tan(), x.z.tan());
                DQuat::from_xyzw(u.x, u.y, u.z, 1.0).normalize()
            }
            Projection::Twist => DQuat::from_xyzw(0.0, 0.0, x.z.sin(), x.z.cos()),
        };
        (self.frame * relative * self.frame.conjugate() * self.center).normalize()
    }

    /// The rotation from the centre to `q`, seen in the chart's axes, scalar part not negative.
    pub(crate) fn relative(&self, q: DQuat) -> DQuat {
        let r = self.frame.conjugate() * (q * self.center.conjugate()) * self.frame;
        if r.w < 0.0 { -r } else { r }
    }

    /// Fractional index of `q` and its gradient with respect to a turn of `q` in the fixed frame,
    /// per radian. Finite wherever `q` is; meaningful where the projection is defined.
    pub(crate) fn locate(&self, q: DQuat) -> ([f64; 3], [DVec3; 3]) {
        let r = self.relative(q);
        let v = r.xyz();
        let (x, gradient) = match self.projection {
            Projection::Gnomonic => gnomonic(v, r.w.max(1e-9)),
            Projection::Twist => twist(v, r.w),
        };
        let index = std::array::from_fn(|k| x[k] / self.spacing + self.origin[k]);
        (index, gradient.map(|g| self.frame * g / self.spacing))
    }
}

/// `x_k = atan u_k` with `u = v / w`; a turn `omega` changes `u` by
/// `(omega + omega x u + u (u . omega)) / 2`.
fn gnomonic(v: DVec3, w: f64) -> (DVec3, [DVec3; 3]) {
    let u = v / w;
    let x = DVec3::new(u.x.atan(), u.y.atan(), u.z.atan());
    let gradient = [DVec3::X, DVec3::Y, DVec3::Z].map(|e| {
        let along = u.dot(e);
        0.5 / (1.0 + along * along) * (e + u.cross(e) + along * u)
    });
    (x, gradient)
}

fn twist(v: DVec3, w: f64) -> (DVec3, [DVec3; 3]) {
    let (y, square) = (v.z, (w * w + v.z * v.z).max(1e-18));
    let x = DVec3::new(0.0, 0.0, y.atan2(w));
    let gradient = 0.5 * (w * (w * DVec3::Z + v.cross(DVec3::Z)) + y * v) / square;
    (x, [DVec3::ZERO, DVec3::ZERO, gradient])
}

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

    fn chart(projection: Projection) -> Chart {
        Chart {
            projection,
            center: DQuat::from_xyzw(0.3, -0.2, 0.5, 0.7).normalize(),
            frame: DQuat::from_xyzw(-0.1, 0.6, 0.2, 0.4).normalize(),
            spacing: 0.04,
            origin: [8.0, 8.0, 8.0],
            shape: [17, 17, 17],
            periodic: false,
            rows: Vec::new(),
        }
    }

    #[test]
    fn nodes_are_where_their_index_says() {
        for projection in [Projection::Gnomonic, Projection::Twist] {
            let chart = chart(projection);
            for index in [[8, 8, 8], [8, 8, 3], [8, 8, 15]] {
                let (x, _) = chart.locate(chart.node(index));
                for k in 0..3 {
                    let expected = if projection == Projection::Twist && k < 2 {
                        8.0
                    } else {
                        index[k] as f64
                    };
                    assert!((x[k] - expected).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn gradients_are_central_differences_for_q_and_minus_q() {
        for projection in [Projection::Gnomonic, Projection::Twist] {
            let chart = chart(projection);
            let q = DQuat::from_xyzw(0.4, -0.35, 0.3, 0.75).normalize();
            let (_, gradient) = chart.locate(q);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let step = 1e-5;
                let at = |s: f64| chart.locate(-(DQuat::from_scaled_axis(s * axis) * q)).0;
                let (a, b) = (at(-step), at(step));
                for k in 0..3 {
                    let difference = (b[k] - a[k]) / (2.0 * step);
                    // Index units are 25 per radian; central differences err at 1e-9 of that.
                    assert!((difference - gradient[k].dot(axis)).abs() < 1e-6);
                }
            }
        }
    }

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
