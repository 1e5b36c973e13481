//! Reference for the contact sum in double precision, face by face and edge by edge; the fast sum
//! is tested against it.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use crate::contact::samples::FLAT;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outline::{Outline, outlines};

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

/// The surface of a part: flat regions with their edges.
#[derive(Debug, Clone)]
pub(crate) struct ContactSurface {
    kernel: ContactKernel,
    regions: Vec<Region>,
}

#[derive(Debug, Clone)]
struct Region {
    normal: DVec3,
    /// Of the plane from the origin along its normal.
    offset: f64,
    edges: Vec<Edge>,
}

/// What a surface is as seen from a point: `u = ∮ n g dA` and its derivatives by the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Flux {
    /// `u`, metres.
    pub(crate) value: DVec3,
    /// `∂u_i / ∂y_j` in column `j`, dimensionless.
    pub(crate) slope: DMat3,
}

impl ContactSurface {
    /// The flat regions of `mesh` for densities that are smoothed together by a Gaussian of
    /// standard deviation `width` (metres, per axis).
    pub(crate) fn new(mesh: &TriangleMesh, width: f64) -> Self {
        let flat = FLAT * mesh.bounds().size().max_element();
        let found = outlines(mesh.triangles(), mesh.vertices(), flat);
        Self {
            kernel: ContactKernel::new(width),
            regions: found.iter().map(Region::new).collect(),
        }
    }

    /// `u` and its derivatives at a point of the part's frame.
    ///
    /// On a face, where the slope jumps, the mean of both sides.
    pub(crate) fn flux(&self, p: DVec3) -> Flux {
        let mut flux = Flux {
            value: DVec3::ZERO,
            slope: DMat3::ZERO,
        };
        for region in &self.regions {
            let height = p.dot(region.normal) - region.offset;
            if height.abs() >= self.kernel.reach() {
                continue;
            }
            // How often the region lies below the point.
            let turns: f64 = region.edges.iter().map(|e| e.angle(p)).sum();
            let inside = (turns / std::f64::consts::TAU).round();
            let (k, dk) = self.kernel.plane(height);
            let (mut value, mut slope) = (inside * k, region.normal * (inside * dk));
            for edge in &region.edges {
                let taken = edge.taken(&self.kernel, height, p);
                value += taken.value;
                slope += taken.gradient;
            }
            flux.value += region.normal * value;
            flux.slope += DMat3::from_cols(
                region.normal * slope.x,
                region.normal * slope.y,
                region.normal * slope.z,
            );
        }
        flux
    }
}

impl Region {
    fn new(outline: &Outline) -> Self {
        let sides = outline.rings.iter().flat_map(|ring| {
            let next = ring.iter().cycle().skip(1);
            ring.iter().zip(next)
        });
        Self {
            normal: outline.normal,
            offset: outline.normal.dot(outline.origin),
            edges: sides
                .filter_map(|(a, b)| Edge::new(*a, *b, outline.normal))
                .collect(),
        }
    }
}

mod tests {
    use super::*;

    use glam::DQuat;

    use crate::contact::samples::{SurfaceSample, surface_samples};
    use crate::mesh::shapes;

    /// Density and distribution of the normal distribution, the latter by integrating the former.
    fn normal(x: f64) -> [f64; 2] {
        let density = |t: f64| (-0.5 * t * t).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let steps = 2000;
        let step = x / f64::from(steps);
        let sum: f64 = (0..steps)
            .map(|i| density((f64::from(i) + 0.5) * step))
            .sum();
        [density(x), 0.5 + sum * step]
    }

    /// Length of the overlap of two intervals of half lengths `a`, `b` whose middles are `t` apart,
    /// averaged over Gaussian displacements of variance `v`.
    fn overlap(t: f64, a: f64, b: f64, v: f64) -> f64 {
        let s = v.sqrt();
        let ramp = |x: f64| {
            let [density, below] = normal(x / s);
            x * below + s * density
        };
        ramp(t + a + b) - ramp(t + a - b) - ramp(t - a + b) + ramp(t - a - b)
    }

    /// What the sum must be for two boxes along the axes: the overlap less the smoothed and
    /// sharpened one.
    fn lost(a: DVec3, b: DVec3, at: DVec3, width: f64) -> f64 {
        let exact: f64 = (0..3)
            .map(|k| (a[k].min(at[k] + b[k]) - (-a[k]).max(at[k] - b[k])).max(0.0))
            .product();
        let v = width * width;
        let smoothed = |v: f64| {
            (0..3)
                .map(|k| overlap(at[k], a[k], b[k], v))
                .product::<f64>()
        };
        let slope = (smoothed(1.001 * v) - smoothed(0.999 * v)) / (2e-3 * v);
        exact - (smoothed(v) - v * slope)
    }

