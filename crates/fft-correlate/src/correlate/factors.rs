//! The products that a score is the sum of, each of a fixed and a moving factor.

use ndarray::Array3;
use num_complex::{Complex, Complex32};
use sdf_grid::DensityField;

use super::overlap::IndexBox;
use super::real::Real;
use crate::pair::model::ScoreModel;

/// One product of the score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Product {
    /// The two factors: fixed, then moving.
    pub(super) name: &'static str,
    pub(super) fixed: Factor,
    pub(super) moving: Factor,
}

/// A sum of a part's densities: weights of the exterior and of the interior.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Factor([f64; 2]);

impl Factor {
    /// At one node.
    pub(super) fn value(&self, field: &DensityField, at: [usize; 3]) -> Complex32 {
        match self.0 {
            [0.0, 1.0] => field.interior[at],
            [1.0, 0.0] => field.exterior[at],
            weights => {
                let [e, i] = weights.map(|w| w as f32);
                field.exterior[at] * e + field.interior[at] * i
            }
        }
    }

    /// Zero wherever the part is not solid.
    pub(super) fn is_interior(&self) -> bool {
        self.0[0] == 0.0
    }

    /// The nodes inside of `kept` in the periodic box, so that window index 0 comes out at index 0;
    /// `moving_first` is the first index of the moving box.
    pub(super) fn periodic<T: Real>(
        &self,
        field: &DensityField,
        kept: &IndexBox,
        moving_first: [i64; 3],
        window_first: [i64; 3],
        size: [usize; 3],
        scale: T,
    ) -> Array3<Complex<T>> {
        let mut periodic = Array3::zeros(size);
        let wide = |v: f32| T::nearest(f64::from(v)) * scale;
        for at in kept.indices() {
            let to: [usize; 3] = std::array::from_fn(|a| {
                let from_start = at[a] as i64 - moving_first[a] - window_first[a];
                from_start.rem_euclid(size[a] as i64) as usize
            });
            let v = self.value(field, at);
            periodic[to] = Complex::new(wide(v.re), wide(v.im));
        }
        periodic
    }
}

/// The products of a score: at most two.
pub(super) fn products(m: &ScoreModel) -> impl Iterator<Item = Product> {
    let (l1, l2, w) = (m.lambda_exterior, m.lambda_interior, m.separation_weight);
    let product = |name, fixed, moving| Product {
        name,
        fixed: Factor(fixed),
        moving: Factor(moving),
    };
    let products = if w == 1.0 {
        [Some(product("whole * whole", [l1, l2], [l1, l2])), None]
    } else {
        let second = if w == 0.0 {
            "interior * exterior"
        } else {
            "whole * exterior"
        };
        [
            Some(product("whole * interior", [l1 * l2, l2 * l2], [0.0, 1.0])),
            Some(product(second, [w * l1 * l1, l1 * l2], [1.0, 0.0])),
        ]
    };
    products.into_iter().flatten()
}
