//! Two parts and the model between them: what every scorer works on.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use ndarray::ArrayViewMut3;
use rayon::prelude::*;
use sdf_grid::{Aabb, DensityField, DensityKernel, FieldCache, KernelError, Lattice, Sampling};
use serde::Serialize;

use crate::geometry::se3::Pose;
use crate::geometry::side::Side;
use crate::geometry::translation::TranslationWindow;
use crate::pair::contact::{Contact, jump};
use crate::pair::interpolation::Interpolation;
use crate::pair::model::{ModelError, PairProvenance, ScoreModel};
use crate::pair::region::{ContactRegion, PoseWindow};

/// The fixed and the moving part's densities, the model, and the moving part's pivot.
///
/// The score splits into two products (`docs/conventions.md`):
/// `A1 * B1 + A2 * B2` with `A1 = l1 O1 + l2 I1`, `B1 = l2 I2`, `A2 = w l1 O1 + l2 I1`,
/// `B2 = l1 O2`; for separation weight `w = 1` they merge into one, for `w = 0` every product has
/// an interior factor and the integral runs over the two solids only.
///
/// ```
/// use fft_correlate::{PairBuilder, ScoreModel};
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// assert!(pair.is_whole() && pair.nodes().computed == pair.nodes().whole);
/// // A turn, and the pivot 3 mm higher than in the fit.
/// let pose = pair.pose(DQuat::from_rotation_x(0.5), DVec3::Z * 0.003);
/// assert!((pair.displacement(&pose) - DVec3::Z * 0.003).length() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Pair {
    fixed: Arc<DensityField>,
    moving: Arc<DensityField>,
    model: ScoreModel,
    pivot: DVec3,
    contact: Option<Contact>,
    /// Whose cells are the points of a product that either part could give them for, if the meshes
    /// decide it.
    points: Option<Side>,
    /// The part of whose density only some is there.
    partial: Option<Partial>,
    /// Where its fields came from, and where those of coarser lattices are looked for.
    cache: Option<FieldCache>,
}

/// The part of whose density only some is there, which may hold no interior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Partial {
    /// Which part.
    pub(crate) side: Side,
    /// The lattice of the whole part.
    pub(crate) whole: Lattice,
    /// Where the other part gets to, in this one's frame, metres.
    pub(crate) reached: Aabb,
    /// The displacements of the pivot for which that is so, in all rotations, metres; none of a pair
    /// for listed poses.
    pub(crate) displacements: Option<Aabb>,
}

/// Nodes of both parts' lattices.
///
/// See the example of [`Pair`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct FieldNodes {
    /// Those that were computed, or found in a cache: what is in reach.
    pub computed: usize,
    /// Those of the whole pair.
    pub whole: usize,
}

/// Why two fields do not make a pair.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PairError {
    /// A model parameter is out of range.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The two fields, or a field and the model, disagree on a number they must share.
    #[error("{name} must be the same for both parts and the model: {expected} and {found}")]
    Mismatch {
        /// What differs.
        name: &'static str,
        /// Its value for the fixed part or the model.
        expected: f64,
        /// Its value for the moving part.
        found: f64,
    },
    /// The fields are not sampled alike, or smoothed: what smoothing takes from the products of
    /// densities, only a pair that is built from meshes knows ([`crate::PairBuilder`]).
    #[error(
        "both densities must be points or both cell averages, found {} and {}",
        found[0].name(),
        found[1].name()
    )]
    Sampling {
        /// How the fixed and the moving part's are sampled.
        found: [Sampling; 2],
    },
    /// The model's sigma is out of range.
    #[error(transparent)]
    Kernel(#[from] KernelError),
    /// The pivot is not finite.
    #[error("pivot must be finite, found {found}")]
    Pivot {
        /// What was given, metres.
        found: DVec3,
    },
}

impl Pair {
    /// Joins two fields. `pivot` is the point of the moving part (metres, its frame) whose
    /// displacement the translation lattices of correlators and tables count: choose the middle of
    /// the moving part, so that a rotation about it moves the part least.
    ///
    /// # Errors
    /// If the model is out of range, the fields differ in spacing, sigma or sampling or are
    /// smoothed, or the pivot is not finite.
    pub fn new(
        fixed: Arc<DensityField>,
        moving: Arc<DensityField>,
        model: ScoreModel,
        pivot: DVec3,
    ) -> Result<Self, PairError> {
        let samplings = [fixed.provenance.sampling, moving.provenance.sampling];
        if samplings[0] != samplings[1] || matches!(samplings[0], Sampling::Smoothed { .. }) {
            return Err(PairError::Sampling { found: samplings });
        }
        Self::from_fields(fixed, moving, model, pivot, None)
    }

