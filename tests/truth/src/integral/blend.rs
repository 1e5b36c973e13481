//! Which density's gradient a force is taken from.
//!
//! A displacement of the moving part changes the score by the integral of `(∇ρ1) ρ2` as well as of
//! `-ρ1 ∇ρ2`. Gradients grow as one over the distance from a sharp edge of their own part, which no
//! quadrature of few points likes. Both ways, the divergence theorem gives for any smooth share `χ`
//!
//! `∫ (χ ∇ρ1) ρ2 - ((1 - χ) ρ1) ∇ρ2 + (∇χ) ρ1 ρ2 dV`,
//!
//! and the same of moments, for turning displaces without compressing. With `χ` zero on the fixed
//! part's sharp edges and one on the moving part's, every term is bounded but where edges of both
//! parts meet.

use glam::DVec3;

/// The share of the gradient of the fixed part's density at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blend {
    /// `χ`, 0 ..= 1.
    pub(super) fixed: f64,
    /// Its gradient in the fixed frame, per metre.
    pub(super) slope: DVec3,
}

impl Blend {
    /// Far from all sharp edges.
    pub(super) const EVEN: Self = Self {
        fixed: 0.5,
        slope: DVec3::ZERO,
    };

    /// At these vectors from the nearest sharp edge of the fixed and of the moving part, none if
    /// farther than `reach`.
    pub(super) fn from_points(fixed: Option<DVec3>, moving: Option<DVec3>, reach: f64) -> Self {
        let (a, da) = rise(fixed, reach);
        let (b, db) = rise(moving, reach);
        let sum = a + b;
        if sum < 1e-24 {
            return Self::EVEN;
        }
        Self {
            fixed: a / sum,
            slope: (da * b - db * a) / (sum * sum),
        }
    }
}

/// A smooth step from 0 at an edge to 1 at `reach`, and its gradient.
fn rise(offset: Option<DVec3>, reach: f64) -> (f64, DVec3) {
    let Some(offset) = offset.filter(|d| d.length() < reach) else {
        return (1.0, DVec3::ZERO);
    };
    let t = offset.length() / reach;
    // d t² (3 - 2 t) / dr along offset / r.
    let slope = offset * (6.0 * (1.0 - t) / (reach * reach));
    (t * t * (3.0 - 2.0 * t), slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_share_goes_from_none_to_all_and_its_slope_is_its_derivative() {
        let at = |p: DVec3| Blend::from_points(Some(p), Some(p - DVec3::X), 1.5);
        assert!(at(DVec3::Y * 1e-9).fixed < 1e-12);
        assert!(at(DVec3::X + DVec3::Y * 1e-9).fixed > 1.0 - 1e-12);
        let p = DVec3::new(0.4, 0.3, -0.5);
        for axis in DVec3::AXES {
            let h = 1e-6;
            let slope = (at(p + axis * h).fixed - at(p - axis * h).fixed) / (2.0 * h);
            assert!((slope - at(p).slope.dot(axis)).abs() < 1e-8);
        }
        assert_eq!(Blend::from_points(None, None, 1.0), Blend::EVEN);
    }
}
