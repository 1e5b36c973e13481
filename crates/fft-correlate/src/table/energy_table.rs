//! Energies over a grid of rotations and a lattice of translations, kept in half precision.

use std::sync::Arc;

use glam::{DQuat, DVec3};
use ndarray::ArrayViewMut3;
use rayon::prelude::*;
use sdf_grid::{Lattice, Monitor, Sampling};
use serde::{Deserialize, Serialize};

use crate::chart::Chart;
use crate::encode::{Encoded, Probe, Storage, encode, far_code, probe};
use crate::layout::Layout;
use crate::rotation_domain::{AxisSymmetry, RotationDomain, RotationError};
use crate::rotation_grid::RotationGrid;
use crate::stencil::value_of;
use crate::table_rows::{Row, Rows, zeroed_pages};
use crate::taps::Interpolation;
use crate::{HalfTurn, HalfTurnGroup, ModelError, ScoreModel, half_turn_groups};

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
    /// How energies are stored.
    #[serde(default)]
    pub storage: Storage,
    /// How the densities were sampled; absent where there are none.
    #[serde(default)]
    pub fields: Option<FieldSampling>,
    /// Identity of the fixed part's mesh, as its hash in hexadecimal; empty if there is no mesh.
    #[serde(default)]
    pub fixed_mesh: String,
    /// Identity of the moving part's mesh.
    #[serde(default)]
    pub moving_mesh: String,
}

/// How the densities of a table's pair were sampled, on lattices of the window's spacing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldSampling {
    /// What a lattice value stands for.
    pub sampling: Sampling,
    /// What averages lose at coincident boundaries was restored ([`crate::deaverage`]).
    pub deaverage: bool,
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

    /// The same for the rotations that `rotation` and each of `turns` after it make, one output
    /// each. What a turn gives may differ by rounding from [`NodeEnergies::energies`], but not with
    /// the other turns asked for.
    fn energies_of_half_turns(
        &self,
        rotation: DQuat,
        turns: &[HalfTurn],
        scratch: &mut Self::Scratch,
        outs: &mut [ArrayViewMut3<'_, f32>],
    ) {
        for (turn, out) in turns.iter().zip(outs) {
            self.energies(turn.rotation() * rotation, scratch, out.view_mut());
        }
    }
}

/// An energy source that interpolates stored energies; forces and torques are the exact gradient of
/// the interpolated energy, so its field is conservative.
#[derive(Debug, Clone)]
pub struct EnergyTable {
    plan: Arc<Plan>,
    rows: Rows,
    interpolation: Interpolation,
}

/// Everything of a table but its energies; tables of which different parts are in memory share it.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) spec: TableSpec,
    /// Its charts number the slots of the rotation nodes that are kept.
    pub(crate) grid: RotationGrid,
    pub(crate) probe: Probe,
    /// Arranges the numbers of every slot.
    pub(crate) layout: Layout,
    /// Slot of each rotation node, or [`Chart::ABSENT`] where it holds nothing but the far energy.
    slots: Vec<u32>,
}

impl Plan {
    /// `slots` numbers the rotation nodes to keep.
    pub(crate) fn new(
        spec: TableSpec,
        mut grid: RotationGrid,
        probe: Probe,
        layout: Layout,
        slots: Vec<u32>,
    ) -> Self {
        grid.number(&slots);
        Self {
            spec,
            grid,
            probe,
            layout,
            slots,
        }
    }

    /// Rotation nodes that are kept.
    pub(crate) fn kept(&self) -> usize {
        self.slots.iter().filter(|&&s| s != Chart::ABSENT).count()
    }
}

impl TableSpec {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the first that is out of range.
    pub fn validate(&self) -> Result<(), TableError> {
        self.model.validate()?;
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
        let probe = probe(&spec, &grid, producer)?;
        monitor.begin("table", grid.nodes().len() as u64);
        let groups = half_turn_groups(grid.nodes());
        let layout = Layout::dense(spec.window.shape());
        let slots = (0..grid.nodes().len() as u32).collect();
        let plan = Plan::new(spec, grid, probe, layout, slots);
        let slots = groups.iter().map(|g| g.members.iter().map(|m| m.1));
        Self::filled(
            plan,
            slots.map(Iterator::collect).collect(),
            || (producer.scratch(), Vec::new(), Encoded::default()),
            |plan, group, slots, (scratch, joules, encoded)| {
                if monitor.cancelled() {
                    return Err(TableError::Cancelled);
                }
                let Plan { spec, layout, .. } = plan;
                let HalfTurnGroup { rotation, members } = &groups[group];
                nodes(spec, producer, *rotation, members, scratch, joules);
                let energies = joules.chunks_exact_mut(spec.window.len());
                for ((joules, (_, row)), slot) in energies.zip(members).zip(slots) {
                    encode(spec, &probe, *row, joules, encoded)?;
                    let far = far_code(spec, probe.unit, encoded.scale);
                    layout.pack(&encoded.codes, far, slot.codes);
                    *slot.scale = encoded.scale;
                    monitor.advance(1);
                }
                Ok(())
            },
        )
    }

