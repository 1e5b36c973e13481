//! Energies over a grid of rotations and a lattice of translations, kept in half precision.

use glam::{DQuat, DVec3};
use half::f16;
use ndarray::{ArrayView3, ArrayViewMut3};
use rayon::prelude::*;
use sdf_grid::{Lattice, Monitor};
use serde::{Deserialize, Serialize};

use crate::rotation_domain::{AxisSymmetry, RotationDomain, RotationError};
use crate::rotation_grid::RotationGrid;
use crate::taps::Interpolation;
use crate::{ModelError, ScoreModel};

/// What a table holds and for which pair: everything that decides its values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableSpec {
    /// Weights of the score and the scale of the energy.
    pub model: ScoreModel,
    /// The moving part's pivot, metres in its frame (see [`crate::Pair::pose`]).
    pub pivot: [f64; 3],
    /// Pivot displacements of the translation nodes, metres in the fixed frame.
    pub window: Lattice,
    /// Rotations of the moving part.
    pub rotations: RotationDomain,
    /// A symmetry by which rotation nodes are left out.
    #[serde(default)]
    pub symmetry: Option<AxisSymmetry>,
    /// Energy far outside the table, joules. The model's own is 0, as densities fade.
    #[serde(default)]
    pub far_energy: f64,
    /// Identity of the fixed part's mesh, as its hash in hexadecimal; empty if there is no mesh.
    #[serde(default)]
    pub fixed_mesh: String,
    /// Identity of the moving part's mesh.
    #[serde(default)]
    pub moving_mesh: String,
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
    /// An energy is so much larger than those probed that half precision cannot hold it.
    #[error("energy of rotation node {row} is {found} J, beyond the representable {limit} J")]
    Overflow {
        /// Rotation node.
        row: usize,
        /// The energy, joules.
        found: f32,
        /// The largest energy that the table's unit can hold, joules.
        limit: f64,
    },
    /// The caller asked to stop.
    #[error("cancelled")]
    Cancelled,
}

/// Computes the energies of one rotation at all translations of a window.
///
/// A correlator is one; so is, in tests, a closed form. The same rotation must always give the same
/// bits, whatever the thread or process.
pub trait NodeEnergies: Sync {
    /// Working memory of one thread.
    type Scratch: Send;

    /// Makes working memory.
    fn scratch(&self) -> Self::Scratch;

    /// Writes to `out`, shaped as the window, the energies in joules of the poses with this
    /// rotation.
    fn energies(&self, rotation: DQuat, scratch: &mut Self::Scratch, out: ArrayViewMut3<'_, f32>);
}

/// An energy source that interpolates stored energies; forces and torques are the exact gradient of
/// the interpolated energy, so its field is conservative.
#[derive(Debug, Clone)]
pub struct EnergyTable {
    spec: TableSpec,
    grid: RotationGrid,
    /// Joules per stored unit; a power of two.
    unit: f64,
    /// Half-precision bits, C order `[rotation, x, y, z]`, and three zeros so that any value may be
    /// read with the three after it.
    energies: Vec<u16>,
    interpolation: Interpolation,
}

/// Zeros behind the last energy.
const PADDING: usize = 3;

impl TableSpec {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn validate(&self) -> Result<(), TableError> {
        self.model.validate()?;
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
        let pivot = DVec3::from_array(self.pivot);
        finite("pivot", pivot.is_finite(), pivot.to_string())?;
        let far = self.far_energy;
        finite("far_energy", far.is_finite(), far.to_string())
    }

    /// The rotation nodes.
    ///
    /// # Errors
    /// As [`RotationGrid::new`].
    pub fn grid(&self) -> Result<RotationGrid, RotationError> {
        RotationGrid::new(&self.rotations, self.symmetry.as_ref())
    }

    /// Bytes of energies for `rotations` rotation nodes.
    pub fn bytes(&self, rotations: usize) -> u128 {
        2 * rotations as u128 * self.window.len() as u128
    }

