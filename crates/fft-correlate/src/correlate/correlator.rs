//! Correlators: a pair's spectra and fields, the scores that they give, and their exact gradient.
//!
//! The score depends on the pose only through the rotated moving field,
//! `f(d) = Re sum_p A(p) g(p - d)`, and `g` is an interpolant with a gradient of its own. So the
//! derivatives are
//!
//! - by the displacement: `-Re sum_p A(p) (∇g)(p - d)`,
//! - by a turn about the displaced pivot: `-Re sum_p A(p) (q × ∇g)(q)` with `q = p - d`,
//!
//! six correlations with the spectra of the score. Multiplying the score's own spectrum by `i k`
//! would be cheaper, but only the window's scores are free of wrap-around and of cropping: what lies
//! outside would ring into the window's derivative, and turns have no such factor.

use std::ops::Range;
use web_time::Instant;

use fearless_simd::Level;
use fearless_simd::prelude::*;
use glam::{DMat3, DQuat, DVec3};
use ndarray::{Array3, ArrayViewMut3};
use num_complex::Complex;

use crate::correlate::contract::{MovingRows, StageTimes};
use crate::correlate::kernels;
use crate::correlate::kernels::{Fused, FusedScratch};
use crate::correlate::overlap::IndexBox;
use crate::correlate::plan::{CorrelatorPlan, ProductPlan};
use crate::correlate::real::Real;
use crate::correlate::resample::{MovingField, RotatedField, RotationMoments};
use crate::correlate::support::{CorrelateError, PairSupport};
use crate::geometry::half_turn::{HalfTurn, RotationSum};
use crate::geometry::translation::TranslationWindow;
use crate::pair::fields::Pair;
use crate::vectors;

/// Scores one pair over one window; shared by all threads. In `f32`, or in `f64` for verification
/// ([`Correlator::build_double`]).
///
/// ```
/// use fft_correlate::{Correlator, PairBuilder, ScoreModel, TranslationWindow, top_peaks};
/// use glam::{DQuat, DVec3};
/// use ndarray::Array3;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let window = TranslationWindow::cube(0.008, 0.004)?;
/// let correlator = Correlator::new(&pair, &window)?;
/// let mut scores = Array3::zeros(window.shape());
/// correlator.score(DQuat::IDENTITY, &mut correlator.scratch(), scores.view_mut());
/// pair.add_contact(DQuat::IDENTITY, &window, scores.view_mut());
/// // Of the 125 displacements, zero scores best.
/// let best = top_peaks(scores.view(), 1, 1.0)[0];
/// assert_eq!(window.displacement(best.index), DVec3::ZERO);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Correlator<T: Real = f32> {
    plan: CorrelatorPlan,
    /// None where nothing meets in the window.
    kernels: Option<Box<Fused<T>>>,
    products: Vec<MovingFactor<T>>,
    entries: KernelEntries<T>,
}

/// Working memory of one thread; see [`Correlator::scratch`].
pub struct CorrelatorScratch<T: Real = f32> {
    kernels: Option<FusedScratch<T>>,
    /// Of each product, for sums.
    sums: Vec<Array3<Complex<T>>>,
    times: StageTimes,
}

impl<T: Real> CorrelatorScratch<T> {
    /// Seconds that the parts of the last [`Correlator::score`] took.
    pub fn stage_times(&self) -> StageTimes {
        self.times
    }
}

/// The moving factor of a product.
struct MovingFactor<T> {
    field: MovingField<T>,
    /// For sums.
    second: Option<RotationMoments<T>>,
    /// Where the field may be nonzero and meet the fixed one, and the box that the transforms are
    /// given.
    within: IndexBox,
    placed: IndexBox,
}

impl<T: Real> MovingFactor<T> {
    /// `values` at the field's nodes, turned; without any, the field's own.
    fn turned<'a>(
        &'a self,
        values: Option<&'a Array3<Complex<T>>>,
        rotation: DQuat,
        origin: DVec3,
    ) -> RotatedField<'a, T> {
        let values = values.unwrap_or(self.field.values());
        let (placed, within) = (self.placed, self.within);
        RotatedField::new(&self.field, values, rotation, origin, placed, within)
    }
}

