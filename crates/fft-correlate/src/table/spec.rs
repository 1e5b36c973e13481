//! What a table holds: everything that decides its values.

use glam::DVec3;
use sdf_grid::Lattice;
use serde::{Deserialize, Serialize};

use crate::geometry::placement::Placement;
use crate::geometry::translation::TranslationWindow;
use crate::pair::contact::Contact;
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;
use crate::pair::recipe::PairRecipe;
use crate::rotations::domain::{AxisSymmetry, RotationDomain, RotationError};
use crate::rotations::grid::RotationGrid;
use crate::table::error::TableError;
use crate::table::layout::Layout;
use crate::table::storage::Storage;

/// What a table holds and for which pair: everything that decides its values. Window and rotations
/// are those of the shapes, each in its own frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableSpec {
    /// What the energies are made from; its lattices have the window's spacing.
    pub recipe: PairRecipe,
    /// Pivot displacements of the translation nodes, metres along the fixed part's own
    /// axes.
    pub window: Lattice,
    /// Rotations of the moving part.
    pub rotations: RotationDomain,
    /// A symmetry by which rotation nodes are left out.
    #[serde(default)]
    pub symmetry: Option<AxisSymmetry>,
    /// Energy far outside the table, joules. The model's own is 0, as densities fade.
    #[serde(default)]
    pub far_energy: f64,
    /// How energies are stored.
    #[serde(default)]
    pub storage: Storage,
    /// Where the scene that the table was baked for puts the shapes. It decides no value: tables of
    /// one pair agree whatever it is.
    pub placement: Placement,
    /// What smoothing took from the energies, added to every answer; stored as the parts' surfaces.
    #[serde(skip)]
    pub contact: Option<Contact>,
}

impl TableSpec {
    /// The table of a pair, without symmetry.
    pub fn for_pair(pair: &Pair, window: &TranslationWindow, rotations: RotationDomain) -> Self {
        Self {
            recipe: pair.recipe(),
            window: *window.lattice(),
            rotations,
            symmetry: None,
            far_energy: 0.0,
            storage: Storage::default(),
            placement: Placement::IDENTITY,
            contact: pair.contact().cloned(),
        }
    }

    /// The moving part's pivot, metres in its frame.
    pub fn pivot(&self) -> DVec3 {
        DVec3::from_array(self.recipe.pivot)
    }

    /// Weights of the score and the scale of the energy.
    pub fn model(&self) -> &ScoreModel {
        &self.recipe.model
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn validate(&self) -> Result<(), TableError> {
        self.recipe.model.validate()?;
        self.storage.validate()?;
        // A lattice read from a file has not passed through its constructor.
        let window = &self.window;
        Lattice::new(window.origin(), window.spacing(), window.shape()).map_err(|e| {
            TableError::Spec {
                name: "window",
                expected: "a lattice",
                found: e.to_string(),
            }
        })?;
        let finite = |name, ok: bool, found: String| {
            if ok {
                Ok(())
            } else {
                Err(TableError::Spec {
                    name,
                    expected: "finite",
                    found,
                })
            }
        };
        let pivot = self.pivot();
        finite("pivot", pivot.is_finite(), pivot.to_string())?;
        let far = self.far_energy;
        finite("far_energy", far.is_finite(), far.to_string())?;
        // Each is a file. What is no number of nodes at all is named by the grid.
        let (found, limit) = (self.box_nodes(), RotationGrid::MAX_NODES);
        match found.is_finite() && found > limit as f64 {
            true => Err(RotationError::Size { found, limit }.into()),
            false => Ok(()),
        }
    }

    /// About how many rotation nodes there are, before any are left out.
    pub(crate) fn box_nodes(&self) -> f64 {
        RotationGrid::box_nodes(&self.rotations, self.symmetry.as_ref())
    }

    /// The rotation nodes.
    ///
    /// # Errors
    /// As [`RotationGrid::new`].
    pub fn grid(&self) -> Result<RotationGrid, RotationError> {
        RotationGrid::new(&self.rotations, self.symmetry.as_ref())
    }

    /// Bytes of memory for `rotations` rotation nodes of which nothing is left out.
    pub fn bytes(&self, rotations: usize) -> u128 {
        2 * rotations as u128 * Layout::dense_length(self.window.shape())
    }

    /// Refuses more rotation nodes than fit.
    pub(crate) fn check_memory(&self, rotations: usize, limit: u64) -> Result<(), TableError> {
        self.check_bytes(rotations, self.bytes(rotations), limit)
    }

    pub(crate) fn check_bytes(
        &self,
        rotations: usize,
        needed: u128,
        limit: u64,
    ) -> Result<(), TableError> {
        if needed <= u128::from(limit) {
            return Ok(());
        }
        Err(TableError::Memory {
            rotations: rotations as u64,
            displacements: self.window.len() as u64,
            needed,
            limit,
        })
    }
}
