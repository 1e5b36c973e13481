//! The kernel of the density and its unit integrals.
//!
//! With `u = eta / |xi| >= 1`, `x = (u - 1) / sigma` and `s` the sign of the distance, the paper's
//! eq_2 is `H(u) = lambda / (2 pi sigma) * u^2 / (s + i u)^2 * exp(-x^2 / 2)`. Its real and
//! imaginary shapes are `A = u^2 (1 - u^2) / (1 + u^2)^2` and `B = 2 u^3 / (1 + u^2)^2`:
//! `H = lambda (A - i s B) exp(-x^2 / 2) / (2 pi sigma)`.

use num_complex::Complex64;

use crate::field::quadrature::GaussLegendre;

/// The density kernel of thickness `sigma` (the paper's eq_2, written as the bounded `H(u)` of
/// `docs/conventions.md`).
///
/// ```
/// use sdf_grid::DensityKernel;
///
/// let kernel = DensityKernel::new(0.2)?;
/// assert_eq!(kernel.sigma(), 0.2);
/// assert!((kernel.kappa() - kernel.half_space().norm()).abs() < 1e-12);
/// assert!(DensityKernel::new(2.0).is_err());
/// # Ok::<(), sdf_grid::KernelError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityKernel {
    sigma: f64,
}

/// A kernel thickness out of range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("sigma must be from 0.03 to 0.5, found {found}")]
pub struct KernelError {
    /// What was given, dimensionless.
    pub found: f64,
}

impl DensityKernel {
    /// A kernel of thickness `sigma`, dimensionless, in `0.03..=0.5`.
    ///
    /// # Errors
    /// If `sigma` is out of that range or not a number.
    pub fn new(sigma: f64) -> Result<Self, KernelError> {
        if (0.03..=0.5).contains(&sigma) {
            Ok(Self { sigma })
        } else {
            Err(KernelError { found: sigma })
        }
    }

    /// Thickness, dimensionless.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// `(A + i B) exp(-x^2 / 2) / (2 pi sigma)` at `u = eta / |xi|`: the kernel per unit of solid
    /// angle. `H` is its conjugate outside and minus itself inside (lambda = 1 and -1).
    pub fn unit(&self, u: f64) -> Complex64 {
        self.radial(u)[0] * u.powi(3)
    }

    /// `G(u) = unit(u) / u^3` and its first and second derivative with respect to `u`: the radial
    /// factor of the integrand `G(|r|) (r . n) dA` for `r = (p - q) / |xi|`.
    pub fn radial(&self, u: f64) -> [Complex64; 3] {
        let (s, u2) = (self.sigma, u * u);
        let w = 1.0 / (1.0 + u2);
        let x = (u - 1.0) / s;
        let e = (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI * s);
        // Real part (1 - u^2) w^2 / u = g, imaginary part 2 w^2 = f; derivatives by hand.
        let w2 = w * w;
        let g = (1.0 - u2) * w2 / u;
        let g1 = -(u2 + 1.0) * w2 / u2 - 4.0 * (1.0 - u2) * w2 * w;
        let g2 =
            2.0 * w / (u2 * u) + 2.0 * w2 / u + 8.0 * u * w2 * w + 24.0 * u * (1.0 - u2) * w2 * w2;
        let f = 2.0 * w2;
        let f1 = -8.0 * u * w2 * w;
        let f2 = -8.0 * w2 * w + 48.0 * u2 * w2 * w2;
        let (c, c1, c2) = (
            Complex64::new(g, f),
            Complex64::new(g1, f1),
            Complex64::new(g2, f2),
        );
        // e' = -x/s e, e'' = (x^2 - 1)/s^2 e.
        let (e1, e2) = (-x / s, (x * x - 1.0) / (s * s));
        [
            c * e,
            (c1 + c * e1) * e,
            (c2 + c1 * (2.0 * e1) + c * e2) * e,
        ]
    }

