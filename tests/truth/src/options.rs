//! How finely a truth is computed.

use num_complex::Complex64;

use crate::error::TruthError;

/// What the one-sided densities of both parts are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Densities {
    /// Those of the model.
    Model,
    /// Constants, without a cut-off at the halo: without separation the score then is
    /// `l1 l2 Re(O I) (|V1| + |V2| - 2 X) + l2² Re(I²) X`, `X` the volume that both solids share.
    Constant {
        /// Unit density `O` outside, dimensionless.
        exterior: Complex64,
        /// Unit density `I` inside, dimensionless.
        interior: Complex64,
    },
}

/// Radius of the tubes about sharp edges, in narrowest extents, unless cells are too large for it.
/// Inside, cells are not refined by how well they fit: a wide tube errs however small the cells are.
const TUBE: f64 = 0.02;

/// How finely a truth is computed. Lengths are shares of the narrowest extent of the smaller part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthOptions {
    /// Error of the fitted densities above which a cell is cut, unless it is among the smallest;
    /// dimensionless, 1e-6 ..= 1.
    pub tolerance: f64,
    /// Edge of the smallest cells, at edges and corners; 1e-4 ..= 1.
    pub smallest: f64,
    /// Edge that cells have at most, `smallest` ..= 1.
    pub largest: f64,
    /// Where exteriors end, metres; default [`fft_correlate::pair::default_halo`].
    pub halo: Option<f64>,
    /// The densities.
    pub densities: Densities,
}

impl TruthOptions {
    /// A few per cent, for tests.
    pub const COARSE: Self = Self {
        tolerance: 1e-2,
        smallest: 1.0 / 20.0,
        largest: 0.25,
        halo: None,
        densities: Densities::Model,
    };

    /// On the square pair two such truths in frames turned against each other differ by 0.1 % of
    /// the energy's range, 1 % in force and little over 2 % in torque; seconds a pose.
    pub const FINE: Self = Self {
        tolerance: 5e-3,
        smallest: 0.016,
        largest: 1.0 / 6.0,
        halo: None,
        densities: Densities::Model,
    };

    /// The cells for a pair whose smaller part is `extent` metres wide.
    pub(crate) fn cells(&self, extent: f64) -> Result<Cells, TruthError> {
        let check = |name, expected, found: f64, low: f64| match (low..=1.0).contains(&found) {
            true => Ok(found),
            false => Err(TruthError::Option {
                name,
                expected,
                found,
            }),
        };
        let smallest = check("smallest", "1e-4 ..= 1", self.smallest, 1e-4)?;
        Ok(Cells {
            tolerance: check("tolerance", "1e-6 ..= 1", self.tolerance, 1e-6)?,
            smallest: extent * smallest,
            tube: extent * TUBE.max(2.5 * smallest),
            largest: extent * check("largest", "smallest ..= 1", self.largest, smallest)?,
        })
    }
}

/// Sizes of cells in metres.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cells {
    pub(crate) tolerance: f64,
    pub(crate) smallest: f64,
    pub(crate) largest: f64,
    /// Radius of the tubes about sharp edges.
    pub(crate) tube: f64,
}

impl Cells {
    /// Deepest that an octree goes: samples are counted in 20 bits.
    const DEEPEST: f64 = 17.0;

    /// How often the edge of a root is halved to reach the smallest cells.
    pub(crate) fn depth(&self, edge: f64) -> u32 {
        (edge / self.smallest)
            .log2()
            .ceil()
            .clamp(0.0, Self::DEEPEST) as u32
    }
}
