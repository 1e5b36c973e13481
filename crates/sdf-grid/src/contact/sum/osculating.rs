//! Curved surfaces as tori, piece by piece.

use glam::{DMat2, DVec2, DVec3};

/// Curvature at most, per reach of the kernel: from the axis of what is bent as much, the kernel
/// just does not reach the surface, and no place has two feet.
pub(super) const MOST_BENT: f64 = 1.0;

/// Surfaces bent less are flat.
const LEAST_BENT: f64 = 1e-4;

/// How far a torus may be from the surface near by, and how that grows with the distance beyond
/// [`NEAR`], in units of the reach.
pub(super) const OFF: f64 = 0.006;
const OFF_FAR: f64 = 0.03;
pub(super) const NEAR: f64 = 0.9;

/// Normals differ from the torus' by an angle of this cosine at most.
pub(super) const ALONG: f64 = 0.95;

/// Looks at the surface, each from the torus found before.
const LOOKS: usize = 4;

/// A small piece of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surfel {
    pub(super) place: DVec3,
    pub(super) normal: DVec3,
    pub(super) area: f64,
}

impl Surfel {
    /// In units of `unit`, relative to `origin`.
    pub(super) fn scaled(&self, origin: DVec3, unit: f64) -> Self {
        Self {
            place: (self.place - origin) / unit,
            normal: self.normal,
            area: self.area / (unit * unit),
        }
    }
}

/// A torus, a cylinder, a sphere or a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Osculating {
    /// A point of it.
    pub(super) origin: DVec3,
    /// The directions in which it is bent most and least there, and its normal; right-handed.
    pub(super) axes: [DVec3; 3],
    /// How much it is bent along either, positive if it is convex.
    pub(super) curvature: DVec2,
}

impl Osculating {
    /// The torus nearest to a surface about the first of `surfels`, the others being those of its
    /// neighbours less than [`NEAR`] from it; none if the surface is bent too much.
    pub(super) fn fitted(surfels: &[Surfel]) -> Option<Self> {
        let first = surfels.first()?;
        let (u, v) = first.normal.any_orthonormal_pair();
        let mut torus = Self {
            origin: first.place,
            axes: [u, v, first.normal],
            curvature: DVec2::ZERO,
        };
        for _ in 0..LOOKS {
            torus = torus.improved(surfels)?;
        }
        let bent = torus.curvature.abs().max_element();
        if bent < LEAST_BENT {
            torus.curvature = DVec2::ZERO;
        }
        (bent <= MOST_BENT).then_some(torus)
    }

    /// Whether it stands for `surfels`, seen from the origin.
    pub(super) fn stands_for(&self, mut surfels: impl Iterator<Item = Surfel>) -> bool {
        surfels.all(|s| {
            let beyond = (s.place.length() - NEAR).max(0.0);
            self.keeps(&s, OFF + OFF_FAR * beyond * beyond)
        })
    }

    /// Whether a surfel is no farther from it than `off` and not turned away.
    fn keeps(&self, surfel: &Surfel, off: f64) -> bool {
        let [x, y, z] = self.axes.map(|a| (surfel.place - self.origin).dot(a));
        let [kx, ky] = self.curvature.to_array();
        let (lifted, about) = rise(z, y, ky);
        let (height, around) = rise(lifted, x, kx);
        if height.abs() > off {
            return false;
        }
        let [nx, ny, nz] = self.axes.map(|a| surfel.normal.dot(a));
        let up = (ky * y * ny + (1.0 + ky * z) * nz) / about;
        kx * x * nx + (1.0 + kx * lifted) * up >= ALONG * around
    }

    /// The same where its origin is elsewhere.
    pub(super) fn moved(self, by: DVec3) -> Self {
        Self {
            origin: self.origin + by,
            ..self
        }
    }