    /// Joins two fields and what smoothing took from their products.
    pub(crate) fn from_fields(
        fixed: Arc<DensityField>,
        moving: Arc<DensityField>,
        model: ScoreModel,
        pivot: DVec3,
        contact: Option<Contact>,
    ) -> Result<Self, PairError> {
        model.validate()?;
        let same = |name, expected: f64, found: f64| {
            if (expected - found).abs() <= 1e-12 * expected.abs() {
                Ok(())
            } else {
                Err(PairError::Mismatch {
                    name,
                    expected,
                    found,
                })
            }
        };
        same(
            "lattice spacing",
            fixed.lattice().spacing(),
            moving.lattice().spacing(),
        )?;
        same("sigma", model.sigma, fixed.provenance.sigma)?;
        same("sigma", model.sigma, moving.provenance.sigma)?;
        if !pivot.is_finite() {
            return Err(PairError::Pivot { found: pivot });
        }
        Ok(Self {
            fixed,
            moving,
            model,
            pivot,
            contact,
            points: None,
            partial: None,
            cache: None,
        })
    }

    /// The same, with the part that gives the points of a product for which both could.
    pub(crate) fn with_points(self, points: Side) -> Self {
        Self {
            points: Some(points),
            ..self
        }
    }

    /// Whose cells are the points of a product for which either could give them, if the meshes decide
    /// it.
    pub(crate) fn points(&self) -> Option<Side> {
        self.points
    }

    /// The same, with a cache for its fields on coarser lattices.
    pub(crate) fn cached_in(self, cache: Option<FieldCache>) -> Self {
        Self { cache, ..self }
    }

    /// The same, of whose one part only some of the density is there.
    pub(crate) fn of_a_part(self, partial: Partial) -> Self {
        Self {
            partial: Some(partial),
            ..self
        }
    }

    /// Whether the densities of both parts are there in full, and energies right at every pose: not of
    /// a pair that was loaded for some poses only ([`crate::PairSetup::load_in`]).
    pub fn is_whole(&self) -> bool {
        self.partial.is_none()
    }

    /// Nodes that are there, and those that the whole pair has.
    pub fn nodes(&self) -> FieldNodes {
        let lattices = [&self.fixed, &self.moving].map(|field| field.lattice().len());
        let computed = lattices[0] + lattices[1];
        let whole = self.partial.map_or(computed, |partial| {
            computed - self.part(partial.side).lattice().len() + partial.whole.len()
        });
        FieldNodes { computed, whole }
    }

    /// The displacements of the pivot, metres, at which energies are right if the pair is not whole:
    /// those that it was loaded for ([`crate::PairSetup::load_in`]).
    pub fn displacements(&self) -> Option<Aabb> {
        self.partial.and_then(|partial| partial.displacements)
    }

    /// Where the parts may touch at the poses that the pair is for.
    pub(crate) fn contact_region(&self) -> ContactRegion {
        match &self.partial {
            None => ContactRegion::Everywhere,
            Some(partial) => match partial.displacements {
                Some(displacements) => ContactRegion::Window(PoseWindow {
                    pivot: self.pivot,
                    displacements,
                }),
                None => ContactRegion::Box(partial.side, partial.reached),
            },
        }
    }

    /// The part of whose density only some is there.
    pub(crate) fn partial(&self) -> Option<&Partial> {
        self.partial.as_ref()
    }

    pub(crate) fn cache(&self) -> Option<&FieldCache> {
        self.cache.as_ref()
    }

    /// The lattice of a part, all of it, whether its density is there or not.
    pub(crate) fn whole_lattice(&self, side: Side) -> &Lattice {
        match &self.partial {
            Some(partial) if partial.side == side => &partial.whole,
            _ => self.part(side).lattice(),
        }
    }

    /// The first node of a part's density that is there, counted in the whole lattice.
    pub(crate) fn first_node(&self, side: Side) -> [usize; 3] {
        let first = self.part(side).lattice().origin();
        let index = self.whole_lattice(side).fractional_index(first);
        index.round().to_array().map(|n| n as usize)
    }

    /// The magnitude of a unit density at a large flat face.
    pub(crate) fn face_density(&self) -> f64 {
        DensityKernel::new(self.model.sigma).map_or(0.0, |kernel| kernel.kappa())
    }

