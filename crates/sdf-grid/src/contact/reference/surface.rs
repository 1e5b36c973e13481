//! One part's surface, as the contact sum sees it from a point, face by face.

use glam::{DMat3, DVec3};

use super::edge::Edge;
use super::kernel::ContactKernel;
use crate::contact::samples::FLAT;
use crate::mesh::triangle_mesh::TriangleMesh;
use crate::surface::coplanar::outline::{Outline, outlines};

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
    /// The flat regions of `mesh` for densities that are smoothed together by a Gaussian of standard
    /// deviation `width` (metres, per axis).
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
