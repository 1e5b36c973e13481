//! Energies over a grid of rotations and a lattice of translations, as coefficients of cubic
//! B-splines, kept in half precision; their interpolation and its exact gradient.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::Monitor;

use crate::energy::{EnergySource, InScene, Response, Scratch};
use crate::geometry::half_turn::HalfTurnGroup;
use crate::geometry::se3::{Pose, Wrench};
use crate::geometry::taps::{Edge, Reach, Taps};
use crate::pair::contact::Contact;
use crate::rotations::atlas::MARGIN;
use crate::rotations::chart::Chart;
use crate::rotations::grid::{RotationGrid, Site};
use crate::sweep::{Consumer, Group, Member, NodeEnergies, sweep};
use crate::table::encode::{EncodedNode, Probe, encode, far_code, probe};
use crate::table::layout::{Layout, Row, Rows, zeroed_pages};
use crate::table::spec::{TableError, TableSpec};
use crate::table::stencil::{RotationTap, Stencil, value_of};

/// An energy source that interpolates stored energies; forces and torques are the exact gradient of
/// the interpolated energy, so its field is conservative. Poses are those of the shapes, each in
/// its own frame; [`EnergyTable::in_scene`] answers for a scene.
///
/// ```
/// use fft_correlate::*;
/// use glam::{DQuat, DVec3};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let builder = PairBuilder { spacing: Some(0.004), ..PairBuilder::default() };
/// let pair = builder.build(&hole, &peg, &ScoreModel::GUIDED, &Silent)?;
/// let window = TranslationWindow::cube(0.008, 0.004)?;
/// let spec = TableSpec::for_pair(&pair, &window, RotationDomain::single(DQuat::IDENTITY));
/// let table = EnergyTable::compute(spec, &PairEnergies::plan(&pair, &window)?, 1 << 20, &Silent)?;
/// // 3 mm out of the fit: drawn back in.
/// let response = table.respond(&Pose::from_translation(DVec3::Z * 0.003));
/// assert!(response.coverage == 1.0 && response.wrench.force.z < 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
                encoded: EncodedNode::default(),
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
        let far = Response {
            energy: self.plan.spec.far_energy,
            ..Response::default()
        };
        let (mut response, mut whole) = (far, true);
        // How far the answer is the table's, with its slopes as a wrench.
        let mut covered = Response::default();
        if pose.is_valid() {
            self.plan.grid.visit(pose, |site| {
                whole &= self.add(&site, &mut response, &mut covered).is_some();
            });
        }
        if !whole {
            return far;
        }
        self.add_contact(pose, &covered, &mut response);
        response
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
                self.prefetch(next);
            }
            *response = self.respond(pose);
        }
    }

    /// Whether every rotation node that a query at `pose` reads is in memory, and those one node
    /// around them.
    fn has_around(&self, pose: &Pose) -> bool {
        let has = |slot| self.rows.has(slot as usize);
        self.rows.all() || !pose.is_valid() || self.grid().all_around(pose, has)
    }

    /// The numbers of a slot; `None` if they are not in memory.
    #[inline]
    pub(crate) fn row(&self, slot: u32) -> Option<&[u16]> {
        self.rows.get(slot as usize, self.plan.layout.length())
    }

    /// Asks the processor to fetch what a query at `pose` will read.
    fn prefetch(&self, pose: &Pose) {
        if !pose.is_valid() {
            return;
        }
        self.plan.grid.visit(pose, |site| {
            let Some((_, displacement)) = self.place(&site) else {
                return;
            };
            let mut taps = [RotationTap::default(); 64];
            let Some((count, _)) = self.rotation_taps(site.chart, &site.taps, &mut taps) else {
                return;
            };
            let [_, ty, _] = &displacement.taps;
            let groups = 1 + usize::from(ty.nodes[3] / 4 > ty.nodes[0] / 4);
            self.stencil(&displacement.taps, groups)
                .prefetch(&taps[..count]);
        });
    }

    /// Where a patch reads along the translation axes: the moving part's arm from its origin to the
    /// pivot, and the place in the window, if it is in or near it.
    fn place(&self, site: &Site<'_>) -> Option<(DVec3, Displacement)> {
        let pivot = self.plan.spec.pivot();
        let arm = site.pose.rotation * pivot;
        let window = &self.plan.spec.window;
        let x = window.fractional_index(arm + site.pose.translation - pivot);
        Some((arm, self.displacement(x)?))
    }

    /// Adds one patch's share: `share * weight * (energy - far)`, differentiated as a product.
    /// `None` if what it reads is not in memory.
    fn add(&self, site: &Site<'_>, response: &mut Response, covered: &mut Response) -> Option<()> {
        let window = &self.plan.spec.window;
        let Some((arm, displacement)) = self.place(site) else {
            return Some(());
        };
        if site.weight <= 0.0 {
            return Some(());
        }
        let reading = self.read(site.chart, &site.taps, &displacement.taps)?;
        let place = Place {
            site,
            arm,
            displacement: &displacement,
            spacing: window.spacing(),
        };
        place.add(&Contribution::new(&reading, site), response);
        // Outside, contact is that of the pose that is read.
        match (&self.plan.spec.contact, place.is_inside()) {
            (Some(contact), false) => place.add(&self.contact_at(contact, &place), response),
            _ => place.add(&Contribution::ONE, covered),
        }
        let window_coverage: f64 = displacement.reach.iter().map(|r| r.coverage).product();
        let coverage = site.coverage * window_coverage;
        response.coverage += site.share * coverage * self.kept_share(&displacement);
        Some(())
    }

    /// What smoothing took from the energy where a place is read.
    fn contact_at(&self, contact: &Contact, place: &Place<'_>) -> Contribution {
        let (window, pivot) = (&self.plan.spec.window, self.plan.spec.pivot());
        let rotation = place.site.rotation();
        let at = DVec3::from_array(place.displacement.reach.each_ref().map(|r| r.at));
        let (displacement, arm) = (window.origin() + at * window.spacing(), rotation * pivot);
        let lost = contact.score(&Pose {
            rotation,
            translation: displacement + pivot - arm,
        });
        let gamma = self.plan.spec.model().gamma;
        Contribution {
            energy: -gamma * lost.score,
            translation: -gamma * window.spacing() * lost.gradient,
            turn: -gamma * (lost.moment - arm.cross(lost.gradient)),
        }
    }

    /// Adds what smoothing took from the energies, as far as the pose is covered.
    fn add_contact(&self, pose: &Pose, covered: &Response, response: &mut Response) {
        let Some(contact) = &self.plan.spec.contact else {
            return;
        };
        if covered.energy <= 0.0 {
            return;
        }
        let lost = contact.score(pose);
        let gamma = self.plan.spec.model().gamma;
        let (energy, share) = (-gamma * lost.score, gamma * covered.energy);
        response.energy += covered.energy * energy;
        response.wrench.force += share * lost.gradient + energy * covered.wrench.force;
        response.wrench.torque += share * lost.moment + energy * covered.wrench.torque;
    }

    fn displacement(&self, x: DVec3) -> Option<Displacement> {
        let (x, window) = (x.to_array(), &self.plan.spec.window);
        let shape = window.shape();
        let edge = Edge {
            margin: MARGIN,
            fade: [self.plan.fade_length / window.spacing(); 2],
        };
        let reach = |k: usize| Reach::new(x[k], shape[k], &edge);
        let reach = [reach(0)?, reach(1)?, reach(2)?];
        let taps = std::array::from_fn(|k| Taps::open(reach[k].at, shape[k]));
        Some(Displacement { taps, reach })
    }

    /// The interpolated energy and its slopes. Absent rotation nodes hold the far energy. `None` if
    /// a rotation node is not in memory.
    fn read(
        &self,
        chart: &Chart,
        rotation: &[Taps; 3],
        translation: &[Taps; 3],
    ) -> Option<PatchValue> {
        let mut taps = [RotationTap::default(); 64];
        let (count, absent) = self.rotation_taps(chart, rotation, &mut taps)?;
        let [_, ty, tz] = translation;
        let along_y = LaneWeights::new(ty, ty.nodes[0] / 4 * 4);
        let along_z = LaneWeights::new(tz, tz.nodes[0]);
        let stencil = self.stencil(translation, if along_y.long { 2 } else { 1 });
        let sums = stencil.sum(&taps[..count]);
        let total = |sum: usize, y: &[f64; 8], z: &[f64; 8]| -> f64 {
            let mut total = 0.0;
            for (group, sums) in sums.iter().enumerate().take(stencil.groups) {
                for (lane, &value) in sums[sum].iter().enumerate() {
                    total += f64::from(value) * z[lane / 4] * y[4 * group + lane % 4];
                }
            }
            total * self.plan.probe.unit
        };
        let (y, z) = (&along_y.weights, &along_z.weights);
        let far = self.plan.spec.far_energy;
        Some(PatchValue {
            energy: total(0, y, z) + far * absent[0] - far,
            translation: DVec3::new(
                total(1, y, z),
                total(0, &along_y.slopes, z),
                total(0, y, &along_z.slopes),
            ),
            rotation: std::array::from_fn(|k| total(2 + k, y, z) + far * absent[1 + k]),
        })
    }

    /// The rotation nodes to read, into `taps`; how many, and the weights of the absent ones.
    /// `None` if one is not in memory.
    fn rotation_taps<'t>(
        &'t self,
        chart: &Chart,
        [tx, ty, tz]: &[Taps; 3],
        taps: &mut [RotationTap<'t>; 64],
    ) -> Option<(usize, [f64; 4])> {
        let [_, ny, nz] = chart.shape;
        let (mut count, mut absent) = (0, [0f64; 4]);
        for i in 0..4 {
            for j in 0..4 {
                let both = [
                    tx.weights[i] * ty.weights[j],
                    tx.slopes[i] * ty.weights[j],
                    tx.weights[i] * ty.slopes[j],
                ];
                if both == [0.0; 3] {
                    continue;
                }
                let nodes = &chart.rows[(tx.nodes[i] * ny + ty.nodes[j]) * nz..][..nz];
                for k in 0..4 {
                    let (w, s) = (tz.weights[k], tz.slopes[k]);
                    if w == 0.0 && s == 0.0 {
                        continue;
                    }
                    let weights = [both[0] * w, both[1] * w, both[2] * w, both[0] * s];
                    let slot = nodes[tz.nodes[k]];
                    if slot == Chart::ABSENT {
                        for (sum, w) in absent.iter_mut().zip(weights) {
                            *sum += w;
                        }
                        continue;
                    }
                    let codes = self.rows.get(slot as usize, self.plan.layout.length())?;
                    taps[count] = RotationTap {
                        codes,
                        weights: weights.map(|w| w as f32),
                    };
                    count += 1;
                }
            }
        }
        Some((count, absent))
    }

    fn stencil(&self, [tx, ty, tz]: &[Taps; 3], groups: usize) -> Stencil {
        let first = ty.nodes[0] / 4;
        let run = |group: usize, s: usize| {
            let group = if group < groups { first + group } else { first };
            self.plan.layout.run(tx.nodes[s], group, tz.nodes[0])
        };
        Stencil {
            runs: std::array::from_fn(|group| std::array::from_fn(|s| run(group, s))),
            groups,
            weights: tx.weights.map(|w| w as f32),
            slopes: tx.slopes.map(|w| w as f32),
        }
    }

    /// Share of the nodes around a displacement that were not left out, changing linearly between
    /// nodes; 1 where everything is kept.
    fn kept_share(&self, displacement: &Displacement) -> f64 {
        if self.plan.layout.is_dense() {
            return 1.0;
        }
        let shape = self.plan.spec.window.shape();
        let cell: [usize; 3] = std::array::from_fn(|k| {
            let last = shape[k].saturating_sub(2) as f64;
            displacement.reach[k].at.floor().clamp(0.0, last) as usize
        });
        let part: [f64; 3] =
            std::array::from_fn(|k| (displacement.reach[k].at - cell[k] as f64).clamp(0.0, 1.0));
        (0..8)
            .map(|corner| {
                let upper: [bool; 3] = std::array::from_fn(|k| corner >> k & 1 == 1);
                let node =
                    std::array::from_fn(|k| (cell[k] + usize::from(upper[k])).min(shape[k] - 1));
                let weight = |k: usize| if upper[k] { part[k] } else { 1.0 - part[k] };
                let held = f64::from(u8::from(self.plan.layout.holds(node)));
                held * weight(0) * weight(1) * weight(2)
            })
            .sum::<f64>()
            .min(1.0)
    }
}

