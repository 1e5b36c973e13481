//! The score of a pair at all translations of a window, one rotation at a time, by FFT.
//!
//! For a rotation `R` and a displacement `d` of the pivot `c` the moving density at a point `p` of
//! the fixed frame is `g_R(p - d)` with `g_R(p) = rho_2(R^T (p - c) + c)`. The correlator samples
//! `g_R` on the fixed part's lattice and computes `Re sum_p A(p) g_R(p - d) h^3` (eq_5, eq_11; no
//! complex conjugate) for every displacement of the window at once.
//!
//! The general score is the sum of two products, each with one compact factor as far as the
//! separation weight `w` allows:
//!
//! | product | fixed field | moving field |
//! |---|---|---|
//! | 1 | `l2 (l1 O1 + l2 I1)` | `I2` |
//! | 2 | `l1 (w l1 O1 + l2 I1)` | `O2` |
//!
//! With `w = 1` they merge into `(l1 O1 + l2 I1)(l1 O2 + l2 I2)`. Each field is cropped to what can
//! meet the other inside the window, and the transforms have the shortest good length at which
//! nothing wraps into the window.

use std::fmt;

use glam::{DQuat, DVec3};
use ndarray::{Array3, ArrayViewMut3, Zip};
use num_complex::{Complex, Complex32};
use sdf_grid::DensityField;
use serde::Serialize;

use crate::cost::{best_size, seconds};
use crate::overlap::{IndexBox, Overlap, overlap};
use crate::real::Real;
use crate::resample::{MovingField, Turned, support};
use crate::spectral::{FixedTerm, MovingRows, Spectral, SpectralScratch, StageTimes, Way, memory};
use crate::{HalfTurn, HalfTurnGroup, Pair, TranslationWindow};

/// Why a correlator cannot be planned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CorrelateError {
    /// The window's spacing is not the pair's.
    #[error(
        "translation window: expected the pair's lattice spacing {expected} m, found {found} m"
    )]
    Spacing {
        /// The pair's spacing, metres.
        expected: f64,
        /// The window's spacing, metres.
        found: f64,
    },
    /// The transform would have too many points.
    #[error("transform of {size:?} points: expected at most {limit} in all")]
    Size {
        /// Points per axis.
        size: [usize; 3],
        /// The largest number of points accepted.
        limit: u64,
    },
    /// A density is not finite.
    #[error("density of the {part} part is not finite at lattice node {index:?}")]
    NotFinite {
        /// `fixed` or `moving`.
        part: &'static str,
        /// The first such node.
        index: [usize; 3],
    },
}

/// What a correlator does for each rotation and what it needs; data to print, compare and test.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrelatorPlan {
    /// Points of the three-dimensional transforms along x, y, z.
    pub transform_size: [usize; 3],
    /// Displacements scored along x, y, z.
    pub window: [usize; 3],
    /// The products that are transformed.
    pub products: Vec<ProductPlan>,
    /// Products left out because their factors never meet inside the window.
    pub skipped: Vec<&'static str>,
    /// Forward transforms of real fields per rotation (two share each complex one).
    pub forward_transforms: usize,
    /// Inverse transforms to a real field per rotation.
    pub inverse_transforms: usize,
    /// Bytes held once: spectra of the fixed fields and the moving fields.
    pub shared_bytes: u64,
    /// Bytes held per thread: one [`CorrelatorScratch`].
    pub scratch_bytes: u64,
    /// Whether rotations that differ by half turns share the moving part's transforms: if they were
    /// planned for, save time, and the lattice has its nodes, or the middles between them, at the
    /// pivot.
    pub shares_half_turns: bool,
    /// Seconds that a rotation should take on one thread, one of four if they share half turns, by a
    /// model measured with vectors of eight f32 (AVX2); empty space in the moving part makes it
    /// faster.
    pub expected_seconds: f64,
}

/// One product of a [`CorrelatorPlan`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProductPlan {
    /// The two factors: fixed, then moving.
    pub factors: &'static str,
    /// Nodes of the fixed factor that can meet the moving one inside the window.
    pub fixed_nodes: [usize; 3],
    /// Nodes of the moving factor, under any rotation, that can meet the fixed one.
    pub moving_nodes: [usize; 3],
}

