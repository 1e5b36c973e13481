//! The short-range kernel of the splitting, integrated over planes.

/// The kernel is left out beyond this many widths: of its integral over a plane 4e-5 is left
/// there.
pub(crate) const REACH: f64 = 4.5;

/// Steps of the table per unit of squared distance over squared width.
const STEPS: f64 = 64.0;

/// What a product of two densities loses when both are smoothed, as a function of the distance
/// between two points of their surfaces: the solution of `-Δg = δ - (1 - s²/2 Δ) M`, with `M` the
/// Gaussian of variance `s²` per axis, which is
/// `g(r) = erfc(r / (√2 s)) / (4 π r) - s²/2 M(r)`.
///
/// Its integral over a whole plane at distance `x` is
///
/// `K(x) = s L(x/s) - s/2 φ(x/s) = s κ(x²/s²) - |x|/2`, `L(z) = φ(z) - |z| Φ(-|z|)`,
///
/// with `κ` an entire function; integrals over polygons follow from `K` alone.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ContactKernel {
    width: f64,
    /// `κ`, `κ'` and `κ''` at multiples of `1 / STEPS`.
    table: Vec<[f64; 3]>,
}

impl ContactKernel {
    /// The kernel for two densities smoothed together by a Gaussian of standard deviation `width`
    /// (metres, per axis).
    pub(crate) fn new(width: f64) -> Self {
        let entries = (STEPS * REACH * REACH) as usize + 3;
        let table = (0..entries).map(|i| entire(i as f64 / STEPS)).collect();
        Self { width, table }
    }

    /// Standard deviation of the smoothing, metres.
    pub(crate) fn width(&self) -> f64 {
        self.width
    }

    /// Distance beyond which the kernel is left out, metres.
    pub(crate) fn reach(&self) -> f64 {
        REACH * self.width
    }

    /// `κ` and `κ'` at a squared distance over the squared width; beyond reach those at its end.
    #[inline]
    pub(crate) fn entire(&self, w: f64) -> (f64, f64) {
        let u = w * STEPS;
        let i = (u as usize).min(self.table.len() - 2);
        let f = (u - i as f64).min(1.0);
        let (a, b) = (&self.table[i], &self.table[i + 1]);
        let g = 1.0 - f;
        // Cubic Hermite.
        let (p, q) = (g * g * (1.0 + 2.0 * f), f * f * (3.0 - 2.0 * f));
        let (r, t) = (f * g * g / STEPS, -f * f * g / STEPS);
        (
            p * a[0] + q * b[0] + r * a[1] + t * b[1],
            p * a[1] + q * b[1] + r * a[2] + t * b[2],
        )
    }

    /// `K` and its slope at a signed height above a plane, metres and dimensionless. On the plane
    /// itself, where the slope jumps, the mean of both sides: zero.
    #[inline]
    pub(crate) fn plane(&self, height: f64) -> (f64, f64) {
        let z = height / self.width;
        let (value, slope) = self.entire(z * z);
        let sign = if height == 0.0 { 0.0 } else { height.signum() };
        (
            self.width * value - 0.5 * height.abs(),
            2.0 * z * slope - 0.5 * sign,
        )
    }
}

/// `κ`, `κ'`, `κ''` at `w = z²`, from `(Φ(z) - 1/2) / z = φ(z) Σ z^2k / (2k + 1)!!`.
fn entire(w: f64) -> [f64; 3] {
    let density = (-0.5 * w).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let (mut sum, mut later, mut k) = (1.0, 0.0, 1.0);
    let (mut term, mut later_term) = (1.0, 1.0 / 3.0);
    while term > 1e-18 * sum {
        term *= w / (2.0 * k + 1.0);
        sum += term;
        later += later_term;
        k += 1.0;
        later_term *= w / (2.0 * k + 1.0);
    }
    // (Φ - 1/2)/z, and its derivative by w, twice.
    let (middle, bend) = (density * sum, -density * (later + later_term));
    [
        0.5 * density + w * middle,
        0.5 * middle + 0.25 * density,
        0.25 * bend - 0.125 * density,
    ]
}
