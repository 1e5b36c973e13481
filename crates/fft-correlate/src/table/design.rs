//! Which table a pair is given: its nodes, its symmetry, what it records.

use crate::correlate::CorrelateError;
use crate::geometry::translation::TranslationWindow;
use crate::pair::budget::correlation_bytes;
use crate::pair::fields::Pair;
use crate::rotations::domain::{RotationDomain, RotationError};
use crate::rotations::symmetry::{symmetry_on_lattice, table_symmetry};
use crate::setup::pair_setup::PairSetup;
use crate::table::pair_energies::PairEnergies;
use crate::table::spec::TableSpec;

/// A pair and the table that is to be computed of it.
#[derive(Debug, Clone)]
pub struct TableDesign {
    /// The pair; its gamma is the table's.
    pub pair: Pair,
    /// Displacements of the pivot.
    pub window: TranslationWindow,
    /// What the table holds; how it is stored may be changed.
    pub spec: TableSpec,
    /// Bounding radius of the moving part about the pivot, metres.
    radius: f64,
}

/// Why there is no such table.
#[derive(Debug, thiserror::Error)]
pub enum TableDesignError {
    /// The translations do not make a window.
    #[error("translations: {0}")]
    Window(#[from] sdf_grid::LatticeError),
    /// The rotations do not make a grid.
    #[error("rotations: {0}")]
    Rotations(#[from] RotationError),
    /// The correlation that would fill it cannot be planned.
    #[error(transparent)]
    Correlate(#[from] CorrelateError),
    /// The correlation that would fill it does not fit in memory.
    #[error("the correlation needs about {needed} bytes, expected at most {limit}")]
    Memory {
        /// Bytes needed, about.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
}

impl TableDesign {
    /// The table of a setup's pair over its box of displacements and `rotations` (of
    /// the shapes), shortened by the
    /// symmetry of either part. `pair` is [`PairSetup::load`]'s.
    ///
    /// # Errors
    /// If the box has too many nodes.
    pub fn new(
        setup: &PairSetup,
        pair: Pair,
        rotations: RotationDomain,
    ) -> Result<Self, TableDesignError> {
        let middle = setup.center + pair.displacement(&setup.assembled);
        let (reach, spacing) = (setup.reach(), pair.spacing());
        let window = TranslationWindow::new(middle - reach, middle + reach, spacing)?;
        let axes = [&setup.fixed, &setup.moving].map(|mesh| symmetry_on_lattice(mesh, spacing));
        let symmetry = table_symmetry(&rotations, &axes[0], &axes[1]);
        let spec = TableSpec {
            symmetry,
            placement: setup.placement,
            ..TableSpec::for_pair(&pair, &window, rotations)
        };
        Ok(Self {
            radius: setup.moving.radius_about(pair.pivot()),
            pair,
            window,
            spec,
        })
    }

    /// The correlation that fills the table, if it needs no more than `limit` bytes.
    ///
    /// # Errors
    /// If it would need more, or the rotations are out of range or too many.
    pub fn energies(&self, limit: u64) -> Result<PairEnergies, TableDesignError> {
        let needed = correlation_bytes(self.window.shape(), self.radius, self.pair.spacing());
        if needed > limit {
            return Err(TableDesignError::Memory { needed, limit });
        }
        let grid = self.spec.grid()?;
        Ok(PairEnergies::plan_for(
            &self.pair,
            &self.window,
            grid.nodes(),
        )?)
    }
}