/// Fills the slots of a table.
struct Filler<'a> {
    plan: &'a Plan,
    /// The producer's, joules.
    unit: f32,
    encoded: EncodedNode,
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

/// An interpolated value and its slopes per node, above the far energy, joules.
#[derive(Debug, Clone, Copy)]
struct PatchValue {
    energy: f64,
    translation: DVec3,
    rotation: [f64; 3],
}

/// What is read at a place, above the far energy.
struct Contribution {
    /// Joules.
    energy: f64,
    /// Slopes per node.
    translation: DVec3,
    /// Slopes by a turn of what is read, joules per radian.
    turn: DVec3,
}

impl Contribution {
    /// One everywhere.
    const ONE: Self = Self {
        energy: 1.0,
        translation: DVec3::ZERO,
        turn: DVec3::ZERO,
    };

    fn new(reading: &PatchValue, site: &Site<'_>) -> Self {
        Self {
            energy: reading.energy,
            translation: reading.translation,
            turn: (0..3)
                .map(|k| reading.rotation[k] * site.gradients[k])
                .sum::<DVec3>(),
        }
    }
}

/// Where a patch is read.
struct Place<'a> {
    site: &'a Site<'a>,
    /// The moving part's arm from its origin to the pivot, fixed frame, metres.
    arm: DVec3,
    displacement: &'a Displacement,
    spacing: f64,
}

