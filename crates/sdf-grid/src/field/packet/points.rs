//! Packets of sixteen points.

use fearless_simd::f32x16;
use fearless_simd::prelude::*;
use glam::{DVec3, Vec3};

/// Points per packet. Fastest on compact groups such as 2 x 2 x 4 neighbours.
pub(crate) const LANES: usize = 16;

/// One number per point.
pub(crate) type Lanes = [f32; LANES];

/// Sixteen normalized positions: the middle of their box, and where they lie from it.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct Points {
    places: [Lanes; 3],
    pub(crate) centre: DVec3,
    /// Half the size of the box, a little more: rounding must not lose a point.
    half: Vec3,
}

impl Points {
    pub(crate) fn new(points: &[DVec3; LANES]) -> Self {
        let low = points.iter().fold(points[0], |a, p| a.min(*p));
        let high = points.iter().fold(points[0], |a, p| a.max(*p));
        let centre = 0.5 * (low + high);
        let place = |k: usize| points.map(|p| (p[k] - centre[k]) as f32);
        Self {
            places: [0, 1, 2].map(place),
            centre,
            half: (0.5 * (high - low)).as_vec3() * 1.000_001,
        }
    }

    /// Half the diagonal of their box.
    pub(crate) fn half_diagonal(&self) -> f32 {
        self.half.length()
    }
}

/// Points as vectors.
pub(crate) struct Packet<S: Simd> {
    pub(crate) simd: S,
    pub(crate) centre: DVec3,
    pub(crate) x: f32x16<S>,
    pub(crate) y: f32x16<S>,
    pub(crate) z: f32x16<S>,
    /// Half the size of the box of points.
    pub(crate) half: Vec3,
}

impl<S: Simd> Packet<S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, points: &Points) -> Self {
        let [x, y, z] = &points.places;
        Self {
            simd,
            centre: points.centre,
            x: f32x16::simd_from(simd, *x),
            y: f32x16::simd_from(simd, *y),
            z: f32x16::simd_from(simd, *z),
            half: points.half,
        }
    }

    /// Of sixteen times the same point.
    #[inline(always)]
    pub(crate) fn of_one(simd: S, point: DVec3) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        Self {
            simd,
            centre: point,
            x: zero,
            y: zero,
            z: zero,
            half: Vec3::ZERO,
        }
    }

    #[inline(always)]
    pub(crate) fn splat(&self, value: f32) -> f32x16<S> {
        f32x16::splat(self.simd, value)
    }

    /// `base + p . v` for every point `p`.
    #[inline(always)]
    pub(crate) fn dot_add(&self, v: Vec3, base: f32) -> f32x16<S> {
        let z = self.z.mul_add(self.splat(v.z), self.splat(base));
        self.x
            .mul_add(self.splat(v.x), self.y.mul_add(self.splat(v.y), z))
    }

    /// Distance of coordinates from an interval, zero in it.
    #[inline(always)]
    fn gap(&self, p: f32x16<S>, lo: f32, hi: f32) -> f32x16<S> {
        (self.splat(lo) - p)
            .max(p - self.splat(hi))
            .max(self.splat(0.0))
    }

    /// Squared distance of every point from a box.
    #[inline(always)]
    pub(crate) fn box_distance_squared(&self, [lo, hi]: [Vec3; 2]) -> f32x16<S> {
        let x = self.gap(self.x, lo.x, hi.x);
        let y = self.gap(self.y, lo.y, hi.y);
        let z = self.gap(self.z, lo.z, hi.z);
        x.mul_add(x, y.mul_add(y, z * z))
    }
}
