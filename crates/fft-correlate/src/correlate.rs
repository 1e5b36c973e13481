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
use crate::{Pair, TranslationWindow};

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
    /// Seconds that a rotation should take on one thread, by a model measured with vectors of eight
    /// f32 (AVX2); empty space in the moving part makes it faster.
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
    moving_box: IndexBox,
}

impl<T: Real> Product<T> {
    pub(crate) fn turned(&self, rotation: DQuat, origin: DVec3) -> Turned<'_, T> {
        self.moving.turned(rotation, origin, self.moving_box)
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
        Self::plan_as(pair, window, Way::native())
    }
}

impl Correlator<f64> {
    /// As [`Correlator::plan`], in double precision: the same steps with an error of about 1e-15
    /// instead of 1e-7, to tell rounding from everything else.
    ///
    /// # Errors
    /// As [`Correlator::plan`].
    pub fn plan_double(pair: &Pair, window: &TranslationWindow) -> Result<Self, CorrelateError> {
        Self::plan_as(pair, window, Way::native())
    }
}

impl<T: Real> Correlator<T> {
    fn plan_as(pair: &Pair, window: &TranslationWindow, way: Way) -> Result<Self, CorrelateError> {
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
        let origin = (pair.fixed().lattice.origin() - pair.pivot()) / h;
        let moving_first = (pair.moving().lattice.origin() - pair.pivot()) / h;

        let mut skipped = Vec::new();
        let mut kept = Vec::new();
        for (factors, fixed, moving) in products(pair) {
            let fixed = combined(pair.fixed(), fixed);
            let moving = MovingField::new(&single(pair.moving(), moving), moving_first);
            let met = moving.and_then(|m| {
                let o = overlap(support(&fixed)?, m.reach(origin), window_box)?;
                Some((m, o))
            });
            match met {
                Some((moving, met)) => kept.push((factors, fixed, moving, met)),
                None => skipped.push(factors),
            }
        }
        let size = transform_size(kept.iter().map(|k| &k.3), shape)?;
        let moving_shapes: Vec<_> = kept.iter().map(|k| k.3.moving.shape()).collect();
        let (fixed_bytes, scratch_bytes) = memory::<T>(size, shape, &moving_shapes);
        let plan = CorrelatorPlan {
            transform_size: size,
            window: shape,
            products: kept
                .iter()
                .map(|(factors, _, _, met)| ProductPlan {
                    factors,
                    fixed_nodes: met.fixed.shape(),
                    moving_nodes: met.moving.shape(),
                })
                .collect(),
            skipped,
            forward_transforms: 2 * kept.len(),
            inverse_transforms: usize::from(!kept.is_empty()),
            shared_bytes: fixed_bytes + kept.iter().map(|k| k.2.bytes()).sum::<u64>(),
            scratch_bytes,
            expected_seconds: seconds(size, shape, &moving_shapes).unwrap_or(f64::NAN),
        };
        tracing::debug!(%plan, "correlator");
        let mut terms = Vec::new();
        let mut products = Vec::new();
        for (_, fixed, moving, met) in kept {
            terms.push(FixedTerm {
                field: periodic(&fixed, &met, first, size, T::nearest(h.powi(3))),
                moving_shape: met.moving.shape(),
            });
            products.push(Product {
                moving,
                moving_box: met.moving,
            });
        }
        Ok(Self {
            spectral: (!terms.is_empty()).then(|| Spectral::new(way, size, shape, terms)),
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

    /// Working memory for [`Correlator::score`], one per thread.
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
        self.correlate(scratch, &mut out, |p| p.turned(rotation, self.origin));
    }

    /// The sum of all products, with the moving fields that `moving` makes of them.
    pub(crate) fn correlate<'a, M: MovingRows<T>>(
        &'a self,
        scratch: &mut CorrelatorScratch<T>,
        out: &mut ArrayViewMut3<T>,
        moving: impl Fn(&'a Product<T>) -> M,
    ) {
        assert_eq!(out.shape(), self.plan.window, "shape of the output");
        let (Some(spectral), Some(own)) = (&self.spectral, &mut scratch.spectral) else {
            out.fill(T::zero());
            scratch.times = StageTimes::default();
            return;
        };
        scratch.times = match self.products.as_slice() {
            [a] => spectral.correlate(&[moving(a)], own, out),
            [a, b] => spectral.correlate(&[moving(a), moving(b)], own, out),
            _ => unreachable!("a score has one or two products"),
        };
    }
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

/// Good lengths for all products at once.
pub(crate) fn transform_size<'a>(
    overlaps: impl Iterator<Item = &'a Overlap> + Clone,
    window: [usize; 3],
) -> Result<[usize; 3], CorrelateError> {
    let mut min = window;
    for o in overlaps.clone() {
        min = std::array::from_fn(|a| min[a].max(o.min_period[a]));
    }
    let points = |size: [usize; 3]| size.iter().fold(1u64, |n, s| n.saturating_mul(*s as u64));
    let too_large = |size| CorrelateError::Size {
        size,
        limit: Correlator::MAX_POINTS,
    };
    if points(min) > Correlator::MAX_POINTS {
        return Err(too_large(min));
    }
    let moving: Vec<_> = overlaps.map(|o| o.moving.shape()).collect();
    let size = best_size(min, window, &moving);
    if points(size) > Correlator::MAX_POINTS {
        return Err(too_large(size));
    }
    Ok(size)
}

/// The fixed field in the periodic box, so that window index 0 comes out at index 0.
pub(crate) fn periodic<T: Real>(
    fixed: &Array3<Complex32>,
    met: &Overlap,
    window_first: [i64; 3],
    size: [usize; 3],
    scale: T,
) -> Array3<Complex<T>> {
    let mut field = Array3::zeros(size);
    let IndexBox { lo, hi } = met.fixed;
    for i in lo[0]..hi[0] {
        for j in lo[1]..hi[1] {
            for k in lo[2]..hi[2] {
                let at = [i, j, k];
                let to: [usize; 3] = std::array::from_fn(|a| {
                    let from_start = at[a] - met.moving.lo[a] - window_first[a];
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