impl Place<'_> {
    /// Adds the patch's share of what is read, as far as it counts here, to an energy and its
    /// wrench, differentiated as a product.
    fn add(&self, read: &Contribution, to: &mut Response) {
        let (site, reach) = (self.site, &self.displacement.reach);
        let [cx, cy, cz] = reach.each_ref().map(|r| r.weight);
        let [sx, sy, sz] = reach.each_ref().map(|r| r.weight_slope);
        let window_weight = cx * cy * cz;
        let window_gradient = DVec3::new(sx * cy * cz, cx * sy * cz, cx * cy * sz);
        let weight = site.weight * window_weight;
        let slope = DVec3::from_array(reach.each_ref().map(|r| r.slope));
        let by_displacement = (weight * read.translation * slope
            + site.weight * read.energy * window_gradient)
            / self.spacing;
        let by_turn =
            weight * site.turn_back(read.turn) + window_weight * read.energy * site.weight_gradient;
        let force = -by_displacement;
        let wrench = site.pull_back(&Wrench {
            torque: self.arm.cross(force) - by_turn,
            force,
        });
        let value = weight * read.energy;
        to.energy += site.share * value;
        to.wrench += wrench * site.share;
        to.wrench.torque -= value * site.share_gradient;
    }

    /// Whether what is read is read at the query's own pose.
    fn is_inside(&self) -> bool {
        self.site.rest.is_none() && self.displacement.reach.iter().all(Reach::is_inside)
    }
}

