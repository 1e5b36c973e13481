//! What a pair's score loses by smoothing: a sum over both surfaces.

use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{
    ContactError, ContactSum, DensityKernel, FieldProvenance, KernelError, Sampling, TriangleMesh,
};

use crate::geometry::se3::Pose;
use crate::geometry::side::Side;
use crate::pair::model::{PairProvenance, ScoreModel};
use crate::pair::region::ContactRegion;

/// Variance, in squared spacings, that reading a lattice by quadratic B-splines adds.
const READING: f64 = 0.25;

/// Distance between samples of a surface, in spacings.
const SAMPLES: f64 = 2.0;

/// How the densities of a pair are smoothed, so that lattices can hold them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Smoothing {
    /// Standard deviation per axis of the Gaussian, metres.
    deviation: f64,
    /// Lattice spacing, metres.
    spacing: f64,
}

impl Smoothing {
    /// What provenances of both densities say, if they are smoothed.
    pub(crate) fn of_provenance(provenance: &PairProvenance) -> Option<Self> {
        match provenance.fixed.as_ref()? {
            FieldProvenance {
                sampling: Sampling::Smoothed { deviation, .. },
                lattice,
                ..
            } => Some(Self {
                deviation: *deviation,
                spacing: lattice.spacing(),
            }),
            _ => None,
        }
    }

    /// By a Gaussian of `deviation` spacings.
    pub(crate) fn new(deviation: f64, spacing: f64) -> Self {
        Self {
            deviation: deviation * spacing,
            spacing,
        }
    }

    /// The standard deviation of the Gaussian, spacings.
    pub(crate) fn in_spacings(&self) -> f64 {
        self.deviation / self.spacing
    }

    /// The standard deviation per axis by which the product of both densities is smoothed in all,
    /// metres: each by its own Gaussian, and one by being read between its nodes.
    pub(crate) fn width(&self) -> f64 {
        let variance = 2.0 * self.deviation.powi(2) + READING * self.spacing.powi(2);
        variance.sqrt()
    }

    /// How the fixed part's density is sampled: sharpened by all that the product is smoothed.
    pub(crate) fn of_fixed(&self) -> Sampling {
        Sampling::Smoothed {
            deviation: self.deviation,
            sharpening: self.width().powi(2),
        }
    }

    /// How the moving part's density is sampled.
    pub(crate) fn of_moving(&self) -> Sampling {
        Sampling::Smoothed {
            deviation: self.deviation,
            sharpening: 0.0,
        }
    }

    /// Distance between the samples of a surface, metres.
    fn samples(&self) -> f64 {
        SAMPLES * self.spacing
    }

    /// How far beyond a part's surface its smoothed density reaches, metres: that of the fixed part,
    /// which reaches farther.
    pub(crate) fn reach(&self) -> f64 {
        self.of_fixed().spread()
    }
}

/// The short-range part of a pair's score: what jumps of the densities lose by smoothing.
///
/// `V ∬ (n1·n2) g(|q - y|) dA1 dA2` over both surfaces, with `g` the kernel of
/// [`sdf_grid::ContactSum`] and `V` the jump of the product of densities across both surfaces at
/// once (`docs/conventions.md`).
#[derive(Debug, Clone)]
pub struct Contact {
    sum: Arc<ContactSum>,
    /// The fixed and the moving part.
    parts: [Arc<TriangleMesh>; 2],
    smoothing: Smoothing,
    /// Whose surface is made of samples.
    sampled: Side,
    jump: f64,
    /// Most bytes that are kept of what poses come to.
    pub(crate) kept: u64,
}

impl PartialEq for Contact {
    /// Of the same parts, smoothed alike, under the same model.
    fn eq(&self, other: &Self) -> bool {
        let of = |c: &Self| (c.smoothing, c.jump.to_bits());
        of(self) == of(other) && self.parts == other.parts
    }
}

/// A score and its derivatives by the moving part's motion, fixed frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ContactScore {
    /// Cubic metres.
    pub(crate) score: f64,
    /// By the translation, square metres.
    pub(crate) gradient: DVec3,
    /// By a rotation about the moving part's origin, cubic metres per radian.
    pub(crate) moment: DVec3,
}

impl Contact {
    /// Of two parts under a model with this [`jump`]; the part with the smaller surface is sampled. Of
    /// what poses come to, about `kept` bytes at most are kept.
    ///
    /// # Errors
    /// As [`ContactSum::new`].
    pub(crate) fn new(
        parts: [Arc<TriangleMesh>; 2],
        smoothing: &Smoothing,
        jump: f64,
        kept: u64,
    ) -> Result<Self, ContactError> {
        let [fixed, moving] = &parts;
        let sampled = match fixed.area() < moving.area() {
            true => Side::Fixed,
            false => Side::Moving,
        };
        let (surface, samples) = match sampled {
            Side::Fixed => (moving, fixed),
            Side::Moving => (fixed, moving),
        };
        let sum = ContactSum::new(surface, samples, smoothing.width(), smoothing.samples())?;
        Ok(Self {
            sum: Arc::new(sum.keeping(kept)),
            parts,
            smoothing: *smoothing,
            sampled,
            jump,
            kept,
        })
    }