    pub(crate) fn check_memory(&self, rotations: usize, limit: u64) -> Result<(), TableError> {
        let needed = self.bytes(rotations);
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

impl EnergyTable {
    /// Computes a table in memory. `memory_limit` bounds the bytes of energies.
    ///
    /// # Errors
    /// If the specification is out of range or too large, an energy is not finite, or `monitor`
    /// cancels.
    pub fn compute<P: NodeEnergies>(
        spec: TableSpec,
        producer: &P,
        memory_limit: u64,
        monitor: &dyn Monitor,
    ) -> Result<Self, TableError> {
        spec.validate()?;
        let grid = spec.grid()?;
        spec.check_memory(grid.nodes().len(), memory_limit)?;
        let unit = probe_unit(&spec, &grid, producer)?;
        let length = spec.window.len();
        monitor.begin("table", grid.nodes().len() as u64);
        let mut table = Self::zeroed(spec.clone(), grid.clone(), unit);
        table.rows_mut().enumerate().try_for_each_init(
            || (producer.scratch(), vec![0f32; length]),
            |(scratch, joules), (row, out)| {
                if monitor.cancelled() {
                    return Err(TableError::Cancelled);
                }
                node(&spec, &grid, producer, row, scratch, joules);
                encode(&spec.window, row, joules, unit, out)?;
                monitor.advance(1);
                Ok(())
            },
        )?;
        Ok(table)
    }

    /// A table of zeros, of a size already found acceptable.
    pub(crate) fn zeroed(spec: TableSpec, grid: RotationGrid, unit: f64) -> Self {
        let energies = vec![0; grid.nodes().len() * spec.window.len() + PADDING];
        Self {
            spec,
            grid,
            unit,
            energies,
            interpolation: Interpolation::default(),
        }
    }

    /// The stored bits of each rotation node.
    pub(crate) fn rows_mut(&mut self) -> impl IndexedParallelIterator<Item = &mut [u16]> {
        let length = self.spec.window.len();
        self.energies[..self.grid.nodes().len() * length].par_chunks_exact_mut(length)
    }

    /// The same table read with another interpolation.
    #[must_use]
    pub fn with_interpolation(mut self, interpolation: Interpolation) -> Self {
        self.interpolation = interpolation;
        self
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.spec
    }

    /// The rotation nodes.
    pub fn grid(&self) -> &RotationGrid {
        &self.grid
    }

    /// How values between nodes are found.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Joules per stored unit; a power of two.
    pub fn unit(&self) -> f64 {
        self.unit
    }

    /// Stored energies of rotation node `row` in units of [`EnergyTable::unit`], over the window.
    ///
    /// # Panics
    /// If there is no such node.
    pub fn node(&self, row: usize) -> ArrayView3<'_, f16> {
        let length = self.spec.window.len();
        let bits = &self.energies[row * length..][..length];
        ArrayView3::from_shape(self.spec.window.shape(), bytemuck::cast_slice(bits))
            .expect("a node has the window's shape")
    }

    /// Energy of a node, joules; `None` if there is no such node.
    pub fn node_energy(&self, row: usize, index: [usize; 3]) -> Option<f64> {
        (row < self.grid.nodes().len())
            .then(|| self.node(row).get(index).map(|e| e.to_f64() * self.unit))
            .flatten()
    }

    pub(crate) fn bits(&self) -> &[u16] {
        &self.energies
    }
}

/// Computes the energies of one rotation node, joules.
pub(crate) fn node<P: NodeEnergies>(
    spec: &TableSpec,
    grid: &RotationGrid,
    producer: &P,
    row: usize,
    scratch: &mut P::Scratch,
    out: &mut [f32],
) {
    let out = ArrayViewMut3::from_shape(spec.window.shape(), out)
        .expect("the buffer has the window's length");
    producer.energies(grid.nodes()[row], scratch, out);
}

/// Largest magnitude of probed energies after scaling: 2^9, which leaves a factor of 2^7 up to the
/// largest half-precision number and one of 2^23 down to the smallest normal one.
const PROBE_EXPONENT: i32 = 9;

/// The table's unit of energy: a power of two that brings the largest energy of a few rotation
/// nodes, fixed by the grid alone, to at most `2^PROBE_EXPONENT`. Every rank finds the same.
pub(crate) fn probe_unit<P: NodeEnergies>(
    spec: &TableSpec,
    grid: &RotationGrid,
    producer: &P,
) -> Result<f64, TableError> {
    let n = grid.nodes().len();
    let mut rows = vec![n / 2, 0, n / 4, 3 * n / 4, n - 1];
    rows.sort_unstable();
    rows.dedup();
    let (mut scratch, mut joules) = (producer.scratch(), vec![0f32; spec.window.len()]);
    let mut largest = 0f32;
    for row in rows {
        node(spec, grid, producer, row, &mut scratch, &mut joules);
        for (flat, &e) in joules.iter().enumerate() {
            check_finite(&spec.window, row, flat, e)?;
            largest = largest.max(e.abs());
        }
    }
    if largest == 0.0 {
        return Ok(1.0);
    }
    let exponent = f64::from(largest).log2().ceil() as i32;
    Ok(2f64.powi(exponent - PROBE_EXPONENT))
}

fn check_finite(window: &Lattice, row: usize, flat: usize, found: f32) -> Result<(), TableError> {
    if found.is_finite() {
        Ok(())
    } else {
        Err(TableError::NotFinite {
            row,
            index: window.unravel(flat),
            found,
        })
    }
}

/// Energies in joules to half-precision bits in units of `unit`. Numbers too small to be normal
/// (2^-23 of the largest probed energy) become zero, so that decoding never meets a subnormal.
pub(crate) fn encode(
    window: &Lattice,
    row: usize,
    joules: &[f32],
    unit: f64,
    out: &mut [u16],
) -> Result<(), TableError> {
    for (flat, (&e, bits)) in joules.iter().zip(out).enumerate() {
        check_finite(window, row, flat, e)?;
        let half = f16::from_f64(f64::from(e) / unit);
        if half.is_infinite() {
            return Err(TableError::Overflow {
                row,
                found: e,
                limit: f16::MAX.to_f64() * unit,
            });
        }
        *bits = if half.is_normal() { half.to_bits() } else { 0 };
    }
    Ok(())
}
