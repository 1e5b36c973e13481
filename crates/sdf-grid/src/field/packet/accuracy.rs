//! Truncation and acceptance parameters of the tree code for a tolerance.

/// Truncation and acceptance, found by measuring the relative L2 error on parts and random solids.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Accuracy {
    /// Kernel widths beyond which a boundary point does not count.
    pub(crate) reach: f64,
    /// Which clusters are far.
    pub(crate) far: AcceptanceLimit,
    /// The same where clusters cancel: front and back of thin parts.
    pub(crate) far_cancelling: AcceptanceLimit,
    /// Gauss points per half edge length in units of the length over which the integrand varies.
    pub(crate) density: f64,
}

/// Which clusters are far.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AcceptanceLimit {
    /// A cluster is far if its size in kernel widths is below this.
    pub(crate) size: f64,
    /// Seen from its front, a cluster's distances vary with the square of the place, of which the
    /// expansion has only the first power: what that square weighs in the size beyond its half, by
    /// which distances vary.
    pub(crate) front: f64,
    /// And that size times its spread of normals, seen from the point, below this.
    pub(crate) bend: f64,
}

impl AcceptanceLimit {
    const fn new(size: f64, front: f64, bend: f64) -> Self {
        Self { size, front, bend }
    }

    /// Part of the way to another, in the logarithm.
    fn towards(self, other: Self, part: f64) -> Self {
        let power = |a: f64, b: f64| a * (b / a).powf(part);
        Self {
            size: power(self.size, other.size),
            front: power(self.front, other.front),
            bend: power(self.bend, other.bend),
        }
    }
}

/// Settings for one tolerance. Limits are those for kernels up to [`NARROW`]. From [`WIDE`] on
/// clusters may be bent more, up to `wide_bend`, but where they cancel (measured).
struct Row {
    reach: f64,
    far: AcceptanceLimit,
    wide_bend: f64,
    far_cancelling: AcceptanceLimit,
    density: f64,
}

const NARROW: f64 = 0.03;
const WIDE: f64 = 0.1;

/// For 1e-2, 1e-3, 1e-4 and 1e-5. Between them, and between kernels, limits are interpolated in the
/// logarithm.
const TABLE: [Row; 4] = [
    Row {
        reach: 2.7,
        far: AcceptanceLimit::new(1.9, 1.5, 0.039),
        wide_bend: 0.1,
        far_cancelling: AcceptanceLimit::new(1.5, 1.5, 0.013),
        density: 1.2,
    },
    Row {
        reach: 3.6,
        far: AcceptanceLimit::new(1.95, 3.5, 0.018),
        wide_bend: 0.047,
        far_cancelling: AcceptanceLimit::new(1.5, 3.5, 0.009),
        density: 1.6,
    },
    Row {
        reach: 4.5,
        far: AcceptanceLimit::new(0.7, 4.5, 0.0036),
        wide_bend: 0.0072,
        far_cancelling: AcceptanceLimit::new(0.7, 4.5, 0.0018),
        density: 2.5,
    },
    Row {
        reach: 5.2,
        far: AcceptanceLimit::new(0.23, 4.5, 0.0007),
        wide_bend: 0.0011,
        far_cancelling: AcceptanceLimit::new(0.23, 4.5, 0.0005),
        density: 4.9,
    },
];

impl Accuracy {
    /// For a relative L2 error of `tolerance` with kernels of thickness `sigma`.
    pub(crate) fn new(tolerance: f64, sigma: f64) -> Self {
        let place = (-tolerance.log10() - 2.0).clamp(0.0, 3.0);
        let i = (place as usize).min(2);
        let f = place - i as f64;
        let (a, b) = (&TABLE[i], &TABLE[i + 1]);
        let line = |a: f64, b: f64| a + (b - a) * f;
        let breadth = ((sigma / NARROW).ln() / (WIDE / NARROW).ln()).clamp(0.0, 1.0);
        let bent = |row: &Row| {
            let wide = AcceptanceLimit {
                bend: row.wide_bend,
                ..row.far
            };
            row.far.towards(wide, breadth)
        };
        Self {
            // The wider the kernel, the more front and back of thin parts cancel, and the more
            // the tail of the kernel shows.
            reach: line(a.reach, b.reach) + 1.4 * sigma,
            far: bent(a).towards(bent(b), f),
            far_cancelling: a.far_cancelling.towards(b.far_cancelling, f),
            density: line(a.density, b.density),
        }
    }
}