    /// By least squares of what is left, weighted about the first, to which all are close.
    fn improved(&self, surfels: &[Surfel]) -> Option<Self> {
        let about = surfels.first()?.place;
        let mut normal = [[0.0; 6]; 6];
        let mut right = [0.0; 6];
        for s in surfels {
            let off = s.place.distance_squared(about) / (NEAR * NEAR);
            let weight = s.area * (1.0 - off) * (1.0 - off);
            let (p, middle) = self.developed(s.place);
            // On average over the surfel, which is bent, it is to be on the torus.
            let height = middle + s.area / 24.0 * (self.curvature.x + self.curvature.y);
            let row = [1.0, p.x, p.y, 0.5 * p.x * p.x, p.x * p.y, 0.5 * p.y * p.y];
            for i in 0..6 {
                right[i] += weight * row[i] * height;
                for j in i..6 {
                    normal[i][j] += weight * row[i] * row[j];
                }
            }
        }
        // The other half is the same.
        let upper = normal;
        for (i, row) in normal.iter_mut().enumerate() {
            let column = upper.iter().map(|r| r[i]).take(i);
            row.iter_mut().zip(column).for_each(|(x, y)| *x = y);
        }
        // What surfels do not tell, as on a line, stays.
        let trace = (0..6).map(|i| normal[i][i]).sum::<f64>();
        for (i, row) in normal.iter_mut().enumerate() {
            row[i] += 1e-9 * trace;
        }
        let c = solved(normal, right)?;
        let [u, v, n] = self.axes;
        let up = (n - c[1] * u - c[2] * v).try_normalize()?;
        let u = (u - u.dot(up) * up).try_normalize()?;
        let v = up.cross(u);
        let bent = DMat2::from_diagonal(self.curvature)
            - DMat2::from_cols(DVec2::new(c[3], c[4]), DVec2::new(c[4], c[5]));
        let (turn, curvature) = principal(bent);
        Some(Self {
            origin: self.origin + c[0] * n,
            axes: [turn.x * u + turn.y * v, turn.x * v - turn.y * u, up],
            curvature: curvature.clamp(DVec2::splat(-1.0), DVec2::splat(1.0)),
        })
    }

    /// A place on the surface, unrolled, and the height above it.
    pub(super) fn developed(&self, p: DVec3) -> (DVec2, f64) {
        let [x, y, z] = self.axes.map(|a| (p - self.origin).dot(a));
        let [kx, ky] = self.curvature.to_array();
        let (lifted, _) = rise(z, y, ky);
        let place = DVec2::new(unrolled(lifted, x, kx), unrolled(z, y, ky));
        (place, rise(lifted, x, kx).0)
    }
}

/// Height above a circle of curvature `k` through the origin, and distance from its middle in radii.
fn rise(z: f64, x: f64, k: f64) -> (f64, f64) {
    let square = x * x + z * z;
    let distance = (1.0 + k * (2.0 * z + k * square)).max(0.0).sqrt();
    ((2.0 * z + k * square) / (1.0 + distance), distance)
}

/// Length of the circle's arc to below a place.
fn unrolled(z: f64, x: f64, k: f64) -> f64 {
    match k.abs() < LEAST_BENT {
        true => x,
        false => (k * x).atan2(1.0 + k * z) / k,
    }
}

/// The direction of the greater eigenvalue of a symmetric matrix, and both eigenvalues.
fn principal(m: DMat2) -> (DVec2, DVec2) {
    let (half, off) = (0.5 * (m.x_axis.x - m.y_axis.y), m.x_axis.y);
    let angle = 0.5 * off.atan2(half);
    let (middle, spread) = (0.5 * (m.x_axis.x + m.y_axis.y), half.hypot(off));
    (
        DVec2::from_angle(angle),
        DVec2::new(middle + spread, middle - spread),
    )
}

/// The solution of symmetric positive equations; none if they are not.
pub(super) fn solved<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> Option<[f64; N]> {
    for i in 0..N {
        let (row, right) = (a[i], b[i]);
        if row[i].is_nan() || row[i] <= 0.0 {
            return None;
        }
        for j in i + 1..N {
            let factor = a[j][i] / row[i];
            a[j].iter_mut().zip(row).for_each(|(x, y)| *x -= factor * y);
            b[j] -= factor * right;
        }
    }
    for i in (0..N).rev() {
        let known = a[i].iter().zip(b).skip(i + 1);
        b[i] = (b[i] - known.map(|(x, y)| x * y).sum::<f64>()) / a[i][i];
    }
    Some(b)
}
