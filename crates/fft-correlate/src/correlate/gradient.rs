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
use glam::{DMat3, DVec3};
use num_complex::Complex;

use super::contract::MovingRows;
use super::real::Real;
use super::resample::Turned;

/// One component of the gradient of a turned field.
pub(crate) struct Derivative<'a, T> {
    pub(super) turned: Turned<'a, T>,
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