    /// Everything that the energies depend on: not which part of a lattice is there.
    pub fn provenance(&self) -> PairProvenance {
        let provenance = |side: Side| {
            let mut provenance = self.part(side).provenance.clone();
            if let Some(partial) = self.partial.filter(|partial| partial.side == side) {
                provenance.lattice = partial.whole;
            }
            Some(provenance)
        };
        PairProvenance {
            model: self.model,
            fixed: provenance(Side::Fixed),
            moving: provenance(Side::Moving),
            pivot: self.pivot.to_array(),
        }
    }

    /// Density of the fixed part in its own frame.
    pub fn fixed(&self) -> &DensityField {
        &self.fixed
    }

    /// Density of the moving part in its own frame.
    pub fn moving(&self) -> &DensityField {
        &self.moving
    }

    /// Density of one of the parts in its own frame.
    pub(crate) fn part(&self, side: Side) -> &DensityField {
        match side {
            Side::Fixed => &self.fixed,
            Side::Moving => &self.moving,
        }
    }

    /// Weights and scale.
    pub fn model(&self) -> &ScoreModel {
        &self.model
    }

    /// The same pair with another energy scale (eq_6's gamma, joules per cubic metre).
    ///
    /// # Errors
    /// If gamma is not positive and finite.
    pub fn with_gamma(&self, gamma: f64) -> Result<Self, PairError> {
        let model = ScoreModel {
            gamma,
            ..self.model
        };
        model.validate()?;
        Ok(Self {
            model,
            ..self.clone()
        })
    }

    /// The same densities and pivot under another model.
    ///
    /// # Errors
    /// If the model is out of range or its sigma is not that of the densities.
    pub fn with_model(&self, model: ScoreModel) -> Result<Self, PairError> {
        let (fixed, moving) = (self.fixed.clone(), self.moving.clone());
        let contact = match &self.contact {
            Some(contact) => Some(contact.with_jump(jump(&model)?)),
            None => None,
        };
        let pair = Self::from_fields(fixed, moving, model, self.pivot, contact)?;
        Ok(Self {
            points: self.points,
            partial: self.partial,
            ..pair
        })
    }

    /// Adds what contact gives to the smooth part of the score that a correlator wrote for `rotation`
    /// at every displacement of a window, cubic metres; nothing where densities are not smoothed. On
    /// all threads of the current rayon pool.
    ///
    /// # Panics
    /// If `scores` does not have the window's shape.
    pub fn add_contact(
        &self,
        rotation: DQuat,
        window: &TranslationWindow,
        mut scores: ArrayViewMut3<'_, f32>,
    ) {
        assert_eq!(scores.shape(), window.shape(), "shape of the scores");
        let Some(contact) = &self.contact else {
            return;
        };
        let planes = scores.outer_iter_mut().into_par_iter().enumerate();
        planes.for_each(|(i, mut plane)| {
            for ((j, k), score) in plane.indexed_iter_mut() {
                let pose = self.pose(rotation, window.displacement([i, j, k]));
                *score += contact.score(&pose).score as f32;
            }
        });
    }

    /// What smoothing took from the products of the densities, if they are smoothed.
    pub(crate) fn contact(&self) -> Option<&Contact> {
        self.contact.as_ref()
    }

    /// What the smaller part would score in a perfect mould of itself, cubic metres: the scale on which
    /// the score of a fit is good or poor ([`DensityField::mould_score`]).
    pub fn mould_score(&self) -> f64 {
        let of = |side: Side| self.part(side).mould_score();
        let smaller = match self.partial {
            Some(partial) => of(partial.side.other()),
            None => of(Side::Fixed).min(of(Side::Moving)),
        };
        self.model.lambda_exterior * self.model.lambda_interior * smaller
    }

    /// The moving part's pivot, metres in its own frame.
    pub fn pivot(&self) -> DVec3 {
        self.pivot
    }

    /// How the densities are read between nodes.
    pub(crate) fn interpolation(&self) -> Interpolation {
        match self.contact {
            Some(_) => Interpolation::Quadratic,
            None => Interpolation::Trilinear,
        }
    }

    /// The lattice spacing both fields share, metres.
    pub fn spacing(&self) -> f64 {
        self.fixed.lattice().spacing()
    }

    /// The pose with this rotation whose pivot is displaced by `displacement` metres (fixed frame)
    /// from where the identity pose has it: `t = pivot + displacement - R pivot`.
    pub fn pose(&self, rotation: DQuat, displacement: DVec3) -> Pose {
        Pose {
            rotation,
            translation: self.pivot + displacement - rotation * self.pivot,
        }
    }

    /// The pivot's displacement at `pose`, metres in the fixed frame; undoes [`Pair::pose`].
    pub fn displacement(&self, pose: &Pose) -> DVec3 {
        pose.apply(self.pivot) - self.pivot
    }
}
