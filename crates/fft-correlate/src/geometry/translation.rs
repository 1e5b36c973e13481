//! The lattice of pivot displacements that a correlator scores.

use glam::DVec3;
use sdf_grid::{Lattice, LatticeError};

/// A box of pivot displacements in the fixed frame: the lattice nodes are integer multiples of the
/// spacing, so zero displacement is a node of every window that contains it.
///
/// ```
/// use fft_correlate::TranslationWindow;
/// use glam::DVec3;
///
/// // 4.5 mm is rounded outwards to 5 mm either way.
/// let window = TranslationWindow::cube(0.0045, 0.001)?;
/// assert_eq!(window.shape(), [11; 3]);
/// assert_eq!(window.displacement([5, 5, 5]), DVec3::ZERO);
/// assert!((window.displacement([0, 5, 5]).x + 0.005).abs() < 1e-12);
/// # Ok::<(), sdf_grid::LatticeError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TranslationWindow {
    lattice: Lattice,
}

impl TranslationWindow {
    /// The displacements from `min` to `max`, metres, both included; bounds between nodes are
    /// rounded outwards.
    ///
    /// # Errors
    /// If the spacing is not positive and finite, a bound is not finite, `min` exceeds `max`, or
    /// there would be more than [`Lattice::MAX_NODES`] nodes.
    pub fn new(min: DVec3, max: DVec3, spacing: f64) -> Result<Self, LatticeError> {
        if !(spacing.is_finite() && spacing > 0.0) {
            return Err(LatticeError::Spacing { found: spacing });
        }
        for bound in [min, max] {
            if !bound.is_finite() {
                return Err(LatticeError::Bounds { found: bound });
            }
        }
        // A bound within 1e-9 cells of a node counts as on it.
        let first = (min / spacing + 1e-9).floor();
        let last = (max / spacing - 1e-9).ceil();
        let nodes = last - first + 1.0;
        if nodes.min_element() < 1.0
            || nodes.x * nodes.y * nodes.z > Lattice::MAX_NODES as f64
            || min.cmpgt(max).any()
        {
            return Err(LatticeError::Size {
                shape: nodes.to_array(),
                limit: Lattice::MAX_NODES,
            });
        }
        let lattice = Lattice::new(
            first * spacing,
            spacing,
            nodes.to_array().map(|n| n as usize),
        )?;
        Ok(Self { lattice })
    }

    /// The displacements of at most `half_extent` metres along each axis, rounded outwards.
    ///
    /// # Errors
    /// As [`TranslationWindow::new`].
    pub fn cube(half_extent: f64, spacing: f64) -> Result<Self, LatticeError> {
        Self::new(
            DVec3::splat(-half_extent),
            DVec3::splat(half_extent),
            spacing,
        )
    }

    /// The displacements as a lattice, metres.
    pub fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    /// Displacements along x, y, z.
    pub fn shape(&self) -> [usize; 3] {
        self.lattice.shape()
    }

    /// Displacement of node `index`, metres in the fixed frame.
    pub fn displacement(&self, index: [usize; 3]) -> DVec3 {
        self.lattice.position(index)
    }

    /// Displacement of node `[0, 0, 0]` in whole spacings.
    pub fn first(&self) -> [i64; 3] {
        (self.lattice.origin() / self.lattice.spacing())
            .round()
            .to_array()
            .map(|c| c as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_multiples_of_the_spacing_and_cover_the_bounds() {
        let w =
            TranslationWindow::new(DVec3::new(-0.25, 0.1, 0.0), DVec3::new(0.3, 0.39, 0.0), 0.1)
                .unwrap();
        assert_eq!(w.first(), [-3, 1, 0]);
        assert_eq!(w.shape(), [7, 4, 1]);
        assert!((w.displacement([3, 0, 0]).x).abs() < 1e-15);
        let cube = TranslationWindow::cube(0.5, 0.1).unwrap();
        assert_eq!((cube.first(), cube.shape()), ([-5; 3], [11; 3]));
    }

    #[test]
    fn bad_windows_are_refused() {
        let at = |min: f64, max: f64, h: f64| {
            TranslationWindow::new(DVec3::splat(min), DVec3::splat(max), h)
        };
        assert!(matches!(
            at(0.0, 1.0, 0.0),
            Err(LatticeError::Spacing { .. })
        ));
        assert!(matches!(
            at(0.0, f64::NAN, 0.1),
            Err(LatticeError::Bounds { .. })
        ));
        assert!(matches!(
            at(1.0, 0.999_99, 0.1),
            Err(LatticeError::Size { .. })
        ));
        assert!(matches!(at(0.0, 1.0, 1e-9), Err(LatticeError::Size { .. })));
    }
}
