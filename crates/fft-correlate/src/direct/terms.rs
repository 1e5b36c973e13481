//! Which points are looked up in which field: the score as a short list of products.

use sdf_grid::DensityField;

use crate::geometry::side::Side;
use crate::pair::fields::Pair;

/// Real weights of a part's two unit densities: `exterior * O + interior * I`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// Weight of the exterior density.
    pub exterior: f64,
    /// Weight of the interior density.
    pub interior: f64,
}

impl Blend {
    /// True at a node that contributes nothing, because the part has no density there or the
    /// density has weight zero.
    pub(super) fn is_zero_at(&self, field: &DensityField, index: [usize; 3]) -> bool {
        let zero = |weight: f64, value: num_complex::Complex32| {
            weight == 0.0 || (value.re == 0.0 && value.im == 0.0)
        };
        zero(self.exterior, field.exterior[index]) && zero(self.interior, field.interior[index])
    }

    /// How many nodes of `field` contribute.
    pub(super) fn count(&self, field: &DensityField) -> usize {
        let contributes = |(o, i): (&num_complex::Complex32, &num_complex::Complex32)| {
            (self.exterior != 0.0 && (o.re != 0.0 || o.im != 0.0))
                || (self.interior != 0.0 && (i.re != 0.0 || i.im != 0.0))
        };
        let nodes = field.exterior.iter().zip(&field.interior);
        nodes.filter(|&n| contributes(n)).count()
    }
}

/// One product of the score: the `points` part's cells, weighted by `weights`, times the other
/// part's `lookup` blend interpolated at their places (eq_11).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// Whose cells are the quadrature points.
    pub points: Side,
    /// Blend of that part's densities at the points.
    pub weights: Blend,
    /// Blend of the other part's densities that is looked up.
    pub lookup: Blend,
}

/// The products whose sum is the score, with the fewest points.
///
/// Writing `i = l2`, `o = l1`, the score is `(o O1 + i I1)(i I2) + (w o O1 + i I1)(o O2)`:
/// - `w = 0`: the moving interior in the fixed density, the fixed interior in the moving exterior;
/// - `w = 1`: one product; the part with fewer non-zero cells gives the points;
/// - between: the moving interior in the fixed density, and the second product from the side with
///   fewer cells.
///
/// Which side has fewer cells, a pair that is made of meshes knows from these: of a part of it the
/// products are those of the whole.
pub fn score_terms(pair: &Pair) -> Vec<Term> {
    let (model, fixed, moving) = (pair.model(), pair.fixed(), pair.moving());
    let blend = |exterior, interior| Blend { exterior, interior };
    let (o, i, w) = (
        model.lambda_exterior,
        model.lambda_interior,
        model.separation_weight,
    );
    let term = |points, weights, lookup| Term {
        points,
        weights,
        lookup,
    };
    let whole = blend(o, i);
    if w == 1.0 {
        let counted = || match whole.count(moving) <= whole.count(fixed) {
            true => Side::Moving,
            false => Side::Fixed,
        };
        return vec![term(pair.points().unwrap_or_else(counted), whole, whole)];
    }
    let interior = term(Side::Moving, blend(0.0, i), whole);
    let (of_fixed, of_moving) = (blend(w * o, i), blend(o, 0.0));
    let counted = || match of_fixed.count(fixed) <= of_moving.count(moving) {
        true => Side::Fixed,
        false => Side::Moving,
    };
    let second = match pair.points().unwrap_or_else(counted) {
        Side::Fixed => term(Side::Fixed, of_fixed, of_moving),
        Side::Moving => term(Side::Moving, of_moving, of_fixed),
    };
    vec![interior, second]
}
