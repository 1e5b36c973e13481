//! Clusters of faces by their moments.

use glam::{DVec3, Vec3};

use crate::surface::face::Face;
use crate::surface::moments::Moments;

/// Moments of a cluster ([`Moments`]) in single precision, centre in double. Two cache lines.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub(crate) struct Cluster {
    pub(crate) centre: DVec3,
    pub(crate) radius: f32,
    pub(crate) spread: f32,
    /// Area vector, normal moment and its trace, cubic form, vector, from the indices below on.
    pub(crate) terms: [f32; TERMS],
}

/// Numbers in the expansion of a cluster, and where they begin.
pub(crate) const TERMS: usize = 23;
pub(super) const NORMAL_MOMENT: usize = 3;
pub(super) const TRACE: usize = 9;
pub(super) const CUBIC: usize = 10;
pub(super) const VECTOR: usize = 20;

impl Cluster {
    /// Of nothing.
    pub(crate) const EMPTY: Self = Self {
        centre: DVec3::ZERO,
        radius: 0.0,
        spread: 0.0,
        terms: [0.0; TERMS],
    };

    /// Of one face.
    pub(crate) fn of(face: &Face) -> Self {
        let faces = std::slice::from_ref(face);
        Self::new(&Moments::of(faces).bounded(faces))
    }

    /// Direction of the area vector.
    pub(crate) fn axis(&self) -> Vec3 {
        let area_vector = Vec3::from_slice(&self.terms[..3]);
        let axis = area_vector.as_dvec3().try_normalize();
        axis.unwrap_or(DVec3::Z).as_vec3()
    }

    pub(crate) fn new(m: &Moments) -> Self {
        let [xx, yy, zz, xy, xz, yz] = m.normal_moment;
        let mut terms = [0.0; TERMS];
        let mut set = |first: usize, values: &[f64]| {
            for (term, value) in terms[first..].iter_mut().zip(values) {
                *term = *value as f32;
            }
        };
        set(0, &m.area_vector.to_array());
        set(NORMAL_MOMENT, &[xx, yy, zz, 2.0 * xy, 2.0 * xz, 2.0 * yz]);
        set(TRACE, &[xx + yy + zz]);
        set(CUBIC, &m.cubic);
        set(VECTOR, &m.vector.to_array());
        Self {
            centre: m.centre,
            radius: m.radius as f32,
            spread: m.spread as f32,
            terms,
        }
    }
}