    /// Looks ahead at what poses in a region reach: at these [`Contact::score`] then allocates
    /// nothing.
    pub(crate) fn prepare(&self, region: &ContactRegion) {
        let sampled = match self.sampled {
            Side::Fixed => &self.parts[0],
            Side::Moving => &self.parts[1],
        };
        let region = region.of(self.sampled.other(), &sampled.bounds());
        self.sum.prepare(region.as_ref());
    }

    /// The same surfaces under another model.
    pub(crate) fn with_jump(&self, jump: f64) -> Self {
        Self {
            jump,
            ..self.clone()
        }
    }

    /// The fixed and the moving part, each in its own frame.
    pub(crate) fn parts(&self) -> [&TriangleMesh; 2] {
        [&self.parts[0], &self.parts[1]]
    }

    /// How both densities are smoothed.
    pub(crate) fn smoothing(&self) -> &Smoothing {
        &self.smoothing
    }

    /// Memory that is held, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.sum.bytes() as u64
    }

    /// The score that smoothing takes at a pose.
    pub(crate) fn score(&self, pose: &Pose) -> ContactScore {
        let part = match self.sampled {
            Side::Moving => {
                let sums = self.sum.sum(pose.rotation, pose.translation);
                ContactScore {
                    score: sums.value,
                    gradient: sums.gradient,
                    moment: sums.moment,
                }
            }
            Side::Fixed => {
                let inverse = pose.inverse();
                let sums = self.sum.sum(inverse.rotation, inverse.translation);
                // The fixed part moves against the moving one: see `seen_from_fixed`.
                let about_origin = sums.moment + inverse.translation.cross(sums.gradient);
                ContactScore {
                    score: sums.value,
                    gradient: -(pose.rotation * sums.gradient),
                    moment: -(pose.rotation * about_origin),
                }
            }
        };
        ContactScore {
            score: self.jump * part.score,
            gradient: self.jump * part.gradient,
            moment: self.jump * part.moment,
        }
    }
}

/// The jump of the product of densities where both surfaces coincide: with `a + i b` the unit
/// densities of a half space, `l2² (a² - b²) - 2 l1 l2 (a² + b²) + w l1² (a² - b²)`.
///
/// # Errors
/// If the model's sigma is out of range.
pub(crate) fn jump(model: &ScoreModel) -> Result<f64, KernelError> {
    let side = DensityKernel::new(model.sigma)?.half_space();
    let (alike, opposite) = ((side * side).re, side.norm_sqr());
    let (outer, inner) = (model.lambda_exterior, model.lambda_interior);
    Ok(inner * inner * alike - 2.0 * outer * inner * opposite
        + model.separation_weight * outer * outer * alike)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use sdf_grid::shapes;

    use super::*;
    use crate::geometry::se3::Twist;

    /// Which part is sampled follows from their sizes; the score does not depend on it beyond what
    /// samples a spacing apart leave, and its derivatives are those of differences.
    #[test]
    fn either_part_may_be_sampled() {
        let small = shapes::cuboid(DVec3::new(0.010, 0.012, 0.009)).unwrap();
        let large = shapes::cuboid(DVec3::new(0.018, 0.014, 0.016)).unwrap();
        let smoothing = Smoothing::new(0.6, 0.5e-3);
        let rotation = DQuat::from_scaled_axis(DVec3::new(0.2, -0.3, 0.1));
        let pose = Pose::new(rotation, DVec3::new(0.0135, 0.001, -0.0006));
        let [small, large] = [small, large].map(Arc::new);
        let of =
            |parts: [&Arc<_>; 2]| Contact::new(parts.map(Arc::clone), &smoothing, 2.0, 1 << 30);
        let one = of([&large, &small]).unwrap();
        let other = of([&small, &large]).unwrap();
        assert_eq!((one.sampled, other.sampled), (Side::Moving, Side::Fixed));
        let (a, b) = (one.score(&pose), other.score(&pose.inverse()));
        assert!(a.score.abs() > 5e-11, "in contact: {a:?}");
        // Of the largest that this contact could have: 120 mm² times K(0) of 0.36 mm.
        assert!(
            (a.score - b.score).abs() < 1e-2 * 2.0 * 0.7e-8,
            "{a:?} {b:?}"
        );
        for contact in [&one, &other] {
            let pose = match contact.sampled {
                Side::Moving => pose,
                Side::Fixed => pose.inverse(),
            };
            let found = contact.score(&pose);
            let slopes = |step: f64, of: fn(DVec3, f64) -> Twist| {
                DVec3::from_array([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
                    let at = |s: f64| contact.score(&pose.perturbed(&of(axis, s))).score;
                    (at(step) - at(-step)) / (2.0 * step)
                }))
            };
            let linear = slopes(1e-6, |axis, s| Twist {
                angular: DVec3::ZERO,
                linear: s * axis,
            });
            let angular = slopes(1e-4, |axis, s| Twist {
                angular: s * axis,
                linear: DVec3::ZERO,
            });
            // Samples that cross an edge within a step leave some thousandths.
            assert!((linear - found.gradient).length() < 1e-2 * linear.length());
            assert!((angular - found.moment).length() < 1e-2 * angular.length());
        }
    }
}
