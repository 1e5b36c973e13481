//! How far the terms of a score cancel: the number by which relative errors of the terms grow in
//! the sum.
//!
//! Near the fit a score is the small difference of a large reward and a large penalty, so an error
//! of a score says little without its condition number `Σ|terms| / |Σ terms|`. A term is the real
//! part of the product of one unit density at one cell and one at the place where it comes to lie,
//! with its weights (eq_11): the reward, penalty and separation of every cell count by themselves,
//! and what contact adds counts as one.

use glam::DVec3;
use num_complex::{Complex32, Complex64};
use sdf_grid::DensityField;

use crate::direct::terms::{Blend, Term, score_terms};
use crate::geometry::se3::Pose;
use crate::geometry::side::Side;
use crate::pair::fields::Pair;
use crate::pair::interpolation::Interpolation;

/// A score and the sum of the absolute values of its terms.
///
/// ```
/// use fft_correlate::*;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let condition = Condition::at(&pair, &Pose::IDENTITY);
/// assert!(condition.number() >= 1.0 && condition.magnitude >= condition.score);
/// // The evaluator sums the same terms: cubic metres times joules per cubic metre.
/// let source = DirectEvaluator::new(&pair, &DirectOptions::FULL)?;
/// let energy = source.evaluate(&Pose::IDENTITY, &mut source.scratch()).energy;
/// assert!((energy + pair.model().gamma * condition.score).abs() < 1e-4 * energy.abs());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Condition {
    /// `Re f(T)`, cubic metres (eq_5), summed in double precision.
    pub score: f64,
    /// `Σ|terms|`, cubic metres; at least `|score|`.
    pub magnitude: f64,
}

impl Condition {
    /// The condition number, 1 and above: `magnitude / |score|`; 1 where there are no terms,
    /// infinite where they cancel completely. A relative error `e` of the terms is one of up to
    /// `number() * e` of score and energy.
    pub fn number(&self) -> f64 {
        if self.magnitude == 0.0 {
            return 1.0;
        }
        // Rounding may leave the sum above the sum of absolute values.
        (self.magnitude / self.score.abs()).max(1.0)
    }

    /// The score and the magnitude of `pair` at `pose`, cell by cell in double precision: a
    /// reference, some hundred times slower than [`crate::DirectEvaluator`]. Not-a-number densities
    /// give not-a-number sums.
    pub fn at(pair: &Pair, pose: &Pose) -> Self {
        let inverse = pose.inverse();
        let mut total = Self::default();
        for term in score_terms(pair) {
            let motion = match term.points {
                Side::Moving => pose,
                Side::Fixed => &inverse,
            };
            let parts = [term.points, term.points.other()].map(|side| pair.part(side));
            let part = Self::of_term(&term, pair.interpolation(), parts, motion);
            total.score += part.score;
            total.magnitude += part.magnitude;
        }
        if let Some(contact) = pair.contact() {
            let lost = contact.score(pose).score;
            total.score += lost;
            total.magnitude += lost.abs();
        }
        total
    }

    /// `motion` brings the points into the frame of the part that is looked up.
    fn of_term(
        term: &Term,
        interpolation: Interpolation,
        [points, looked_up]: [&DensityField; 2],
        motion: &Pose,
    ) -> Self {
        let mut sums = Self::default();
        let nodes = points.exterior.indexed_iter().zip(&points.interior);
        for (((i, j, k), exterior), interior) in nodes {
            let here = weighted(&term.weights, *exterior, *interior);
            if here == [Complex64::ZERO; 2] {
                continue;
            }
            let place = motion.apply(points.lattice().position([i, j, k]));
            let Some(there) = interpolated(looked_up, &term.lookup, interpolation, place) else {
                continue;
            };
            for product in here.iter().flat_map(|a| there.map(|b| (a * b).re)) {
                sums.score += product;
                sums.magnitude += product.abs();
            }
        }
        let volume = points.lattice().cell_volume();
        Self {
            score: volume * sums.score,
            magnitude: volume * sums.magnitude,
        }
    }
}

/// The exterior and the interior density, each with its weight.
fn weighted(blend: &Blend, exterior: Complex32, interior: Complex32) -> [Complex64; 2] {
    let widen = |v: Complex32| Complex64::new(v.re.into(), v.im.into());
    [
        blend.exterior * widen(exterior),
        blend.interior * widen(interior),
    ]
}

/// Both weighted densities at `place`, read as the evaluator does, with zeros around the lattice;
/// `None` beyond those.
fn interpolated(
    field: &DensityField,
    blend: &Blend,
    interpolation: Interpolation,
    place: DVec3,
) -> Option<[Complex64; 2]> {
    let at = field.lattice().fractional_index(place);
    let (shape, reach) = (field.lattice().shape(), interpolation.reach());
    let reached = |(u, n): (f64, usize)| u > -reach && u < n as f64 - 1.0 + reach;
    if !at.to_array().into_iter().zip(shape).all(reached) {
        return None;
    }
    let (first, count) = (interpolation.first(at), interpolation.nodes());
    let mut values = [Complex64::ZERO; 2];
    for flat in 0..count.pow(3) {
        let n = [flat / count / count, flat / count % count, flat % count];
        let node: [f64; 3] = std::array::from_fn(|a| first[a] + n[a] as f64);
        if (0..3).any(|a| node[a] < 0.0 || node[a] >= shape[a] as f64) {
            continue;
        }
        let weight = |a: usize| interpolation.tap(at[a] - first[a], n[a]).0;
        let share: f64 = (0..3).map(weight).product();
        let node = node.map(|n| n as usize);
        let [exterior, interior] = weighted(blend, field.exterior[node], field.interior[node]);
        values[0] += share * exterior;
        values[1] += share * interior;
    }
    Some(values)
}