impl fmt::Display for CorrelatorPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = |n: &[usize; 3]| format!("{} x {} x {}", n[0], n[1], n[2]);
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        write!(
            f,
            "{} displacements by transforms of {}: {} + {} real per rotation, about {:.3} ms on \
             one thread; {:.1} MiB shared, {:.1} MiB per thread",
            by(&self.window),
            by(&self.transform_size),
            self.forward_transforms,
            self.inverse_transforms,
            1e3 * self.expected_seconds,
            mib(self.shared_bytes),
            mib(self.scratch_bytes)
        )?;
        if self.shares_half_turns {
            write!(f, ", half turns sharing the moving transforms")?;
        }
        for p in &self.products {
            let (fixed, moving) = (by(&p.fixed_nodes), by(&p.moving_nodes));
            write!(f, "; {}: {fixed} fixed, {moving} moving nodes", p.factors)?;
        }
        for name in &self.skipped {
            write!(f, "; {name}: never meet")?;
        }
        Ok(())
    }
}

/// Scores one pair over one window; shared by all threads. In `f32`, or in `f64` for verification
/// ([`Correlator::plan_double`]).
pub struct Correlator<T: Real = f32> {
    plan: CorrelatorPlan,
    spectral: Option<Spectral<T>>,
    products: Vec<Product<T>>,
    /// Position of fixed-lattice node 0 relative to the pivot, cells.
    pub(crate) origin: DVec3,
    /// Metres per cell.
    pub(crate) spacing: f64,
}

pub(crate) struct Product<T> {
    moving: MovingField<T>,
    /// Where the moving field may be nonzero and meet the fixed one, and the box that the
    /// transforms are given.
    within: IndexBox,
    moving_box: IndexBox,
}

impl<T: Real> Product<T> {
    pub(crate) fn turned(&self, rotation: DQuat, origin: DVec3) -> Turned<'_, T> {
        self.moving
            .turned(rotation, origin, self.moving_box, self.within)
    }

    /// Position of the moving box's first node relative to the pivot, cells.
    pub(crate) fn corner(&self, origin: DVec3) -> DVec3 {
        origin + DVec3::from_array(self.moving_box.lo.map(|v| v as f64))
    }
}

/// Working memory of one thread; see [`Correlator::scratch`].
pub struct CorrelatorScratch<T: Real = f32> {
    spectral: Option<SpectralScratch<T>>,
    times: StageTimes,
}

impl<T: Real> CorrelatorScratch<T> {
    /// Seconds that the parts of the last [`Correlator::score`] took.
    pub fn stage_times(&self) -> StageTimes {
        self.times
    }
}

/// Weights of the exterior and the interior density.
type Weights = [f64; 2];

impl Correlator {
    /// The largest number of points of one transform (2^30: 8 GiB per complex field).
    pub const MAX_POINTS: u64 = 1 << 30;

    /// Crops, sizes and transforms the fixed part's fields for `window`, for any rotation.
    ///
    /// # Errors
    /// If the window's spacing is not the pair's, a density is not finite, or the transform would
    /// exceed [`Correlator::MAX_POINTS`].
    pub fn plan(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        Self::plan_as(pair, window, Way::native(), false)
    }

    /// As [`Correlator::plan`], for [`Correlator::score_half_turns`]: with room for the half turns'
    /// results and, if that costs less in all, somewhat longer transforms. Single scores are as
    /// good, but may take longer.
    ///
    /// # Errors
    /// As [`Correlator::plan`].
    pub fn plan_half_turns(
        pair: &Pair,
        window: &TranslationWindow,
    ) -> Result<Self, CorrelateError> {
        Self::plan_as(pair, window, Way::native(), true)
    }