/// Where and how the translation axes are read for one displacement.
struct Displacement {
    taps: [Taps; 3],
    reach: [Reach; 3],
}

/// Weights of up to 8 successive nodes of an axis, of which a query reads 4.
struct LaneWeights {
    weights: [f64; 8],
    slopes: [f64; 8],
    /// More than the first four nodes are read.
    long: bool,
}

impl LaneWeights {
    /// For nodes from `first` on; absent nodes of the taps repeat one with weight 0.
    fn new(taps: &Taps, first: usize) -> Self {
        let mut lanes = Self {
            weights: [0.0; 8],
            slopes: [0.0; 8],
            long: taps.nodes[3] >= first + 4,
        };
        for s in 0..4 {
            let lane = taps.nodes[s] - first;
            lanes.weights[lane] += taps.weights[s];
            lanes.slopes[lane] += taps.slopes[s];
        }
        lanes
    }
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
    /// [`TableSpec::fade_length`].
    pub(crate) fade_length: f64,
    /// Slot of each rotation node, or [`Chart::ABSENT`] where it holds nothing but the far energy.
    pub(crate) slots: Vec<u32>,
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
        grid.fade_far();
        Self {
            fade_length: spec.fade_length(),
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

#[cfg(test)]
#[path = "query_tests.rs"]
mod tests;
