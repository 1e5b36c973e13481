//! Second-order moments of a cluster of faces, for its effect seen from afar.
//!
//! For an integrand `G(|r - d|) ((r - d) . n)` with `r = (p - c) / |xi|` and `d = (q - c) / |xi|`,
//! expanding in `d` about the centroid `c` to second order needs the area vector `N`, the symmetric
//! first moment `M` of the normals, and of their second moments a cubic form `S` and a vector `V`.

use glam::{DMat3, DVec3};

use crate::surface::face::Face;

/// Moments about the area centroid.
#[derive(Debug, Clone, Default)]
pub(crate) struct Moments {
    /// Area of the faces.
    area: f64,
    /// Area centroid `c`.
    pub(crate) centre: DVec3,
    /// `N`, the integral of the normal.
    pub(crate) area_vector: DVec3,
    /// `M`, the symmetric part of the integral of `n (q - c)^T`: xx, yy, zz, xy, xz, yz.
    pub(crate) normal_moment: [f64; 6],
    /// `S`, the integral of `(r . n) (r . (q - c))^2`, by the coefficients of
    /// xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz in `r`.
    pub(crate) cubic: [f64; 10],
    /// `V`, the integral of `n |q - c|^2 / 2 + (q - c) ((q - c) . n)`.
    pub(crate) vector: DVec3,
    /// Largest distance of a corner from the centroid.
    pub(crate) radius: f64,
    /// Largest distance of a corner from the plane through the centroid that is normal to `N`.
    pub(crate) thickness: f64,
    /// Sine of the largest angle between a normal and `N`; 1 from a right angle on.
    pub(crate) spread: f64,
}

impl Moments {
    /// Of a non-empty set of faces; without radius, thickness and spread ([`Moments::bounded`]).
    pub(crate) fn from_faces(faces: &[Face]) -> Self {
        let area: f64 = faces.iter().map(|t| t.area).sum();
        let weighted = faces.iter().map(|t| t.centroid * t.area);
        let mut sums = Self {
            area,
            centre: weighted.sum::<DVec3>() / area,
            area_vector: faces.iter().map(|t| t.normal * t.area).sum(),
            ..Self::default()
        };
        for t in faces {
            sums.add(t);
        }
        sums
    }

    /// Of two sets of faces together, from the moments of each.
    pub(crate) fn joined(&self, other: &Self) -> Self {
        let area = self.area + other.area;
        let mut sums = Self {
            area,
            centre: (self.centre * self.area + other.centre * other.area) / area,
            area_vector: self.area_vector + other.area_vector,
            ..Self::default()
        };
        for part in [self, other] {
            sums.add_part(part);
        }
        sums
    }

    /// With radius, thickness and spread of `faces`, whose moments these are.
    pub(crate) fn bounded(mut self, faces: &[Face]) -> Self {
        let axis = self.axis();
        let (mut far, mut thickness, mut cosine) = (0f64, 0f64, 1f64);
        for t in faces {
            for c in t.outline() {
                let from = *c - self.centre;
                far = far.max(from.length_squared());
                thickness = thickness.max(from.dot(axis).abs());
            }
            cosine = cosine.min(t.normal.dot(axis));
        }
        self.radius = far.sqrt();
        self.thickness = thickness;
        self.spread = if faces.len() == 1 {
            0.0
        } else if cosine > 0.0 {
            (1.0 - cosine * cosine).max(0.0).sqrt()
        } else {
            1.0
        };
        self
    }

    /// The direction of `N`, any if there is none.
    pub(crate) fn axis(&self) -> DVec3 {
        self.area_vector.try_normalize().unwrap_or(DVec3::Z)
    }

    fn add(&mut self, t: &Face) {
        let (n, d) = (t.normal, t.centroid - self.centre);
        let second = second_moment(t) + outer(d, d) * t.area;
        let q = symmetric(&second);
        let trace = q[0] + q[1] + q[2];
        self.add_terms(
            &(outer(n, d) * t.area),
            product(n, q),
            n * (0.5 * trace) + second * n,
        );
    }

    /// Adds the moments of a part, taken about its own centre.
    fn add_part(&mut self, part: &Self) {
        let (n, d) = (part.area_vector, part.centre - self.centre);
        let m = matrix(&part.normal_moment);
        let trace = part.normal_moment[..3].iter().sum::<f64>();
        let twist = product(2.0 * d, part.normal_moment);
        let shift = product(n, symmetric(&outer(d, d)));
        self.add_terms(
            &(m + outer(n, d)),
            std::array::from_fn(|k| part.cubic[k] + twist[k] + shift[k]),
            part.vector + 2.0 * (m * d) + d * (trace + d.dot(n)) + n * (0.5 * d.length_squared()),
        );
    }

    fn add_terms(&mut self, normal_moment: &DMat3, cubic: [f64; 10], vector: DVec3) {
        let m = symmetric(&(0.5 * (*normal_moment + normal_moment.transpose())));
        self.normal_moment = std::array::from_fn(|k| self.normal_moment[k] + m[k]);
        self.cubic = std::array::from_fn(|k| self.cubic[k] + cubic[k]);
        self.vector += vector;
    }