    /// A table of a size already found acceptable, in whose every group of slots `fill` fills all, in
    /// parallel. Each slot is in one group.
    pub(crate) fn filled<S, E: Send>(
        plan: Plan,
        groups: Vec<Vec<usize>>,
        scratch: impl Fn() -> S + Sync + Send,
        fill: impl Fn(&Plan, usize, &mut [Slot<'_>], &mut S) -> Result<(), E> + Sync + Send,
    ) -> Result<Self, E> {
        let (kept, length) = (plan.kept(), plan.layout.length());
        let mut codes = zeroed_pages(kept * length);
        let mut scales = vec![1.0; kept];
        let slots = codes.chunks_exact_mut(length).zip(&mut scales);
        let mut slots: Vec<_> = slots
            .map(|(codes, scale)| Some(Slot { codes, scale }))
            .collect();
        let groups: Vec<Vec<Slot>> = groups
            .into_iter()
            .map(|group| group.into_iter().filter_map(|s| slots[s].take()).collect())
            .collect();
        groups
            .into_par_iter()
            .enumerate()
            .try_for_each_init(scratch, |scratch, (group, mut slots)| {
                fill(&plan, group, &mut slots, scratch)
            })?;
        Ok(Self {
            plan: Arc::new(plan),
            rows: Rows::Whole { codes, scales },
            interpolation: Interpolation::default(),
        })
    }

    /// A table of which only some slots may be in memory.
    pub(crate) fn of_parts(plan: Arc<Plan>, rows: Vec<Option<Arc<Row>>>) -> Self {
        Self {
            plan,
            rows: Rows::Parts {
                all: rows.iter().all(Option::is_some),
                rows,
            },
            interpolation: Interpolation::default(),
        }
    }

    /// The same table read with another interpolation.
    #[must_use]
    pub fn with_interpolation(mut self, interpolation: Interpolation) -> Self {
        self.interpolation = interpolation;
        self
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.plan.spec
    }

    /// The rotation nodes.
    pub fn grid(&self) -> &RotationGrid {
        &self.plan.grid
    }

    /// How values between nodes are found.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Joules per stored unit; a power of two.
    pub fn unit(&self) -> f64 {
        self.plan.probe.unit
    }

    /// Bytes of memory that the energies take, without what was left out or is not in memory.
    pub fn memory(&self) -> u64 {
        self.rows.bytes()
    }

    /// True unless the displacement node holds nothing but the far energy for every rotation and
    /// was left out.
    ///
    /// # Panics
    /// If the index is outside the window.
    pub fn holds(&self, index: [usize; 3]) -> bool {
        self.plan.layout.holds(index)
    }

    /// Energy of a node, joules; `None` if there is no such node or it is not in memory.
    pub fn node_energy(&self, row: usize, index: [usize; 3]) -> Option<f64> {
        let slot = *self.plan.slots.get(row)?;
        if index
            .iter()
            .zip(self.spec().window.shape())
            .any(|(&i, n)| i >= n)
        {
            return None;
        }
        if slot == Chart::ABSENT {
            return Some(self.spec().far_energy);
        }
        let (codes, scale) = self.row(slot)?;
        let code = codes[self.plan.layout.place(index)];
        let value = value_of(code, self.spec().storage.numbers.code());
        Some(value * f64::from(scale) * self.unit())
    }

    pub(crate) fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    pub(crate) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// The numbers of a slot and their scale; `None` if they are not in memory.
    #[inline]
    pub(crate) fn row(&self, slot: u32) -> Option<(&[u16], f32)> {
        self.rows.get(slot as usize, self.plan.layout.length())
    }
}

/// The numbers of one rotation node and what they are multiplied with, to be filled in.
pub(crate) struct Slot<'a> {
    pub(crate) codes: &'a mut [u16],
    pub(crate) scale: &'a mut f32,
}

/// Computes the energies, joules, of some rotation nodes of a group, one after the other to
/// `joules`.
pub(crate) fn nodes<P: NodeEnergies>(
    spec: &TableSpec,
    producer: &P,
    rotation: DQuat,
    members: &[(HalfTurn, usize)],
    scratch: &mut P::Scratch,
    joules: &mut Vec<f32>,
) {
    let length = spec.window.len();
    joules.resize(members.len() * length, 0f32);
    let turns: Vec<_> = members.iter().map(|m| m.0).collect();
    let mut views: Vec<_> = joules
        .chunks_exact_mut(length)
        .map(|out| view(spec, out))
        .collect();
    producer.energies_of_half_turns(rotation, &turns, scratch, &mut views);
}

/// Computes the energies of one rotation node by itself, joules.
pub(crate) fn node<P: NodeEnergies>(
    spec: &TableSpec,
    grid: &RotationGrid,
    producer: &P,
    row: usize,
    scratch: &mut P::Scratch,
    out: &mut [f32],
) {
    producer.energies(grid.nodes()[row], scratch, view(spec, out));
}

/// A buffer of the window's length in the window's shape.
fn view<'a>(spec: &TableSpec, out: &'a mut [f32]) -> ArrayViewMut3<'a, f32> {
    ArrayViewMut3::from_shape(spec.window.shape(), out).expect("the buffer has the window's length")
}
