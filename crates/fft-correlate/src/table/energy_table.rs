//! Energies over a grid of rotations and a lattice of translations, as coefficients of cubic
//! B-splines, kept in half precision.

use std::sync::Arc;

use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::energy::{EnergySource, Response, Scratch};
use crate::geometry::half_turn::HalfTurnGroup;
use crate::geometry::se3::Pose;
use crate::rotations::chart::Chart;
use crate::rotations::grid::RotationGrid;
use crate::setup::in_scene::InScene;
use crate::sweep::producer::NodeEnergies;
use crate::sweep::run::{Consumer, Group, Member, sweep};
use crate::table::encode::{Encoded, encode, far_code, probe};
use crate::table::error::TableError;
use crate::table::layout::Layout;
use crate::table::plan::Plan;
use crate::table::query::Reader;
use crate::table::rows::{Row, Rows, zeroed_pages};
use crate::table::spec::TableSpec;
use crate::table::stencil::value_of;

/// An energy source that interpolates stored energies; forces and torques are the exact gradient of
/// the interpolated energy, so its field is conservative. Poses are those of the shapes, each in
/// its own frame; [`EnergyTable::in_scene`] answers for a scene.
#[derive(Debug, Clone)]
pub struct EnergyTable {
    plan: Arc<Plan>,
    rows: Rows,
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
        let groups = grid.half_turn_groups();
        let layout = Layout::dense(spec.window.shape());
        let slots: Vec<u32> = (0..grid.nodes().len() as u32).collect();
        monitor.begin("table", slots.len() as u64);
        let plan = Plan::new(spec, grid, probe, layout, slots);
        Self::filled(plan, |plan, slots| {
            let mut slots: Vec<_> = slots.into_iter().map(Some).collect();
            let mut slot_of = |row: usize| slots[row].take();
            let sum = |g: &HalfTurnGroup| plan.grid.node_sum(g.members[0].1);
            let groups = groups
                .iter()
                .filter_map(|g| Group::of_sums(g, sum(g), &mut slot_of));
            let unit = producer.unit();
            let filler = || Filler {
                plan,
                unit,
                encoded: Encoded::default(),
            };
            let shape = plan.spec.window.shape();
            match sweep(producer, shape, groups.collect(), filler, monitor)?.complete {
                true => Ok(()),
                false => Err(TableError::Cancelled),
            }
        })
    }

    /// A table of a size already found acceptable, all of whose slots `fill` fills, in parallel.
    pub(crate) fn filled<E>(
        plan: Plan,
        fill: impl FnOnce(&Plan, Vec<&mut [u16]>) -> Result<(), E>,
    ) -> Result<Self, E> {
        let (kept, length) = (plan.kept(), plan.layout.length());
        let mut codes = zeroed_pages(kept * length);
        fill(&plan, codes.chunks_exact_mut(length).collect())?;
        Ok(Self {
            plan: Arc::new(plan),
            rows: Rows::Whole(codes),
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
        }
    }

    /// The table as asked by the scene that it was baked for.
    #[must_use]
    pub fn in_scene(self) -> InScene<Self> {
        let placement = self.spec().placement;
        InScene::new(self, placement)
    }

    /// What the table holds.
    pub fn spec(&self) -> &TableSpec {
        &self.plan.spec
    }

    /// The rotation nodes.
    pub fn grid(&self) -> &RotationGrid {
        &self.plan.grid
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

    /// Coefficient of a node, joules; `None` if there is no such node or it is not in memory.
    pub fn coefficient(&self, row: usize, index: [usize; 3]) -> Option<f64> {
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
        let code = self.row(slot)?[self.plan.layout.place(index)];
        Some(value_of(code) * self.unit())
    }

    /// Energy, wrench and coverage at a pose. Far outside the table, where a rotation node that
    /// would be read is not in memory, and for an invalid pose, the energy is the specification's
    /// far energy, the wrench and coverage zero.
    pub fn respond(&self, pose: &Pose) -> Response {
        self.reader().respond(pose)
    }

    /// [`EnergyTable::respond`] for many poses, on all threads of the current rayon pool.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn respond_many(&self, poses: &[Pose], responses: &mut [Response]) {
        assert_eq!(poses.len(), responses.len(), "one response per pose");
        poses
            .par_chunks(256)
            .zip(responses.par_chunks_mut(256))
            .for_each(|(poses, responses)| self.respond_each(poses, responses));
    }

    /// [`EnergyTable::respond`] for many poses, on this thread. Random poses of a large table take
    /// less time than one by one: each pose's energies are fetched while the one before is
    /// computed.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn respond_each(&self, poses: &[Pose], responses: &mut [Response]) {
        assert_eq!(poses.len(), responses.len(), "one response per pose");
        for (n, (pose, response)) in poses.iter().zip(responses).enumerate() {
            if let Some(next) = poses.get(n + 1) {
                self.reader().prefetch(next);
            }
            *response = self.respond(pose);
        }
    }

    pub(super) fn reader(&self) -> Reader<'_> {
        Reader {
            plan: &self.plan,
            rows: &self.rows,
        }
    }

    /// Whether every rotation node that a query at `pose` reads is in memory, and those one node
    /// around them.
    fn has_around(&self, pose: &Pose) -> bool {
        let has = |slot| self.rows.has(slot as usize);
        self.rows.all() || !pose.is_valid() || self.grid().all_around(pose, has)
    }

    #[cfg(test)]
    pub(crate) fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// The numbers of a slot; `None` if they are not in memory.
    #[inline]
    pub(crate) fn row(&self, slot: u32) -> Option<&[u16]> {
        self.rows.get(slot as usize, self.plan.layout.length())
    }
}

/// Fills the slots of a table.
struct Filler<'a> {
    plan: &'a Plan,
    /// The producer's, joules.
    unit: f32,
    encoded: Encoded,
}

impl<'a> Consumer<&'a mut [u16]> for Filler<'_> {
    type Error = TableError;

    fn take(
        &mut self,
        node: Member<&'a mut [u16]>,
        energies: &mut [f32],
    ) -> Result<(), TableError> {
        let Plan {
            spec,
            probe,
            layout,
            ..
        } = self.plan;
        let encoded = &mut self.encoded;
        encode(spec, probe, node.row, self.unit, energies, encoded)?;
        let far = far_code(spec, probe.unit);
        layout.pack(&encoded.codes, far, node.target);
        Ok(())
    }
}

impl EnergySource for EnergyTable {
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    fn evaluate(&self, pose: &Pose, _scratch: &mut Scratch) -> Response {
        self.respond(pose)
    }

    fn is_loaded(&self, pose: &Pose, _scratch: &Scratch) -> bool {
        self.has_around(pose)
    }
}