    fn sum(surface: &ContactSurface, samples: &[SurfaceSample], at: DVec3) -> f64 {
        let seen = |s: &SurfaceSample| surface.flux(s.position + at).value.dot(s.area);
        samples.iter().map(seen).sum()
    }

    /// With faces, edges and corners in reach of one another; sampled finely, so that what differs
    /// is the midpoint rule (second order) and the end of the reach. Both boxes along the axes, for
    /// which the closed form holds, and both turned and shifted with them.
    #[test]
    fn two_boxes_lose_what_smoothing_takes() {
        let (a, b) = (DVec3::new(2.0, 1.5, 1.2), DVec3::new(1.0, 1.7, 0.8));
        let solid = |half: DVec3| shapes::cuboid(2.0 * half).unwrap();
        let width = 0.4;
        let surface = ContactSurface::new(&solid(a), width);
        let samples = surface_samples(&solid(b), 0.05).unwrap();
        let area: f64 = samples.iter().map(|s| s.area.length()).sum();
        assert!((area - solid(b).area()).abs() < 1e-9 * area);
        let turn = DQuat::from_scaled_axis(DVec3::new(-0.3, 1.1, 0.6));
        let shift = DVec3::new(3.0, -7.0, 0.4);
        let turned = ContactSurface::new(&solid(a).transformed(turn, shift), width);
        let turned_samples = surface_samples(&solid(b).transformed(turn, shift), 0.05).unwrap();
        for at in [
            DVec3::new(0.3, 0.1, 0.2),
            DVec3::new(1.0, 0.2, 0.4),
            DVec3::new(2.9, 3.1, 1.9),
            DVec3::new(2.4, 2.6, 1.5),
            DVec3::new(3.0, 0.1, 0.0),
        ] {
            let expected = lost(a, b, at, width);
            for found in [
                sum(&surface, &samples, at),
                sum(&turned, &turned_samples, turn * at),
            ] {
                assert!(
                    (found - expected).abs() < 2e-3 * expected.abs() + 2e-5,
                    "{at}: {found} instead of {expected}"
                );
            }
        }
    }

    #[test]
    fn planes_have_the_unit_normal_loss() {
        let kernel = ContactKernel::new(0.7);
        for x in [-2.0f64, -0.3, 0.0, 0.1, 0.9, 3.0] {
            let z = x.abs() / 0.7;
            let [density, below] = normal(z);
            let expected = 0.7 * (density - z * (1.0 - below)) - 0.35 * density;
            assert!((kernel.plane(x).0 - expected).abs() < 1e-7, "{x}");
            let h = 1e-5;
            let slope = (kernel.plane(x + h).0 - kernel.plane(x - h).0) / (2.0 * h);
            assert!((kernel.plane(x).1 - slope).abs() < 1e-6, "{x}");
        }
    }

    /// A turned body with concave edges, seen from everywhere near it: slopes are those of
    /// differences, and the flux is that of the surface moved along.
    #[test]
    fn slopes_are_those_of_differences_in_every_frame() {
        let (hole, _) = shapes::PegInHole::Combined.pair(1e-4).unwrap();
        let width = 1.1e-3;
        let surface = ContactSurface::new(&hole, width);
        let (turn, shift) = (
            DQuat::from_scaled_axis(DVec3::new(0.5, -0.8, 0.3)),
            DVec3::new(0.013, -0.004, 0.021),
        );
        let moved = ContactSurface::new(&hole.transformed(turn, shift), width);
        let mut seen = 0;
        for i in 0..2000 {
            let place = DVec3::new(
                f64::from(i % 13),
                f64::from(i / 13 % 13),
                f64::from(i / 169),
            );
            let p = DVec3::new(0.042, 0.0417, 0.033) * (place / 12.0 - 0.5) + 1.7e-5;
            let Flux { value, slope } = surface.flux(p);
            let there = moved.flux(turn * p + shift);
            assert!((there.value - turn * value).length() < 1e-6 * width, "{p}");
            if value == DVec3::ZERO {
                continue;
            }
            seen += 1;
            let h = 1e-7;
            let at = |q: DVec3| surface.flux(q).value;
            let column = |d: DVec3| (at(p + d * h) - at(p - d * h)) / (2.0 * h);
            let differences =
                DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
            let off = (slope - differences).to_cols_array().map(f64::abs);
            let most = off.into_iter().fold(0.0, f64::max);
            assert!(most < 1e-3, "{p}: {slope} instead of {differences}");
        }
        assert!(seen > 500, "{seen}");
    }
}
