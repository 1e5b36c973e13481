//! Quadratic interpolation on a cube.

use glam::{DMat3, DVec3};
use num_complex::Complex64;

/// Values at the 27 points with coordinates -1, 0, 1, z fastest.
pub(crate) type Fit = [Complex64; 27];

/// A value and its gradient.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Density {
    /// Dimensionless.
    pub(crate) value: Complex64,
    /// Real parts of the derivatives, per metre.
    pub(crate) real_slope: DVec3,
    /// Imaginary parts, per metre.
    pub(crate) imaginary_slope: DVec3,
}

impl Density {
    /// The gradient of `Re(factor * value)`.
    pub(crate) fn slope(&self, factor: Complex64) -> DVec3 {
        self.real_slope * factor.re - self.imaginary_slope * factor.im
    }

    /// As a function of another point that `change` is the derivative of its own by.
    pub(super) fn moved(&self, change: &DMat3) -> Self {
        let back = change.transpose();
        Self {
            value: self.value,
            real_slope: back * self.real_slope,
            imaginary_slope: back * self.imaginary_slope,
        }
    }
}

/// Weights of the nodes at `u`, and their derivatives.
fn weights(u: f64) -> [[f64; 3]; 2] {
    [
        [0.5 * u * (u - 1.0), 1.0 - u * u, 0.5 * u * (u + 1.0)],
        [u - 0.5, -2.0 * u, u + 0.5],
    ]
}

/// Value and gradient at `u` (in -1 ..= 1) on a cube of half edge `half` metres.
pub(crate) fn evaluate(fit: &Fit, u: DVec3, half: f64) -> Density {
    let [x, y, z] = u.to_array().map(weights);
    let (mut value, mut along) = (Complex64::ZERO, [Complex64::ZERO; 3]);
    for i in 0..3 {
        let (mut v, mut dy, mut dz) = (Complex64::ZERO, Complex64::ZERO, Complex64::ZERO);
        for j in 0..3 {
            let row = &fit[9 * i + 3 * j..9 * i + 3 * j + 3];
            let sum = |w: &[f64; 3]| row[0] * w[0] + row[1] * w[1] + row[2] * w[2];
            let (a, b) = (sum(&z[0]), sum(&z[1]));
            v += a * y[0][j];
            dy += a * y[1][j];
            dz += b * y[0][j];
        }
        value += v * x[0][i];
        along[0] += v * x[1][i];
        along[1] += dy * x[0][i];
        along[2] += dz * x[0][i];
    }
    Density {
        value,
        real_slope: DVec3::from_array(along.map(|c| c.re)) / half,
        imaginary_slope: DVec3::from_array(along.map(|c| c.im)) / half,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratics_come_back() {
        let f = |p: DVec3| Complex64::new(1.0 + p.x * p.y - p.z * p.z, p.x * p.x * p.z - 2.0 * p.y);
        let at = |n: usize| (n % 3) as f64 - 1.0;
        let fit: Fit = std::array::from_fn(|n| f(DVec3::new(at(n / 9), at(n / 3), at(n))));
        let u = DVec3::new(0.3, -0.7, 0.2);
        let found = evaluate(&fit, u, 0.5);
        assert!((found.value - f(u)).norm() < 1e-14);
        let real = DVec3::new(u.y, u.x, -2.0 * u.z) / 0.5;
        let imaginary = DVec3::new(2.0 * u.x * u.z, -2.0, u.x * u.x) / 0.5;
        assert!(found.real_slope.distance(real) < 1e-13);
        assert!(found.imaginary_slope.distance(imaginary) < 1e-13);
        let turned = found.slope(Complex64::I);
        assert!(turned.distance(-imaginary) < 1e-13);
    }
}
