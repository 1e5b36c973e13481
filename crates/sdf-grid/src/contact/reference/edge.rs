//! What an edge takes from the integral of the kernel over a plane.

use std::f64::consts::PI;

use glam::DVec3;

use super::kernel::ContactKernel;

/// A straight edge of a flat region.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    pub(crate) from: DVec3,
    pub(crate) to: DVec3,
    /// Unit vector to the other end, the region to its left seen from outside.
    pub(crate) along: DVec3,
    /// Unit vector in the plane, across the edge, out of the region.
    pub(crate) outward: DVec3,
    pub(crate) length: f64,
}

/// An integral of the kernel over a flat region as a function of where one stands, and its
/// gradient.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Potential {
    /// Metres (of `K`).
    pub(crate) value: f64,
    /// Dimensionless.
    pub(crate) gradient: DVec3,
}

/// Points and weights of Gauss and Legendre on 0 to 1.
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_23),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_23),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// Longest piece of an edge for one set of points, in widths.
const PANEL: f64 = 1.6;

impl Edge {
    /// None if the points are too near each other to have a direction.
    pub(crate) fn new(from: DVec3, to: DVec3, normal: DVec3) -> Option<Self> {
        let along = (to - from).try_normalize()?;
        Some(Self {
            from,
            to,
            along,
            outward: along.cross(normal),
            length: from.distance(to),
        })
    }

    /// The angle at which it is seen in its plane from above, counter-clockwise positive.
    pub(crate) fn angle(&self, p: DVec3) -> f64 {
        let from = self.from - p;
        let (across, start) = (from.dot(self.outward), from.dot(self.along));
        let end = start + self.length;
        (across * self.length).atan2(across * across + start * end)
    }

    /// `(1/2π) ∫ [K(h) - K(R)] dφ` along what of the edge is in reach of `at`, less
    /// `(1/2π) ∫ K(h) dφ`, where `h` is the height above the plane, `R` the distance of the edge's
    /// points and `φ` the direction in which they are seen in the plane.
    ///
    /// The Newtonian part of the kernel, `1/(8 π r)`, is in closed form; what is left is entire.
    pub(crate) fn taken(&self, kernel: &ContactKernel, height: f64, at: DVec3) -> Potential {
        let from = self.from - at;
        let (across, start) = (from.dot(self.outward), from.dot(self.along));
        let near = across * across + height * height;
        let visible = kernel.reach() * kernel.reach() - near;
        if visible <= 0.0 {
            return Potential::default();
        }
        let visible = visible.sqrt();
        let ends = [start.max(-visible), (start + self.length).min(visible)];
        if ends[1] <= ends[0] {
            return Potential::default();
        }
        let seen = Seen {
            height,
            across,
            ends,
            near,
        };
        let newtonian = seen.newtonian(kernel);
        let rest = seen.rest(kernel);
        let normal = self.outward.cross(self.along);
        Potential {
            value: (newtonian.value + rest.value) / (2.0 * PI),
            gradient: (normal * (newtonian.normal + rest.normal)
                - self.outward * (newtonian.across + rest.across))
                / (2.0 * PI),
        }
    }
}

/// An edge as seen from a point.
struct Seen {
    /// Of the point above the plane.
    height: f64,
    /// Distance of the edge's line from the foot of the point, positive if that is inside.
    across: f64,
    /// Places on the line, from where it is nearest.
    ends: [f64; 2],
    /// Squared distance of the line.
    near: f64,
}

/// Value, slope with the height, and slope with the distance across.
struct Slopes {
    value: f64,
    normal: f64,
    across: f64,
}

impl Seen {
    /// What `R/2 - |h|/2` gives of `K(h) - K(R)`, and all of `-K(h)`.
    fn newtonian(&self, kernel: &ContactKernel) -> Slopes {
        let [a, b] = self.ends;
        let (h, across) = (self.height.abs(), self.across);
        let [ra, rb] = [a, b].map(|l| (self.near + l * l).sqrt());
        // ∫ dl / R, from the end where nothing cancels.
        let logarithm = match a + b > 0.0 {
            true => ((rb + b) / (ra + a).max(f64::MIN_POSITIVE)).ln(),
            false => ((ra - a) / (rb - b).max(f64::MIN_POSITIVE)).ln(),
        };
        let angle = (across * (b - a)).atan2(across * across + a * b);
        let lifted = |l: f64, r: f64| (h * l).atan2(across.abs() * r);
        let lifted = (lifted(b, rb) - lifted(a, ra)).copysign(across) * unit(b - a);
        let sign = if self.height == 0.0 {
            0.0
        } else {
            self.height.signum()
        };
        let (plane, slope) = kernel.plane(self.height);
        Slopes {
            value: 0.5 * (across * logarithm + h * lifted - h * angle) - plane * angle,
            normal: -0.5 * sign * (angle - lifted) - slope * angle,
            across: 0.5 * logarithm,
        }
    }

    /// What the entire part gives of `K(h) - K(R)`.
    fn rest(&self, kernel: &ContactKernel) -> Slopes {
        let [a, b] = self.ends;
        let s = kernel.width();
        let squared = 1.0 / (s * s);
        let base = self.height * self.height * squared;
        let (k0, d0) = kernel.entire(base);
        let panels = ((b - a) / (PANEL * s)).ceil().max(1.0);
        let step = (b - a) / panels;
        let (mut value, mut normal, mut across) = (0.0, 0.0, 0.0);
        for panel in 0..panels as usize {
            for (place, weight) in GAUSS {
                let l = a + (panel as f64 + place) * step;
                let beyond = (self.across * self.across + l * l) * squared;
                let (k1, d1) = kernel.entire(base + beyond);
                let (quotient, second) = quotients(kernel, base, beyond, [k0, k1], [d0, d1]);
                value -= weight * quotient;
                normal -= weight * second;
                across -= weight * d1;
            }
        }
        Slopes {
            value: self.across * step * value / s,
            normal: self.across * step * normal * 2.0 * self.height * squared / s,
            across: 2.0 * step * across / s,
        }
    }
}

/// `(κ(w + d) - κ(w)) / d` and the same of `κ'`, where `d` may be small.
fn quotients(
    kernel: &ContactKernel,
    w: f64,
    d: f64,
    values: [f64; 2],
    slopes: [f64; 2],
) -> (f64, f64) {
    const SMALL: f64 = 1e-4;
    if d > SMALL {
        return ((values[1] - values[0]) / d, (slopes[1] - slopes[0]) / d);
    }
    let later = kernel.entire(w + 1e-3).1;
    (kernel.entire(w + 0.5 * d).1, (later - slopes[0]) / 1e-3)
}

/// Zero of nothing, else one: an edge without length is seen at no angle.
fn unit(length: f64) -> f64 {
    f64::from(u8::from(length > 0.0))
}
