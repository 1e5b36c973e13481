//! The sum over one part's surface of what the other's surface is there.

use glam::{DMat3, DQuat, DVec3};

use super::error::ContactError;
use super::samples::{SurfaceSample, surface_samples};
use super::surface::ContactSurface;
use crate::mesh::triangle_mesh::TriangleMesh;

/// The sum over both surfaces of two parts, `∬ (n1·n2) g(|q - y|) dA1 dA2`, at any pose of one part
/// in the frame of the other.
#[derive(Debug, Clone)]
pub struct ContactSum {
    surface: ContactSurface,
    samples: Vec<SurfaceSample>,
}

/// A contact sum and its derivatives, for densities that jump by one across both surfaces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactSums {
    /// The sum, cubic metres.
    pub value: f64,
    /// Its derivative by the translation, square metres.
    pub gradient: DVec3,
    /// Its derivative by a rotation of the sampled part about the origin of its own frame, along
    /// the axes of the surface's frame; cubic metres per radian.
    pub moment: DVec3,
}

impl ContactSum {
    /// Prepares the sum over `sampled`, in pieces at most `distance` wide, of what `surface` is
    /// there, for densities that are smoothed together by a Gaussian of standard deviation `width`
    /// (both metres).
    ///
    /// # Errors
    /// If a length is not positive and finite, a mesh has no triangle with an area, or there would
    /// be too many pieces or too many faces in reach.
    pub fn new(
        surface: &TriangleMesh,
        sampled: &TriangleMesh,
        width: f64,
        distance: f64,
    ) -> Result<Self, ContactError> {
        Ok(Self {
            surface: ContactSurface::new(surface, width)?,
            samples: surface_samples(sampled, distance)?,
        })
    }

    /// Distance between the surfaces beyond which the sum is zero, metres.
    pub fn reach(&self) -> f64 {
        self.surface.reach()
    }

    /// Memory that is held, bytes.
    pub fn bytes(&self) -> usize {
        self.surface.bytes() + size_of_val(self.samples.as_slice())
    }

    /// The sum where `y` of the sampled part's frame lies at `rotation * y + translation` of the
    /// surface's frame, and its exact derivatives.
    pub fn sum(&self, rotation: DQuat, translation: DVec3) -> ContactSums {
        let turn = DMat3::from_quat(rotation);
        let mut sums = ContactSums::default();
        for sample in &self.samples {
            let (lever, area) = (turn * sample.position, turn * sample.area);
            let Some(flux) = self.surface.flux(lever + translation) else {
                continue;
            };
            let gradient = flux.slope.transpose() * area;
            sums.value += area.dot(flux.value);
            sums.gradient += gradient;
            sums.moment += lever.cross(gradient) + area.cross(flux.value);
        }
        sums
    }
}
