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

use glam::{DQuat, DVec3};
use ndarray::{Array3, ArrayViewMut3, Zip};
use num_complex::Complex32;
use sdf_grid::DensityField;
use serde::Serialize;

use crate::fft3::good_length;
use crate::overlap::{IndexBox, Overlap, overlap};
use crate::resample::{MovingField, Turned, support};
use crate::spectral::{FixedTerm, MovingRows, Spectral, SpectralScratch, memory};
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

/// Scores one pair over one window; shared by all threads.
pub struct Correlator {
    plan: CorrelatorPlan,
    spectral: Option<Spectral>,
    products: Vec<Product>,
    /// Position of fixed-lattice node 0 relative to the pivot, cells.
    origin: DVec3,
}

struct Product {
    moving: MovingField,
    moving_box: IndexBox,
}

impl Product {
    fn turned(&self, rotation: DQuat, origin: DVec3) -> Turned<'_> {
        self.moving.turned(rotation, origin, self.moving_box)
    }
}

/// Working memory of one thread; see [`Correlator::scratch`].
pub struct CorrelatorScratch {
    spectral: Option<SpectralScratch>,
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
        let (fixed_bytes, scratch_bytes) = memory(size, shape, &moving_shapes);
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
        };
        let mut terms = Vec::new();
        let mut products = Vec::new();
        for (_, fixed, moving, met) in kept {
            terms.push(FixedTerm {
                field: periodic(&fixed, &met, first, size, h.powi(3) as f32),
                moving_shape: met.moving.shape(),
            });
            products.push(Product {
                moving,
                moving_box: met.moving,
            });
        }
        Ok(Self {
            spectral: (!terms.is_empty()).then(|| Spectral::new(size, shape, terms)),
            plan,
            products,
            origin,
        })
    }

    /// Sizes, transforms and memory.
    pub fn description(&self) -> &CorrelatorPlan {
        &self.plan
    }

    /// Working memory for [`Correlator::score`], one per thread.
    pub fn scratch(&self) -> CorrelatorScratch {
        CorrelatorScratch {
            spectral: self.spectral.as_ref().map(Spectral::scratch),
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
        scratch: &mut CorrelatorScratch,
        mut out: ArrayViewMut3<f32>,
    ) {
        assert_eq!(out.shape(), self.plan.window, "shape of the output");
        let (Some(spectral), Some(scratch)) = (&self.spectral, &mut scratch.spectral) else {
            out.fill(0.0);
            return;
        };
        match self.products.as_slice() {
            [a] => {
                let a = a.turned(rotation, self.origin);
                spectral.correlate(&[&a], scratch, &mut out);
            }
            [a, b] => {
                let (a, b) = (
                    a.turned(rotation, self.origin),
                    b.turned(rotation, self.origin),
                );
                let rows: [&dyn MovingRows; 2] = [&a, &b];
                spectral.correlate(&rows, scratch, &mut out);
            }
            _ => unreachable!("a score has one or two products"),
        }
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
    overlaps: impl Iterator<Item = &'a Overlap>,
    window: [usize; 3],
) -> Result<[usize; 3], CorrelateError> {
    let mut min = window;
    for o in overlaps {
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
    // The z lines end in a real transform, which is fast for even lengths.
    let size = std::array::from_fn(|a| good_length(min[a], a == 2));
    if points(size) > Correlator::MAX_POINTS {
        return Err(too_large(size));
    }
    Ok(size)
}

/// The fixed field in the periodic box, so that window index 0 comes out at index 0.
pub(crate) fn periodic(
    fixed: &Array3<Complex32>,
    met: &Overlap,
    window_first: [i64; 3],
    size: [usize; 3],
    scale: f32,
) -> Array3<Complex32> {
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
                field[to] = v * scale;
            }
        }
    }
    field
}

#[cfg(test)]
#[path = "correlate_tests.rs"]
mod tests;
