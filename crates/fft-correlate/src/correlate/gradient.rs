//! The exact gradient of the score at all translations of a window: what a wrench is made of.
//!
//! The score's only dependence on the pose is through the turned moving field,
//! `f(d) = Re sum_p A(p) g(p - d)`, and `g` is an interpolant with a gradient of its own. So
//!
//! - by the displacement: `-Re sum_p A(p) (∇g)(p - d)`,
//! - by a turn about the displaced pivot: `-Re sum_p A(p) (q × ∇g)(q)` with `q = p - d`,
//!
//! six correlations with the spectra that the score has already. Multiplying the score's own
//! spectrum by `i k` would be cheaper, but only the window's scores are free of wrap-around and of
//! cropping: what lies outside rings into the window's derivative, and turns have no such factor.

use std::ops::Range;

use fearless_simd::prelude::*;
use glam::{DMat3, DQuat, DVec3};
use ndarray::ArrayViewMut3;
use num_complex::Complex;

use crate::correlate::{Correlator, CorrelatorScratch};
use crate::real::Real;
use crate::resample::Turned;
use crate::spectral::MovingRows;

/// One component of the gradient of a turned field.
pub(crate) struct Derivative<'a, T> {
    turned: Turned<'a, T>,
    rotation: DMat3,
    /// Position of index `[0, 0, 0]` relative to the pivot, cells of the fixed frame.
    corner: DVec3,
    /// 0 to 2 the turn about x, y, z; 3 to 5 the displacement along them.
    component: usize,
    /// What a derivative per cell is multiplied with.
    scale: f64,
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

    fn fill(&self, x: usize, y: usize, row: &mut [Complex<T>]) -> bool {
        for z in self.bounds()[2].clone() {
            row[z] = self.at(x, y, z);
        }
        true
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

impl<T: Real> Correlator<T> {
    /// Writes the gradient of `Re f` (eq_5b, eq_5c) for `rotation` at every displacement of the
    /// window to `out`, angular part first: by a turn about the x, y, z axis of the fixed frame
    /// through the displaced pivot (cubic metres per radian), then by the displacement along x, y, z
    /// (square metres). The wrench about the pivot is gamma times it (eq_9a, eq_9b).
    ///
    /// Costs six scores with a slower resampling; it is exact for the sum that
    /// [`Correlator::score`] computes. Where a sample lies on a face between cells of the moving
    /// lattice the interpolant has a kink, and the derivative is that of one of its sides. Allocates
    /// nothing.
    ///
    /// # Panics
    /// As [`Correlator::score`].
    pub fn gradient(
        &self,
        rotation: DQuat,
        scratch: &mut CorrelatorScratch<T>,
        out: [ArrayViewMut3<'_, T>; 6],
    ) {
        for (component, out) in out.into_iter().enumerate() {
            let scale = if component < 3 {
                1.0
            } else {
                1.0 / self.spacing
            };
            self.correlate(&[], scratch, &mut [out], |product| Derivative {
                turned: product.turned(rotation, self.origin),
                rotation: DMat3::from_quat(rotation),
                corner: product.corner(self.origin),
                component,
                scale,
            });
        }
    }
}
