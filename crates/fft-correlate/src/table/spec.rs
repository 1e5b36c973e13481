//! What a table holds: everything that decides its values.

use glam::DVec3;
use sdf_grid::text::quoted;
use sdf_grid::{FieldProvenance, Lattice};
use serde::{Deserialize, Serialize};

use crate::geometry::placement::Placement;
use crate::geometry::translation::TranslationWindow;
use crate::pair::contact::Contact;
use crate::pair::fields::Pair;
use crate::pair::model::{ModelError, PairProvenance, ScoreModel};
use crate::rotations::domain::{AxisSymmetry, RotationDomain, RotationError};
use crate::rotations::grid::RotationGrid;
use crate::table::layout::Layout;

/// What a table holds and for which pair: everything that decides its values. Window and rotations
/// are those of the shapes, each in its own frame.
///
/// ```
/// use fft_correlate::*;
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let window = TranslationWindow::cube(0.008, 0.004)?;
/// let mut spec = TableSpec::for_pair(&pair, &window, RotationDomain::ball(10.0, 5.0));
/// spec.storage.leave_out = 1e-3;
/// spec.validate()?;
/// // Two bytes a node, in whole bricks.
/// let rotations = spec.grid()?.nodes().len();
/// assert!(spec.bytes(rotations) >= (2 * 125 * rotations) as u128);
/// spec.storage.leave_out = 0.5;
/// assert!(spec.validate().is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableSpec {
    /// What the energies are made from; its lattices have the window's spacing.
    pub provenance: PairProvenance,
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
            provenance: pair.provenance(),
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
        DVec3::from_array(self.provenance.pivot)
    }

    /// Weights of the score and the scale of the energy.
    pub fn model(&self) -> &ScoreModel {
        &self.provenance.model
    }

    /// Checks every number.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn validate(&self) -> Result<(), TableError> {
        self.provenance.model.validate()?;
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

    /// How far outside the window the energy has faded to [`TableSpec::far_energy`], metres: the
    /// moving part's radius about the pivot, its halo included (the window's diagonal where energies
    /// come from no density), and never less than two nodes.
    ///
    /// Where a window ends, the energy is seldom the far one. What is read there goes on outside,
    /// without its slope outwards, and fades over `L`, which adds a force of up to
    /// `1.5 |energy - far| / L`. The parts themselves lose that energy over a way that is about as
    /// long as the moving part, so this is less than contact has. Outside the rotations the energy
    /// fades over what is left of the half turn.
    pub fn fade_length(&self) -> f64 {
        let window = &self.window;
        let sides = DVec3::from_array(window.shape().map(|n| n as f64 - 1.0)) * window.spacing();
        let length = match &self.provenance.moving {
            Some(part) => radius(part, self.pivot()),
            None => sides.length(),
        };
        length.max(2.0 * window.spacing())
    }
}

/// How a table stores energies: in half precision, with a relative error of at most 4.9e-4.
///
/// See the example of [`TableSpec`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "StorageKeys", try_from = "StorageKeys")]
pub struct Storage {
    /// Bricks of [`Storage::BRICK`]³ displacement nodes of a rotation node are left out where no
    /// energy differs from the far energy by more than this share of the largest probed energy.
    /// 0 leaves out nothing. 0 ..= 0.1.
    pub leave_out: f64,
}

/// The keys of a table's metadata.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StorageKeys {
    numbers: String,
    leave_out: f64,
}

impl From<Storage> for StorageKeys {
    fn from(storage: Storage) -> Self {
        Self {
            numbers: Storage::NUMBERS.into(),
            leave_out: storage.leave_out,
        }
    }
}

impl TryFrom<StorageKeys> for Storage {
    type Error = String;

    fn try_from(keys: StorageKeys) -> Result<Self, String> {
        match &*keys.numbers {
            Self::NUMBERS => Ok(Self {
                leave_out: keys.leave_out,
            }),
            found => Err(format!(
                "storage.numbers must be {}, found {}: bake the table again with \
                 `pegfit bake SCENE -o TABLE`",
                Self::NUMBERS,
                quoted(found)
            )),
        }
    }
}

impl Storage {
    /// Displacement nodes along each side of a brick.
    pub const BRICK: usize = 8;

    /// Zarr's name of the numbers that hold energies.
    const NUMBERS: &str = "float16";

    pub(crate) fn validate(&self) -> Result<(), TableError> {
        if (0.0..=0.1).contains(&self.leave_out) {
            return Ok(());
        }
        Err(TableError::Spec {
            name: "leave_out",
            expected: "in 0 ..= 0.1",
            found: self.leave_out.to_string(),
        })
    }
}

/// Greatest distance of a density's lattice from a point, metres.
fn radius(part: &FieldProvenance, point: DVec3) -> f64 {
    let lattice = &part.lattice;
    let sides = DVec3::from_array(lattice.shape().map(|n| n as f64 - 1.0)) * lattice.spacing();
    let (low, high) = (lattice.origin() - point, lattice.origin() + sides - point);
    low.abs().max(high.abs()).length()
}

/// Why a table cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TableError {
    /// A model parameter is out of range.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The rotations cannot be gridded.
    #[error(transparent)]
    Rotations(#[from] RotationError),
    /// A number of the specification is not finite or not a lattice's.
    #[error("table: {name} must be {expected}, found {found}")]
    Spec {
        /// Which.
        name: &'static str,
        /// What is accepted.
        expected: &'static str,
        /// What was given.
        found: String,
    },
    /// The energies do not fit.
    #[error(
        "table of {rotations} rotations x {displacements} displacements needs {needed} bytes, \
         {limit} are allowed"
    )]
    Memory {
        /// Rotation nodes.
        rotations: u64,
        /// Translation nodes of each rotation.
        displacements: u64,
        /// Bytes of energies.
        needed: u128,
        /// The limit, bytes.
        limit: u64,
    },
    /// A computed energy is not a finite number.
    #[error("energy of rotation node {row}, translation node {index:?} is {found}")]
    NotFinite {
        /// Rotation node.
        row: usize,
        /// Translation node.
        index: [usize; 3],
        /// The energy, joules.
        found: f32,
    },
    /// A coefficient is so much larger than those probed that half precision cannot hold it.
    #[error("coefficient of rotation node {row} is {found} J, beyond the representable {limit} J")]
    Overflow {
        /// Rotation node.
        row: usize,
        /// It, joules.
        found: f32,
        /// The largest that the table's unit can hold, joules.
        limit: f64,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}