/// The kernels' entries. Called through pointers that are made here: crates that name a generic
/// `Correlator<T>` would else compile all kernels again.
struct KernelEntries<T: Real> {
    score: Score<T>,
    gradient: Gradient<T>,
}

type Score<T> = fn(
    &Correlator<T>,
    &RotationSum,
    &[HalfTurn],
    &mut CorrelatorScratch<T>,
    &mut [ArrayViewMut3<T>],
);

type Gradient<T> = fn(&Correlator<T>, DQuat, &mut CorrelatorScratch<T>, [ArrayViewMut3<'_, T>; 6]);

impl Correlator {
    /// Crops and transforms the fixed part's fields as planned.
    ///
    /// # Errors
    /// If `pair` is not the one that was planned for, or a density is not finite.
    pub fn build(plan: &CorrelatorPlan, pair: &Pair) -> Result<Self, CorrelateError> {
        Self::build_at(plan, pair, vectors::native())
    }

    /// Plans and builds for any rotations, one by one: [`CorrelatorPlan::new`] says what it would
    /// need.
    ///
    /// # Errors
    /// As [`PairSupport::of`] and [`CorrelatorPlan::new`].
    pub fn new(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        let plan = CorrelatorPlan::new(&PairSupport::of(pair)?, window)?;
        Ok(Self::from_plan(plan, pair, vectors::native()))
    }

    /// As [`Correlator::build`], for the pair that was planned for.
    pub(crate) fn planned(plan: CorrelatorPlan, pair: &Pair) -> Self {
        Self::from_plan(plan, pair, vectors::native())
    }
}

impl Correlator<f64> {
    /// As [`Correlator::build`], in double precision: the same steps with an error of about 1e-15
    /// instead of 1e-7, to tell rounding from everything else. [`Correlator::plan`] then says what
    /// that needs.
    ///
    /// # Errors
    /// As [`Correlator::build`].
    pub fn build_double(plan: &CorrelatorPlan, pair: &Pair) -> Result<Self, CorrelateError> {
        Self::build_at(plan, pair, vectors::native())
    }
}

impl<T: Real> Correlator<T> {
    fn build_at(plan: &CorrelatorPlan, pair: &Pair, level: Level) -> Result<Self, CorrelateError> {
        if PairSupport::of(pair)? != plan.support {
            return Err(CorrelateError::OtherPair);
        }
        Ok(Self::from_plan(plan.clone(), pair, level))
    }

    /// For the pair that was planned for.
    fn from_plan(plan: CorrelatorPlan, pair: &Pair, level: Level) -> Self {
        let plan = plan.with_needs::<T>(level);
        tracing::debug!(%plan, "correlator");
        let support = |p: &ProductPlan| &plan.support.products[p.number];
        let products = plan.products.iter().filter_map(|p| {
            let of = support(p);
            let value = |at| of.product.moving.value(pair.moving(), at);
            let nodes = of.moving?.nodes;
            let (first, interpolation) = (plan.support.moving_first, plan.support.interpolation);
            let field = MovingField::new(&nodes, value, first, interpolation);
            Some(MovingFactor {
                second: plan.sums.then(|| RotationMoments::new(&field)),
                field,
                within: p.crop.overlap.moving,
                placed: p.crop.placed,
            })
        });
        let products: Vec<_> = products.collect();
        let scale = T::nearest(plan.support.spacing.powi(3));
        let fixed = |term: usize| {
            let p: &ProductPlan = &plan.products[term];
            let (kept, first) = (&p.crop.overlap.fixed, p.crop.placed.lo);
            let (window_first, size) = (plan.window_first, plan.transform_size);
            let factor = &support(p).product.fixed;
            factor.periodic(pair.fixed(), kept, first, window_first, size, scale)
        };
        let kernels = (!products.is_empty()).then(|| Fused::new(level, plan.sizes(), fixed));
        Self {
            kernels: kernels.map(Box::new),
            products,
            plan,
            entries: KernelEntries {
                score: score::<T>,
                gradient: gradient::<T>,
            },
        }
    }

    /// Sizes, transforms and memory.
    pub fn plan(&self) -> &CorrelatorPlan {
        &self.plan
    }

    /// Working memory for [`Correlator::score`] and [`Correlator::score_half_turns`], one per
    /// thread.
    pub fn scratch(&self) -> CorrelatorScratch<T> {
        CorrelatorScratch {
            kernels: self.kernels.as_ref().map(|f| FusedScratch::new(f)),
            sums: (self.products.iter().filter(|p| p.second.is_some()))
                .map(|p| p.field.empty_values())
                .collect(),
            times: StageTimes::default(),
        }
    }

    /// Writes `Re f` (eq_5, cubic metres) for `rotation` at every displacement of the window to
    /// `out`; the energy is `-gamma` times it (eq_6). Allocates nothing.
    ///
    /// # Panics
    /// If `out` does not have the window's shape, or `scratch` comes from another correlator.
    pub fn score(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch<T>,
        mut out: ArrayViewMut3<T>,
    ) {
        let outs = std::slice::from_mut(&mut out);
        (self.entries.score)(self, &RotationSum::one(rotation), &[], scratch, outs);
    }

    /// The scores of `rotation` followed by each of `turns`, one output each, as
    /// [`Correlator::score`] gives them up to rounding. Where the plan shares half turns the moving
    /// part is sampled and transformed only once; a score does not depend on the other turns asked
    /// for. Allocates nothing.
    ///
    /// # Panics
    /// If there are not as many outputs as turns, at most four, one of them does not have the
    /// window's shape, or `scratch` comes from another correlator.
    pub fn score_half_turns(
        &self,
        rotation: DQuat,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch<T>,
        outs: &mut [ArrayViewMut3<T>],
    ) {
        self.score_sums(&RotationSum::one(rotation), turns, scratch, outs);
    }

    /// The same for sums of the scores of near rotations, whose turns from the first, times their
    /// weights, must cancel: one turned field stands for all, which is right to second order in the
    /// turns. Allocates nothing.
    ///
    /// # Panics
    /// As [`Correlator::score_half_turns`], or if there is more than one rotation and the plan is
    /// not [`CorrelatorPlan::for_sums`].
    pub fn score_sums(
        &self,
        sum: &RotationSum,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch<T>,
        outs: &mut [ArrayViewMut3<T>],
    ) {
        assert_eq!(outs.len(), turns.len(), "outputs");
        if turns.is_empty() {
            return;
        }
        if self.plan.shares_half_turns {
            return (self.entries.score)(self, sum, turns, scratch, outs);
        }
        let mut times = StageTimes::default();
        for (turn, out) in turns.iter().zip(outs) {
            let out = std::slice::from_mut(out);
            (self.entries.score)(self, &sum.turned(*turn), &[], scratch, out);
            times += scratch.times;
        }
        scratch.times = times;
    }

    /// Writes the gradient of `Re f` (eq_5b, eq_5c) for `rotation` at every displacement of the
    /// window to `out`, angular part first: by a turn about the x, y, z axis of the fixed frame
    /// through the displaced pivot (cubic metres per radian), then by the displacement along x, y,
    /// z (square metres). The wrench about the pivot is gamma times it (eq_9a, eq_9b).
    ///
    /// Costs six scores with a slower resampling; it is exact for the sum that
    /// [`Correlator::score`] computes. Where a sample lies on a face between cells of the moving
    /// lattice the interpolant has a kink, and the derivative is that of one of its sides.
    /// Allocates nothing.
    ///
    /// # Panics
    /// As [`Correlator::score`].
    pub fn gradient(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch<T>,
        out: [ArrayViewMut3<'_, T>; 6],
    ) {
        (self.entries.gradient)(self, rotation, scratch, out);
    }
}

fn score<T: Real>(
    of: &Correlator<T>,
    sum: &RotationSum,
    turns: &[HalfTurn],
    scratch: &mut CorrelatorScratch<T>,
    outs: &mut [ArrayViewMut3<T>],
) {
    let origin = of.plan.support.fixed_first;
    let CorrelatorScratch {
        kernels,
        sums,
        times,
    } = scratch;
    let several = sum.terms().len() > 1;
    let started = Instant::now();
    if several {
        for (p, values) in of.products.iter().zip(&mut *sums) {
            let second = p.second.as_ref().expect("a plan for sums");
            second.sum(&p.field, sum, values);
        }
    }
    let summed = started.elapsed().as_secs_f64();
    let values = |p: usize| several.then(|| &sums[p]);
    let turned = |p: usize| of.products[p].turned(values(p), sum.first(), origin);
    *times = correlate(of, turns, kernels, outs, turned);
    times.resample += summed;
}

fn gradient<T: Real>(
    of: &Correlator<T>,
    rotation: DQuat,
    scratch: &mut CorrelatorScratch<T>,
    out: [ArrayViewMut3<'_, T>; 6],
) {
    let (origin, spacing) = (of.plan.support.fixed_first, of.plan.support.spacing);
    for (component, out) in out.into_iter().enumerate() {
        let turned = |p: usize| {
            let p = &of.products[p];
            Derivative {
                turned: p.turned(None, rotation, origin),
                rotation: DMat3::from_quat(rotation),
                corner: origin + DVec3::from_array(p.placed.lo.map(|v| v as f64)),
                component,
                scale: if component < 3 { 1.0 } else { 1.0 / spacing },
            }
        };
        scratch.times = correlate(of, &[], &mut scratch.kernels, &mut [out], turned);
    }
}

/// The sum of all products, with the moving fields that `moving` makes of them: for each turn or,
/// without turns, as it is.
fn correlate<T: Real, M: MovingRows<T>>(
    of: &Correlator<T>,
    turns: &[HalfTurn],
    scratch: &mut Option<FusedScratch<T>>,
    outs: &mut [ArrayViewMut3<T>],
    moving: impl Fn(usize) -> M,
) -> StageTimes {
    for out in &mut *outs {
        assert_eq!(out.shape(), of.plan.window, "shape of the output");
    }
    match (&of.kernels, scratch, of.products.len()) {
        (Some(f), Some(own), 1) => kernels::correlate(f, &[moving(0)], turns, own, outs),
        (Some(f), Some(own), 2) => kernels::correlate(f, &[moving(0), moving(1)], turns, own, outs),
        (None, None, _) => {
            outs.iter_mut().for_each(|out| out.fill(T::zero()));
            StageTimes::default()
        }
        _ => panic!("scratch of another correlator"),
    }
}

/// One component of the gradient of a turned field.
pub(crate) struct Derivative<'a, T> {
    pub(super) turned: RotatedField<'a, T>,
    pub(super) rotation: DMat3,
    /// Position of index `[0, 0, 0]` relative to the pivot, cells of the fixed frame.
    pub(super) corner: DVec3,
    /// 0 to 2 the turn about x, y, z; 3 to 5 the displacement along them.
    pub(super) component: usize,
    /// What a derivative per cell is multiplied with.
    pub(super) scale: f64,
}

impl<T: Real> Derivative<'_, T> {
    fn at(&self, x: usize, y: usize, z: usize) -> Complex<T> {
        let q = self.corner + DVec3::new(x as f64, y as f64, z as f64);
        let Some([re, im]) = self.turned.gradient([x, y, z]) else {
            return Complex::default();
        };
        let component = |gradient: DVec3| {
            let gradient = self.rotation * gradient;
            let value = if self.component < 3 {
                q.cross(gradient)[self.component]
            } else {
                gradient[self.component - 3]
            };
            T::nearest(-self.scale * value)
        };
        Complex::new(component(re), component(im))
    }
}

impl<T: Real> MovingRows<T> for Derivative<'_, T> {
    fn bounds(&self) -> [Range<usize>; 3] {
        self.turned.bounds()
    }

    fn fill_lanes<S: Simd>(&self, _: S, x: usize, y: usize, bundle: &mut [T]) -> Range<usize> {
        let lanes = T::Native::<S>::LEN;
        let range = self.bounds()[2].clone();
        for z in range.clone() {
            for lane in 0..lanes {
                let value = self.at(x, y + lane, z);
                bundle[2 * z * lanes + lane] = value.re;
                bundle[(2 * z + 1) * lanes + lane] = value.im;
            }
        }
        range
    }
}

#[cfg(test)]
#[path = "correlator_tests.rs"]
mod tests;