    /// `dK/dx = (1 - u^2, 2 u) exp(-x^2 / 2) / (2 pi (1 + u^2)^2)` as real and imaginary part, the
    /// integrand of the radial integral of a planar face. Continued analytically below `u = 1`.
    pub fn cumulative_slope(&self, x: f64) -> Complex64 {
        let u = 1.0 + self.sigma * x;
        let w = 1.0 / (1.0 + u * u);
        let e = (-0.5 * x * x).exp() * w * w / (2.0 * std::f64::consts::PI);
        Complex64::new(e * (1.0 - u * u), 2.0 * e * u)
    }

    /// The unit integrals `a + i b` of a half space: the density is `l1 (a - i b)` just outside a
    /// large flat face and `l2 (a + i b)` just inside.
    ///
    /// `a + i b = (1 / sigma) * integral over u from 1 of exp(-x^2 / 2) (1 - u^2 + 2 i u) /
    /// (1 + u^2)^2 du`, by composite quadrature to about 1e-14.
    pub fn half_space(&self) -> Complex64 {
        let rule = GaussLegendre::new(16);
        let turn = 2.0 * std::f64::consts::PI;
        let panel = |k: u32| {
            let slope = |(x, w)| self.cumulative_slope(x) * (w * turn);
            let terms = rule
                .on(0.5 * f64::from(k), 0.5 * f64::from(k + 1))
                .map(slope);
            terms.sum::<Complex64>()
        };
        (0..20).map(panel).sum()
    }

    /// `kappa = |a + i b|` of [`DensityKernel::half_space`]: the magnitude of the density at a
    /// large flat face.
    pub fn kappa(&self) -> f64 {
        self.half_space().norm()
    }
}

/// Tabulated cumulative kernel `K(x)`, the integral of [`DensityKernel::cumulative_slope`] from
/// far below, good to about 1e-13.
#[derive(Debug, Clone)]
pub(crate) struct CumulativeKernel {
    kernel: DensityKernel,
    values: Vec<Complex64>,
}

impl CumulativeKernel {
    /// Beyond this `|x|` the kernel is below 1e-16 of its peak.
    pub(crate) const REACH: f64 = 8.5;
    const INTERVALS: usize = 8000;
    const STEP: f64 = 2.0 * Self::REACH / Self::INTERVALS as f64;

    pub(crate) fn new(kernel: DensityKernel) -> Self {
        let rule = GaussLegendre::new(5);
        let mut values = Vec::with_capacity(Self::INTERVALS + 1);
        let mut sum = Complex64::ZERO;
        values.push(sum);
        for i in 0..Self::INTERVALS {
            let terms = rule.on(Self::node(i), Self::node(i + 1));
            sum += terms
                .map(|(x, w)| kernel.cumulative_slope(x) * w)
                .sum::<Complex64>();
            values.push(sum);
        }
        Self { kernel, values }
    }

    fn node(index: usize) -> f64 {
        -Self::REACH + Self::STEP * index as f64
    }

    pub(crate) fn kernel(&self) -> &DensityKernel {
        &self.kernel
    }

    /// `K(x)` by cubic Hermite interpolation; constant beyond the table.
    pub(crate) fn evaluate(&self, x: f64) -> Complex64 {
        let y = (x + Self::REACH) / Self::STEP;
        if y <= 0.0 {
            return Complex64::ZERO;
        }
        if y >= Self::INTERVALS as f64 {
            return self.total();
        }
        let (i, t) = (y as usize, y.fract());
        let slope = |i| self.kernel.cumulative_slope(Self::node(i)) * Self::STEP;
        let r = 1.0 - t;
        self.values[i] * ((1.0 + 2.0 * t) * r * r)
            + slope(i) * (t * r * r)
            + self.values[i + 1] * (t * t * (3.0 - 2.0 * t))
            + slope(i + 1) * (t * t * (t - 1.0))
    }

    /// `K` at infinity.
    pub(crate) fn total(&self) -> Complex64 {
        self.values[Self::INTERVALS]
    }
}