    /// The integral over the cluster seen from `p`, given `radial(u) = [G, G', G'']` at
    /// `u = |p - c| / xi`, to second order in the cluster's size:
    ///
    /// `G r.N - G tr M - (G'/u) r.Mr + (G'/u) r.V + 1/2 (G''/u^2 - G'/u^3) S(r)`.
    pub(crate) fn far_field<T>(&self, p: DVec3, xi: f64, radial: impl Fn(f64) -> [T; 3]) -> T
    where
        T: Copy
            + std::ops::Add<Output = T>
            + std::ops::Sub<Output = T>
            + std::ops::Mul<f64, Output = T>,
    {
        let r = (p - self.centre) / xi;
        let u = r.length();
        let [g, g1, g2] = radial(u);
        let (m, s) = (&self.normal_moment, &self.cubic);
        let (x, y, z) = (r.x, r.y, r.z);
        let tilt = x * (m[0] * x + 2.0 * (m[3] * y + m[4] * z))
            + y * (m[1] * y + 2.0 * m[5] * z)
            + m[2] * z * z;
        let cubic = x
            * (x * (s[0] * x + s[1] * y + s[2] * z) + y * (s[3] * y + s[4] * z) + s[5] * z * z)
            + y * (y * (s[6] * y + s[7] * z) + s[8] * z * z)
            + s[9] * z * z * z;
        let (first, second) = (1.0 / xi, 1.0 / (xi * xi));
        let slope = g1 * (1.0 / u);
        let value = g * (r.dot(self.area_vector) - (m[0] + m[1] + m[2]) * first)
            + slope * (r.dot(self.vector) * second - tilt * first)
            + (g2 - slope) * (0.5 * cubic * second / (u * u));
        value * second
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// The cubic form `(r . n) (r . Q r)`, `q` as from [`symmetric`]; see [`Moments::cubic`].
fn product(n: DVec3, q: [f64; 6]) -> [f64; 10] {
    [
        n.x * q[0],
        2.0 * n.x * q[3] + n.y * q[0],
        2.0 * n.x * q[4] + n.z * q[0],
        2.0 * n.y * q[3] + n.x * q[1],
        2.0 * (n.x * q[5] + n.y * q[4] + n.z * q[3]),
        2.0 * n.z * q[4] + n.x * q[2],
        n.y * q[1],
        2.0 * n.y * q[5] + n.z * q[1],
        2.0 * n.z * q[5] + n.y * q[2],
        n.z * q[2],
    ]
}

/// The matrix of [`symmetric`].
fn matrix([xx, yy, zz, xy, xz, yz]: &[f64; 6]) -> DMat3 {
    DMat3::from_cols(
        DVec3::new(*xx, *xy, *xz),
        DVec3::new(*xy, *yy, *yz),
        DVec3::new(*xz, *yz, *zz),
    )
}

/// xx, yy, zz, xy, xz, yz.
fn symmetric(m: &DMat3) -> [f64; 6] {
    [
        m.x_axis.x, m.y_axis.y, m.z_axis.z, m.x_axis.y, m.x_axis.z, m.y_axis.z,
    ]
}

/// The integral of `(q - centroid) (q - centroid)^T` over the face.
fn second_moment(t: &Face) -> DMat3 {
    let mut sum = DMat3::ZERO;
    for [a, b, c] in t.fan() {
        let area = 0.5 * (b - a).cross(c - a).dot(t.normal);
        let [a, b, c] = [a, b, c].map(|p| p - t.centroid);
        let middle = a + b + c;
        sum += (outer(a, a) + outer(b, b) + outer(c, c) + outer(middle, middle)) * (area / 12.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes::random_solid;
    use crate::surface::bvh::tree::Bvh;

    #[test]
    fn moments_of_nodes_are_those_of_their_faces() {
        for seed in 0..6 {
            let bvh = Bvh::build(&random_solid(seed).expect("a solid"));
            for node in &bvh.nodes {
                let faces = &bvh.faces[node.range()];
                let exact = Moments::from_faces(faces).bounded(faces);
                let found = &node.moments;
                // Rounding, in units of what the faces' sizes and areas allow at most.
                let unit = |power: i32| 1e-12 * exact.area * exact.radius.powi(power);
                let near = |a: f64, b: f64, unit: f64| assert!((a - b).abs() <= unit, "{a} {b}");
                assert!(found.centre.distance(exact.centre) < 1e-13);
                assert!(found.area_vector.distance(exact.area_vector) < unit(0));
                assert!(found.vector.distance(exact.vector) < unit(2));
                near(found.area, exact.area, unit(0));
                near(found.radius, exact.radius, 1e-13);
                // Along its own axis: a closed surface has none.
                let height = |c: &DVec3| (*c - found.centre).dot(found.axis()).abs();
                let corners = bvh.faces[node.range()].iter().flat_map(Face::outline);
                let thickness = corners.map(height).fold(0.0, f64::max);
                near(found.thickness, thickness, 1e-13);
                near(found.spread, exact.spread, 1e-7);
                for (a, b) in found.normal_moment.iter().zip(exact.normal_moment) {
                    near(*a, b, unit(1));
                }
                for (a, b) in found.cubic.iter().zip(exact.cubic) {
                    near(*a, b, unit(2));
                }
            }
        }
    }
}
