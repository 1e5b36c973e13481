//! Exact densities just outside and just inside of a part, continued across its surface.

use glam::DVec3;
use num_complex::Complex64;
use sdf_grid::{Bvh, DensityKernel, TriangleMesh};

use super::contour::Contours;
use crate::halo::cut_off;
use crate::options::Densities;

/// A side of a part's surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Side {
    Out = 0,
    In = 1,
}

impl Side {
    pub(crate) const BOTH: [Self; 2] = [Self::Out, Self::In];

    pub(crate) fn from_distance(signed_distance: f64) -> Self {
        if signed_distance < 0.0 {
            Self::In
        } else {
            Self::Out
        }
    }
}

/// The unit exterior and interior density of a part at any point.
#[derive(Debug, Clone)]
pub(crate) struct OneSided {
    pub(crate) bvh: Bvh,
    mesh: TriangleMesh,
    density: Source,
    halo: f64,
    /// Largest extent, metres.
    size: f64,
}

#[derive(Debug, Clone)]
enum Source {
    Model(Contours),
    Constant([Complex64; 2]),
}

/// Points nearer to the surface than this, in sizes of the part, are on neither side.
const ON: f64 = 4e-9;

/// Shares of the mirrored distance that are tried where the mirror image of a point lies on the
/// wrong side, too: beyond a thin wall, or near an edge.
const SHARES: [f64; 4] = [1.0, 0.3, 0.05, 1e-3];

impl OneSided {
    pub(crate) fn new(
        mesh: &TriangleMesh,
        kernel: &DensityKernel,
        densities: Densities,
        halo: f64,
    ) -> Self {
        let density = match densities {
            Densities::Model => Source::Model(Contours::new(mesh, kernel)),
            Densities::Constant { exterior, interior } => Source::Constant([exterior, interior]),
        };
        Self {
            bvh: Bvh::build(mesh),
            mesh: mesh.clone(),
            density,
            halo,
            size: mesh.bounds().size().max_element(),
        }
    }

    /// The unit density of a side at `p`, dimensionless. Beyond
    /// the surface it is that at the mirror image of `p` across the nearest point of the surface:
    /// near a flat face the density does not change along the normal, so that this continues it.
    pub(crate) fn at(&self, p: DVec3, side: Side) -> Complex64 {
        if let Source::Constant(values) = self.density {
            return values[side as usize];
        }
        let xi = self.bvh.signed_distance(p);
        if self.is_on(xi, side) {
            return self.off_surface(p, xi, side);
        }
        let nearest = self.bvh.nearest(p);
        let away = nearest.point - p;
        let toward = if away.length() > 1e-7 * self.size {
            away.normalize()
        } else {
            let [a, b, c] = self.mesh.corners(nearest.triangle);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if side == Side::Out { normal } else { -normal }
        };
        for share in SHARES {
            let step = (share * away.length()).max(1e-6 * self.size);
            let image = nearest.point + toward * step;
            let xi = self.bvh.signed_distance(image);
            if self.is_on(xi, side) {
                return self.off_surface(image, xi, side);
            }
        }
        Complex64::ZERO
    }

    /// Whether the densities change from place to place.
    pub(crate) fn varies(&self) -> bool {
        matches!(self.density, Source::Model(_))
    }

    fn is_on(&self, xi: f64, side: Side) -> bool {
        xi.abs() > ON * self.size && Side::from_distance(xi) == side
    }

    fn off_surface(&self, p: DVec3, xi: f64, side: Side) -> Complex64 {
        let Source::Model(density) = &self.density else {
            return Complex64::ZERO;
        };
        if xi >= self.halo {
            return Complex64::ZERO;
        }
        let integral = density.at(p, xi.abs());
        match side {
            Side::Out => integral.conj() * cut_off(xi, self.halo),
            Side::In => -integral,
        }
    }
}