    /// [`Correlator::plan_half_turns`] if the groups have at least [`WORTHWHILE`] rotations on
    /// average, else [`Correlator::plan`].
    ///
    /// # Errors
    /// As [`Correlator::plan`].
    pub(crate) fn plan_groups(
        pair: &Pair,
        window: &TranslationWindow,
        groups: &[HalfTurnGroup],
    ) -> Result<Self, CorrelateError> {
        let rotations: usize = groups.iter().map(|g| g.members.len()).sum();
        let shared = rotations as f64 >= WORTHWHILE * groups.len() as f64;
        Self::plan_as(pair, window, Way::native(), shared)
    }
}

/// Rotations per group from which on groups are scored together: what is shared is about half of
/// the work, and the rest then takes a little longer.
const WORTHWHILE: f64 = 1.5;

impl Correlator<f64> {
    /// As [`Correlator::plan`], in double precision: the same steps with an error of about 1e-15
    /// instead of 1e-7, to tell rounding from everything else.
    ///
    /// # Errors
    /// As [`Correlator::plan`].
    pub fn plan_double(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        Self::plan_as(pair, window, Way::native(), false)
    }
}

impl<T: Real> Correlator<T> {
    fn plan_as(
        pair: &Pair,
        window: &TranslationWindow,
        way: Way,
        half_turns: bool,
    ) -> Result<Self, CorrelateError> {
        let h = pair.spacing();
        let found = window.lattice().spacing();
        if (found - h).abs() > 1e-9 * h {
            return Err(CorrelateError::Spacing { expected: h, found });
        }
        for (part, field) in [("fixed", pair.fixed()), ("moving", pair.moving())] {
            check_finite(part, field)?;
        }
        let first = window.first();
        let shape = window.shape();
        let window_box = IndexBox {
            lo: first,
            hi: std::array::from_fn(|a| first[a] + shape[a] as i64),
        };
        let origin = (pair.fixed().lattice().origin() - pair.pivot()) / h;
        let moving_first = (pair.moving().lattice().origin() - pair.pivot()) / h;

        let mut skipped = Vec::new();
        let mut kept = Vec::new();
        for (factors, fixed, moving) in products(pair) {
            let fixed = combined(pair.fixed(), fixed);
            let moving = MovingField::new(&single(pair.moving(), moving), moving_first);
            let met = moving.and_then(|m| {
                let support = support(&fixed)?;
                let met = overlap(support, m.reach(origin), window_box)?;
                Some((m, support, met))
            });
            match met {
                Some((moving, support, met)) => kept.push(Kept {
                    factors,
                    fixed,
                    support,
                    moving,
                    placed: met.moving,
                    met,
                }),
                None => skipped.push(factors),
            }
        }
        let mut size =
            transform_size(kept.iter().map(|k| k.met.min_period), shape, &shapes(&kept))?;
        let symmetric = if half_turns {
            symmetric(&mut kept, window_box, size, origin)
        } else {
            None
        };
        let half_turns = symmetric.is_some();
        size = symmetric.unwrap_or(size);
        let moving_shapes = shapes(&kept);
        let memory = memory::<T>(size, shape, &moving_shapes);
        let expected = |turns| seconds(size, shape, &moving_shapes, turns).unwrap_or(f64::NAN);
        let plan = CorrelatorPlan {
            transform_size: size,
            window: shape,
            products: kept
                .iter()
                .map(|k| ProductPlan {
                    factors: k.factors,
                    fixed_nodes: k.met.fixed.shape(),
                    moving_nodes: k.met.moving.shape(),
                })
                .collect(),
            skipped,
            forward_transforms: 2 * kept.len(),
            inverse_transforms: usize::from(!kept.is_empty()),
            shared_bytes: memory.spectra + kept.iter().map(|k| k.moving.bytes()).sum::<u64>(),
            scratch_bytes: memory.scratch + if half_turns { memory.half_turns } else { 0 },
            shares_half_turns: half_turns,
            expected_seconds: expected(if half_turns { 4 } else { 1 }),
        };
        tracing::debug!(%plan, "correlator");
        let mut terms = Vec::new();
        let mut products = Vec::new();
        for k in kept {
            let scale = T::nearest(h.powi(3));
            terms.push(FixedTerm {
                field: periodic(&k.fixed, &k.met.fixed, k.placed.lo, first, size, scale),
                moving_shape: k.placed.shape(),
            });
            products.push(Product {
                moving: k.moving,
                within: k.met.moving,
                moving_box: k.placed,
            });
        }
        Ok(Self {
            spectral: (!terms.is_empty())
                .then(|| Spectral::new(way, size, shape, terms, half_turns)),
            plan,
            products,
            origin,
            spacing: h,
        })
    }

