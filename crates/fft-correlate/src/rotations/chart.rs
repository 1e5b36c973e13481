//! Coordinates on a patch of rotations in which nodes form a box.

use glam::{DQuat, DVec3};

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
