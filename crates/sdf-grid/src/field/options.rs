//! How fields are computed.

use serde::{Deserialize, Serialize};

/// How a lattice value represents the density around its node.
///
/// See the example of [`DensityOptions`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sampling {
    /// The value at the node.
    Point,
    /// The mean over the node's cubic cell, by 4 x 4 x 4 sub-points in the cells that the boundary
    /// may cut; the value at the node elsewhere. Exterior and interior are averaged separately, so
    /// in a cut cell both are non-zero.
    CellAverage,
    /// The convolution, jumps included, with a Gaussian.
    Smoothed {
        /// Its standard deviation per axis, metres.
        deviation: f64,
        /// `S`, square metres, of `1 - S/2 Δ` applied on top of it; 0 for none. With the variance
        /// per axis by which the product of two fields is smoothed in all, the product loses
        /// nothing to second order.
        sharpening: f64,
    },
}

impl Sampling {
    /// What a field of it holds.
    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "points",
            Self::CellAverage => "cell averages",
            Self::Smoothed { .. } => "smoothed densities",
        }
    }
}

/// Standard deviations beyond the boundary at which smoothed densities end. There the Gaussian
/// leaves a thousandth of a jump, and sharpening four thousandths.
const SPREAD: f64 = 3.0;
const SPREAD_SHARPENED: f64 = 3.5;

impl Sampling {
    /// Distance from the boundary, metres, at which densities end on the other side of it; 0 if none
    /// gets there, but for the cells that the boundary cuts.
    pub fn spread(&self) -> f64 {
        match *self {
            Self::Point | Self::CellAverage => 0.0,
            Self::Smoothed {
                deviation,
                sharpening,
            } if sharpening > 0.0 => SPREAD_SHARPENED * deviation,
            Self::Smoothed { deviation, .. } => SPREAD * deviation,
        }
    }
}

/// How accurate a field must be and how it is sampled.
///
/// ```
/// use sdf_grid::{DensityOptions, Sampling};
///
/// let sampling = Sampling::Smoothed { deviation: 0.0007, sharpening: 0.0 };
/// let options = DensityOptions { sampling, halo: 0.01, ..DensityOptions::default() };
/// options.validate()?;
/// // Smoothed over 0.7 mm, densities end 2.1 mm beyond the boundary.
/// assert!((options.sampling.spread() - 0.0021).abs() < 1e-12);
/// assert!(DensityOptions { tolerance: 0.5, ..options }.validate().is_err());
/// # Ok::<(), sdf_grid::DensityError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DensityOptions {
    /// Relative L2 error against the f64 reference that the field must meet, 1e-5 .. 1e-2.
    pub tolerance: f64,
    /// How a lattice value represents its cell.
    pub sampling: Sampling,
    /// Distance outside the part, metres, at which the exterior density has faded to zero
    /// (smooth cut-off from 70 % of it); infinite for none.
    pub halo: f64,
}

impl Default for DensityOptions {
    /// Tolerance 1e-3, cell averages, no halo.
    fn default() -> Self {
        Self {
            tolerance: 1e-3,
            sampling: Sampling::CellAverage,
            halo: f64::INFINITY,
        }
    }
}

impl DensityOptions {
    /// Checks every option against its range.
    ///
    /// # Errors
    /// Names the first option out of range.
    pub fn validate(&self) -> Result<(), DensityError> {
        let refuse = |name, expected, found| DensityError::Option {
            name,
            expected,
            found,
        };
        if !(1e-5..=1e-2).contains(&self.tolerance) {
            return Err(refuse("tolerance", "from 1e-5 to 1e-2", self.tolerance));
        }
        if let Sampling::Smoothed { deviation, .. } = self.sampling
            && !(deviation.is_finite() && deviation > 0.0)
        {
            return Err(refuse("deviation", "finite and > 0 metres", deviation));
        }
        if let Sampling::Smoothed { sharpening, .. } = self.sampling
            && !(sharpening.is_finite() && sharpening >= 0.0)
        {
            return Err(refuse(
                "sharpening",
                "finite and >= 0 square metres",
                sharpening,
            ));
        }
        if self.halo.is_nan() || self.halo <= 0.0 {
            return Err(refuse("halo", "> 0 metres", self.halo));
        }
        Ok(())
    }
}

/// Why a field cannot be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DensityError {
    /// The caller's monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// An option is out of its range.
    #[error("density option {name} must be {expected}, found {found}")]
    Option {
        /// The option.
        name: &'static str,
        /// Its accepted range.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The mesh has no triangle with an area.
    #[error("a density needs a mesh with at least one triangle of non-zero area, found none")]
    EmptyMesh,
    /// The field's arrays cannot be allocated.
    #[error("density field needs {bytes} bytes of memory, which cannot be had")]
    Memory {
        /// What the field needs.
        bytes: u64,
    },
}
