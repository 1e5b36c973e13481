//! The sum of a point set over a lattice.

use fearless_simd::Level;
use glam::DVec3;
use num_complex::Complex64;

use super::grid::LookupGrid;
use super::map::Map;
use super::points::PointSet;
use super::{quadratic, trilinear};
use crate::geometry::se3::Pose;
use crate::level::dispatch_lanes;
use crate::pair::reading::Reading;

/// Sum of weighted lookups and its first derivatives, in the looked-up part's frame.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::direct) struct Sums {
    /// `Σ w v`, with imaginary part only if asked for.
    pub(in crate::direct) score: Complex64,
    /// `Re Σ w ∇v`, per metre.
    pub(in crate::direct) gradient: DVec3,
    /// `Re Σ r × w ∇v`, r from the image of the points' frame origin.
    pub(in crate::direct) moment: DVec3,
}

/// Sums `points`, moved by `motion` into the grid's frame, over `grid`; the imaginary part of the
/// score only if `IMAGINARY`.
pub(in crate::direct) fn sum<const IMAGINARY: bool>(
    level: Level,
    points: &PointSet,
    grid: &LookupGrid,
    motion: &Pose,
) -> Sums {
    let map = Map::new(points, grid, motion);
    let mut totals = [0.0f64; 8];
    match grid.reading {
        Reading::Trilinear => dispatch_lanes!(level, simd =>
            trilinear::sum_clusters::<_, IMAGINARY>(simd, points, grid, &map, &mut totals)),
        Reading::Quadratic => dispatch_lanes!(level, simd =>
            quadratic::sum_clusters::<_, IMAGINARY>(simd, points, grid, &map, &mut totals)),
    }
    let [re, im, gx, gy, gz, mx, my, mz] = totals;
    // The kernel differentiates per grid spacing and takes levers, in that unit, about the set's
    // centre.
    let gradient = DVec3::new(gx, gy, gz) / grid.spacing;
    let lever = motion.rotation * points.centre;
    Sums {
        score: Complex64::new(re, im),
        gradient,
        moment: DVec3::new(mx, my, mz) + lever.cross(gradient),
    }
}
