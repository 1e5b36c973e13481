//! The kernel against the paper's complex form and the half-space table.

use num_complex::Complex64;
use sdf_grid::DensityKernel;

use crate::common::{SIGMAS, kernel_h, simpson};

#[test]
fn unit_integrals_of_a_half_space() {
    let table = [
        (0.05, -0.022774, 0.601768),
        (0.1, -0.041577, 0.577451),
        (0.2, -0.069830, 0.531771),
    ];
    for (sigma, a, b) in table {
        let half = DensityKernel::new(sigma).unwrap().half_space();
        // Six printed digits.
        assert!(
            (half - Complex64::new(a, b)).norm() < 1e-6,
            "{sigma}: {half}"
        );
    }
}

#[test]
fn half_space_by_another_quadrature() {
    for sigma in SIGMAS {
        let kernel = DensityKernel::new(sigma).unwrap();
        let integrand = |u: f64| {
            let (x, w) = ((u - 1.0) / sigma, 1.0 / (1.0 + u * u));
            Complex64::new(1.0 - u * u, 2.0 * u) * ((-0.5 * x * x).exp() * w * w / sigma)
        };
        let sum = simpson(1.0, 1.0 + 10.0 * sigma, 4000, integrand);
        // Simpson's error at step sigma/400.
        assert!((kernel.half_space() - sum).norm() < 1e-11);
        assert!((kernel.kappa() - sum.norm()).abs() < 1e-11);
    }
}

#[test]
fn unit_kernel_is_the_papers() {
    for sigma in SIGMAS {
        let kernel = DensityKernel::new(sigma).unwrap();
        for u in (0..40).map(|i| 1.0 + 0.2 * sigma * f64::from(i)) {
            let unit = kernel.unit(u);
            assert!((unit.conj() - kernel_h(u, sigma, 1.0, 1.0)).norm() < 1e-12);
            assert!((unit + kernel_h(u, sigma, -1.0, -1.0)).norm() < 1e-12);
        }
    }
}

#[test]
fn radial_derivatives_are_central_differences() {
    for sigma in SIGMAS {
        let kernel = DensityKernel::new(sigma).unwrap();
        for u in (0..30).map(|i| 0.8 + 0.2 * sigma * f64::from(i)) {
            let h = 1e-4 * sigma;
            let [below, at, above] = [u - h, u, u + h].map(|u| kernel.radial(u));
            // Second-order differences; the scale of a derivative is 1 / sigma per order.
            for order in 0..2 {
                let difference = (above[order] - below[order]) / (2.0 * h);
                let bound = 1e-6 / sigma.powi(order as i32 + 2);
                assert!(
                    (difference - at[order + 1]).norm() < bound,
                    "{sigma} {u} {order}"
                );
            }
        }
    }
}

#[test]
fn sigma_out_of_range_is_refused() {
    for sigma in [0.0, -0.1, 0.029, 0.51, f64::NAN, f64::INFINITY] {
        let error = DensityKernel::new(sigma).unwrap_err();
        assert!(error.to_string().contains("sigma must be from 0.03 to 0.5"));
    }
}