    /// Sizes, transforms and memory.
    pub fn description(&self) -> &CorrelatorPlan {
        &self.plan
    }

    /// Working memory for [`Correlator::score`] and [`Correlator::score_half_turns`], one per
    /// thread.
    pub fn scratch(&self) -> CorrelatorScratch<T> {
        CorrelatorScratch {
            spectral: self.spectral.as_ref().map(Spectral::scratch),
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
        self.correlate(&[], scratch, outs, |p| p.turned(rotation, self.origin));
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
        assert_eq!(outs.len(), turns.len(), "outputs");
        if turns.is_empty() {
            return;
        }
        if self.plan.shares_half_turns {
            return self.correlate(turns, scratch, outs, |p| p.turned(rotation, self.origin));
        }
        let mut times = StageTimes::default();
        for (turn, out) in turns.iter().zip(outs) {
            self.score(turn.rotation() * rotation, scratch, out.view_mut());
            times += scratch.times;
        }
        scratch.times = times;
    }

    /// The sum of all products, with the moving fields that `moving` makes of them: for each turn
    /// or, without turns, as it is.
    pub(crate) fn correlate<'a, M: MovingRows<T>>(
        &'a self,
        turns: &[HalfTurn],
        scratch: &mut CorrelatorScratch<T>,
        outs: &mut [ArrayViewMut3<T>],
        moving: impl Fn(&'a Product<T>) -> M,
    ) {
        for out in &mut *outs {
            assert_eq!(out.shape(), self.plan.window, "shape of the output");
        }
        let (Some(spectral), Some(own)) = (&self.spectral, &mut scratch.spectral) else {
            outs.iter_mut().for_each(|out| out.fill(T::zero()));
            scratch.times = StageTimes::default();
            return;
        };
        scratch.times = match self.products.as_slice() {
            [a] => spectral.correlate(&[moving(a)], turns, own, outs),
            [a, b] => spectral.correlate(&[moving(a), moving(b)], turns, own, outs),
            _ => unreachable!("a score has one or two products"),
        };
    }
}

/// A product that does not vanish.
struct Kept<T> {
    factors: &'static str,
    fixed: Array3<Complex32>,
    support: IndexBox,
    moving: MovingField<T>,
    met: Overlap,
    /// The moving box that the transforms are given; holds that of `met`.
    placed: IndexBox,
}

/// Cells by which a node may be off its mirror image.
const OFF: f64 = 1e-9;

/// Makes all moving boxes one box that is symmetric about the pivot, as half turns demand, and
/// returns the transforms' size, if that can be done and four half turns at once then cost less than
/// four rotations by transforms of `size`; if not, nothing is changed.
fn symmetric<T: Real>(
    kept: &mut [Kept<T>],
    window: IndexBox,
    size: [usize; 3],
    origin: DVec3,
) -> Option<[usize; 3]> {
    // Node i is the mirror image of node `middle - i`.
    let middle = -2.0 * origin;
    if (middle - middle.round()).abs().max_element() > OFF {
        return None;
    }
    let middle = middle.round().to_array().map(|v| v as i64);
    let symmetric = |k: &Kept<T>| k.met.symmetric(k.support, window, middle);
    let met: Vec<_> = kept.iter().map(symmetric).collect();
    let placed = met.iter().map(|m| m.moving).reduce(|a, b| a.hull(&b))?;
    let shape = window.shape();
    let placed_shapes = vec![placed.shape(); met.len()];
    let periods = met.iter().map(|m| m.min_period);
    let longer = transform_size(periods.chain([placed.shape()]), shape, &placed_shapes).ok()?;
    let one = seconds(size, shape, &shapes(kept), 1)?;
    if seconds(longer, shape, &placed_shapes, 4)? > one {
        return None;
    }
    for (k, met) in kept.iter_mut().zip(met) {
        (k.met, k.placed) = (met, placed);
    }
    Some(longer)
}

/// Shapes of the moving boxes.
fn shapes<T>(kept: &[Kept<T>]) -> Vec<[usize; 3]> {
    kept.iter().map(|k| k.placed.shape()).collect()
}

/// The products of the score: name, weights of the fixed field, weights of the moving field.
fn products(pair: &Pair) -> Vec<(&'static str, Weights, Weights)> {
    let m = pair.model();
    let (l1, l2, w) = (m.lambda_exterior, m.lambda_interior, m.separation_weight);
    if w == 1.0 {
        return vec![("whole * whole", [l1, l2], [l1, l2])];
    }
    let second = if w == 0.0 {
        "interior * exterior"
    } else {
        "whole * exterior"
    };
    vec![
        ("whole * interior", [l1 * l2, l2 * l2], [0.0, 1.0]),
        (second, [w * l1 * l1, l1 * l2], [1.0, 0.0]),
    ]
}

fn combined(field: &DensityField, weights: Weights) -> Array3<Complex32> {
    let [e, i] = weights.map(|w| w as f32);
    Zip::from(&field.exterior)
        .and(&field.interior)
        .map_collect(|a, b| a * e + b * i)
}

fn single(field: &DensityField, weights: Weights) -> Array3<Complex32> {
    match weights {
        [0.0, 1.0] => field.interior.clone(),
        [1.0, 0.0] => field.exterior.clone(),
        _ => combined(field, weights),
    }
}

fn check_finite(part: &'static str, field: &DensityField) -> Result<(), CorrelateError> {
    for values in [&field.exterior, &field.interior] {
        if let Some(((i, j, k), _)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(CorrelateError::NotFinite {
                part,
                index: [i, j, k],
            });
        }
    }
    Ok(())
}

/// Good lengths for all products at once, from the shortest that each may have.
pub(crate) fn transform_size(
    periods: impl Iterator<Item = [usize; 3]>,
    window: [usize; 3],
    moving: &[[usize; 3]],
) -> Result<[usize; 3], CorrelateError> {
    let longer = |min: [usize; 3], period: [usize; 3]| [0, 1, 2].map(|a| min[a].max(period[a]));
    let min = periods.fold(window, longer);
    let points = |size: [usize; 3]| size.iter().fold(1u64, |n, s| n.saturating_mul(*s as u64));
    let too_large = |size| CorrelateError::Size {
        size,
        limit: Correlator::MAX_POINTS,
    };
    if points(min) > Correlator::MAX_POINTS {
        return Err(too_large(min));
    }
    let size = best_size(min, window, moving);
    if points(size) > Correlator::MAX_POINTS {
        return Err(too_large(size));
    }
    Ok(size)
}

/// The nodes of the fixed field inside of `kept` in the periodic box, so that window index 0 comes
/// out at index 0; `moving_first` is the first index of the moving box.
pub(crate) fn periodic<T: Real>(
    fixed: &Array3<Complex32>,
    kept: &IndexBox,
    moving_first: [i64; 3],
    window_first: [i64; 3],
    size: [usize; 3],
    scale: T,
) -> Array3<Complex<T>> {
    let mut field = Array3::zeros(size);
    let IndexBox { lo, hi } = *kept;
    for i in lo[0]..hi[0] {
        for j in lo[1]..hi[1] {
            for k in lo[2]..hi[2] {
                let at = [i, j, k];
                let to: [usize; 3] = std::array::from_fn(|a| {
                    let from_start = at[a] - moving_first[a] - window_first[a];
                    from_start.rem_euclid(size[a] as i64) as usize
                });
                let v = fixed[at.map(|v| v as usize)];
                let wide = |v: f32| T::nearest(f64::from(v)) * scale;
                field[to] = Complex::new(wide(v.re), wide(v.im));
            }
        }
    }
    field
}

#[cfg(test)]
#[path = "correlate_tests.rs"]
mod tests;
