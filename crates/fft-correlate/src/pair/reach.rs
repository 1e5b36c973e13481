//! The nodes that given poses of the moving part reach, or all poses of a window: of a large part beside
//! a small one, few.

use std::sync::Arc;

use glam::DVec3;
use sdf_grid::{Aabb, DensityField, FieldCache, Lattice, Monitor, TriangleMesh};

use super::builder::{PairBuildError, PairPlan};
use super::contact::Contact;
use super::fields::{Pair, Partial};
use super::region::PoseWindow;
use crate::geometry::se3::Pose;
use crate::geometry::side::Side;

/// Nodes along the sides of the blocks that sums over a part's cells are divided into, counted from the
/// first node of the whole lattice. Of a part that is not there in full, those blocks are that are.
pub(crate) const BLOCK: usize = 8;

/// Nodes beyond those that the other part's cells lie between, which interpolation reads.
const MARGIN: f64 = 2.5;

/// Poses are reached together if that needs at most so many times the nodes that each needs by itself.
const TOGETHER: f64 = 1.5;

/// Boxes of poses, at most: beyond, all are reached together.
const MOST_GROUPS: usize = 16;

impl PairPlan {
    /// The larger part, of which only what is in reach is computed.
    fn larger(fixed: &TriangleMesh, moving: &TriangleMesh) -> Side {
        let size = |part: &TriangleMesh| part.bounds().size().element_product();
        match size(moving) > size(fixed) {
            true => Side::Moving,
            false => Side::Fixed,
        }
    }

    /// Where the smaller part's lattice lies at a pose, in the larger part's frame, metres.
    fn reached(&self, larger: Side, pose: &Pose) -> Aabb {
        let to = match larger {
            Side::Fixed => *pose,
            Side::Moving => pose.inverse(),
        };
        Aabb::around(
            self.lattice(larger.other())
                .node_bounds()
                .corners()
                .map(|c| to.apply(c)),
        )
    }

    fn lattice(&self, side: Side) -> &Lattice {
        match side {
            Side::Fixed => &self.fixed_lattice,
            Side::Moving => &self.moving_lattice,
        }
    }

    /// Poses whose pivot is displaced within a box, metres.
    fn window(&self, displacements: &Aabb) -> PoseWindow {
        PoseWindow {
            pivot: self.pivot,
            displacements: *displacements,
        }
    }

    /// Where the smaller part's lattice gets to at these, in the larger part's frame, metres.
    fn window_reached(&self, larger: Side, displacements: &Aabb) -> Aabb {
        let window = self.window(displacements);
        window.reached(larger, &self.lattice(larger.other()).node_bounds())
    }

    /// Where the middle of the smaller part's lattice lies at a pose, in the larger part's frame, metres.
    pub(crate) fn place(&self, [fixed, moving]: [&TriangleMesh; 2], pose: &Pose) -> DVec3 {
        let larger = Self::larger(fixed, moving);
        let middle = self.lattice(larger.other()).node_bounds().center();
        match larger {
            Side::Fixed => pose.apply(middle),
            Side::Moving => pose.inverse().apply(middle),
        }
    }

    /// How far the smaller part's lattice gets from its middle, metres.
    pub(crate) fn radius(&self, [fixed, moving]: [&TriangleMesh; 2]) -> f64 {
        let smaller = Self::larger(fixed, moving).other();
        0.5 * self.lattice(smaller).node_bounds().diagonal()
    }

    /// Bytes of the smaller part's field.
    pub(crate) fn smaller_bytes(&self, [fixed, moving]: [&TriangleMesh; 2]) -> u64 {
        let smaller = Self::larger(fixed, moving).other();
        DensityField::memory_bytes(self.lattice(smaller))
    }

    /// The pair for poses at which that middle lies in a box, of the larger part only what is reached;
    /// none if nothing is in reach.
    pub(crate) fn in_box(&self, parts: [&TriangleMesh; 2], places: &Aabb) -> Option<Self> {
        let larger = Self::larger(parts[0], parts[1]);
        let reached = places.grown(self.radius(parts));
        let all = self.lattice(larger).node_bounds();
        let near = all.grown(MARGIN * self.spacing()).overlaps(&reached);
        near.then(|| self.within(larger, &reached))
    }

    /// Whether products are summed over a part's cells.
    fn gives_points(&self, side: Side) -> bool {
        match self.model.separation_weight {
            1.0 => self.points == side,
            _ => side == Side::Moving || self.points == side,
        }
    }

    /// Whether the evaluators of parts of the pair have the points of the whole one's, however few are
    /// asked for.
    pub(crate) fn keeps_points(&self, [fixed, moving]: [&TriangleMesh; 2]) -> bool {
        !self.gives_points(Self::larger(fixed, moving))
    }

    /// The plan whose lattice of the larger part ends where poses no longer reach, a box of its frame:
    /// energies there are those of the whole pair.
    fn within(&self, larger: Side, reached: &Aabb) -> Self {
        let mut plan = self.clone();
        let lattice: &mut Lattice = match larger {
            Side::Fixed => &mut plan.fixed_lattice,
            Side::Moving => &mut plan.moving_lattice,
        };
        // Sums over the cells of a part are those of the whole only if they are over whole blocks.
        let reached = reached.grown(MARGIN * self.spacing());
        *lattice = match self.gives_points(larger) {
            true => lattice.clipped_to_blocks(&reached, BLOCK as u32),
            false => lattice.clipped(&reached),
        };
        let kept = [&plan.fixed_lattice, &plan.moving_lattice].map(DensityField::memory_bytes);
        plan.bytes = kept[0].saturating_add(kept[1]);
        plan
    }

    /// The pair for all poses at which the moving part's pivot is displaced within a box, metres, of
    /// the larger part only what these reach: energies and wrenches there are those of the whole pair,
    /// elsewhere they are not. The whole where that needs more than a share of its bytes. The limit is for
    /// the bytes of what is computed.
    ///
    /// # Errors
    /// As [`PairPlan::build`], and if the limit is exceeded.
    pub(crate) fn build_in(
        &self,
        parts: [&TriangleMesh; 2],
        (displacements, most): (Aabb, f64),
        limit: Option<u64>,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let larger = Self::larger(parts[0], parts[1]);
        let plan = self.within(larger, &self.window_reached(larger, &displacements));
        if plan.bytes as f64 > most * self.bytes as f64 {
            self.require_bytes(self.building_bytes(), limit)?;
            return self.build(parts[0], parts[1], cache, monitor);
        }
        plan.require_bytes(plan.building_bytes(), limit)?;
        let pieces = self.pieces(parts, cache, monitor)?;
        pieces.in_window(&displacements, monitor)
    }

    /// The pair, of one part only what lies in a box of its frame, metres, and a little more.
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn build_within(
        &self,
        parts: [&TriangleMesh; 2],
        partial: &Partial,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let pieces = PairPieces::new(self, parts, partial.side, cache, monitor)?;
        pieces.piece(partial, monitor)
    }

    /// What all parts of the pair share.
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn pieces(
        &self,
        parts: [&TriangleMesh; 2],
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<PairPieces, PairBuildError> {
        let larger = Self::larger(parts[0], parts[1]);
        PairPieces::new(self, parts, larger, cache, monitor)
    }

    fn partial(&self, side: Side, reached: Aabb) -> Partial {
        let whole = match side {
            Side::Fixed => self.fixed_lattice,
            Side::Moving => self.moving_lattice,
        };
        Partial {
            side,
            whole,
            reached,
            displacements: None,
        }
    }

    /// Pairs for groups of poses, of the larger part only what these reach: energies and wrenches at
    /// these poses are those of the whole pair, elsewhere they are not. Each with the indices of its
    /// poses.
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn build_at(
        &self,
        [fixed, moving]: [&TriangleMesh; 2],
        poses: &[Pose],
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Pair, Vec<usize>)>, PairBuildError> {
        let groups = self.grouped(Self::larger(fixed, moving), poses);
        let pieces = self.pieces([fixed, moving], cache, monitor)?;
        let build = |(reached, indices): (Aabb, Vec<usize>)| {
            let partial = self.partial(pieces.larger, reached);
            Ok((pieces.piece(&partial, monitor)?, indices))
        };
        groups.into_iter().map(build).collect()
    }

    /// Boxes that hold what poses reach, near ones together, and their poses.
    fn grouped(&self, larger: Side, poses: &[Pose]) -> Vec<(Aabb, Vec<usize>)> {
        let size = |a: &Aabb| a.size().element_product();
        let mut groups: Vec<(Aabb, Vec<usize>)> = Vec::new();
        for (index, pose) in poses.iter().enumerate() {
            let mut group = (self.reached(larger, pose), vec![index]);
            // With every group that is near, until none is.
            while let Some(near) = groups.iter().position(|(other, _)| {
                let both = group.0.union(other);
                size(&both) <= TOGETHER * (size(&group.0) + size(other))
            }) {
                let (other, mut indices) = groups.swap_remove(near);
                indices.append(&mut group.1);
                group = (group.0.union(&other), indices);
            }
            groups.push(group);
            if groups.len() > MOST_GROUPS {
                let reached = poses.iter().map(|pose| self.reached(larger, pose));
                let all = reached.fold(Aabb::EMPTY, |a, b| a.union(&b));
                return vec![(all, (0..poses.len()).collect())];
            }
        }
        groups
    }

    /// Bytes of the fields that poses reach, the smaller part's once.
    pub(crate) fn bytes_at(&self, parts: [&TriangleMesh; 2], poses: &[Pose]) -> u64 {
        let larger = Self::larger(parts[0], parts[1]);
        let lattice = |plan: &Self, side: Side| match side {
            Side::Fixed => DensityField::memory_bytes(&plan.fixed_lattice),
            Side::Moving => DensityField::memory_bytes(&plan.moving_lattice),
        };
        let groups = self.grouped(larger, poses);
        let reached = groups
            .iter()
            .map(|(reached, _)| lattice(&self.within(larger, reached), larger));
        reached.fold(lattice(self, larger.other()), u64::saturating_add)
    }
}

/// What all parts of a pair share, computed once: the density of the smaller part and both surfaces.
pub(crate) struct PairPieces {
    /// Of the whole pair.
    plan: PairPlan,
    meshes: [Arc<TriangleMesh>; 2],
    /// The part of which pieces are computed.
    larger: Side,
    smaller: Arc<DensityField>,
    contact: Option<Contact>,
    cache: Option<FieldCache>,
}

impl PairPieces {
    fn new(
        plan: &PairPlan,
        [fixed, moving]: [&TriangleMesh; 2],
        larger: Side,
        cache: Option<&FieldCache>,
        monitor: &dyn Monitor,
    ) -> Result<Self, PairBuildError> {
        Ok(Self {
            smaller: match larger {
                Side::Fixed => plan.moving_field(moving, cache, monitor)?,
                Side::Moving => plan.fixed_field(fixed, cache, monitor)?,
            },
            contact: plan.contact([fixed, moving])?,
            plan: plan.clone(),
            meshes: [fixed, moving].map(|mesh| Arc::new(mesh.clone())),
            larger,
            cache: cache.cloned(),
        })
    }

    /// Bytes of what is shared.
    pub(crate) fn bytes(&self) -> u64 {
        let contact = self.contact.as_ref().map_or(0, Contact::bytes);
        DensityField::memory_bytes(self.smaller.lattice()).saturating_add(contact)
    }

    /// The pair for poses at which the pivot is displaced within a box, metres.
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn in_window(
        &self,
        displacements: &Aabb,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let reached = self.plan.window_reached(self.larger, displacements);
        let mut partial = self.plan.partial(self.larger, reached);
        partial.displacements = Some(*displacements);
        self.piece(&partial, monitor)
    }

    /// The pair for poses at which the middle of the smaller part lies in a box of the larger one's
    /// frame, metres ([`PairPlan::place`]).
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn in_box(
        &self,
        places: &Aabb,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairBuildError> {
        let [fixed, moving] = &self.meshes;
        let reached = places.grown(self.plan.radius([fixed, moving]));
        let partial = self.plan.partial(self.larger, reached);
        self.piece(&partial, monitor)
    }

    /// The whole pair.
    ///
    /// # Errors
    /// As [`PairPlan::build`].
    pub(crate) fn whole(&self, monitor: &dyn Monitor) -> Result<Pair, PairBuildError> {
        self.joined(&self.plan, monitor)
    }

    /// The pair, of the larger part only what lies in a box of its frame, and a little more.
    fn piece(&self, partial: &Partial, monitor: &dyn Monitor) -> Result<Pair, PairBuildError> {
        let plan = self.plan.within(self.larger, &partial.reached);
        let pair = self.joined(&plan, monitor)?;
        let whole = self.plan.partial(self.larger, partial.reached).whole;
        Ok(pair.of_a_part(Partial { whole, ..*partial }))
    }

    fn joined(&self, plan: &PairPlan, monitor: &dyn Monitor) -> Result<Pair, PairBuildError> {
        let (contact, cache) = (self.contact.clone(), self.cache.as_ref());
        let [fixed, moving] = &self.meshes;
        let smaller = Arc::clone(&self.smaller);
        let fields = match self.larger {
            Side::Fixed => [plan.fixed_field(fixed, cache, monitor)?, smaller],
            Side::Moving => [smaller, plan.moving_field(moving, cache, monitor)?],
        };
        Ok(plan.joined(fields, contact)?.cached_in(self.cache.clone()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use glam::{DQuat, DVec3};
    use rand::rngs::SmallRng;
    use rand::{Rng, SeedableRng};
    use sdf_grid::shapes::{cuboid, prism};
    use sdf_grid::{Silent, TriangleMesh};

    use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
    use crate::geometry::se3::Pose;
    use crate::pair::model::ScoreModel;
    use crate::pair::setup::PairSetup;

    /// A plate and a rod, turned anyhow.
    fn parts() -> [Arc<TriangleMesh>; 2] {
        let plate = cuboid(DVec3::new(0.16, 0.12, 0.012)).unwrap();
        let outline = sdf_grid::shapes::construction::circle(0.006, 24);
        let rod = prism(&outline, &[], 0.02).unwrap();
        let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -0.8, 0.4));
        [plate, rod].map(|m| Arc::new(m.transformed(turn, DVec3::new(0.01, 0.02, -0.3))))
    }

    fn near(rng: &mut SmallRng, setup: &PairSetup, spread: f64) -> Pose {
        let mut cube = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        let (turn, shift) = (DQuat::from_scaled_axis(2.0 * cube()), spread * cube());
        let middle = setup.moving.bounds().center();
        let at = setup.fixed.bounds().center() + shift;
        Pose::new(turn, at - turn * middle)
    }

    /// With all products of densities, with some and with none that lack an interior.
    fn models() -> [ScoreModel; 3] {
        let between = ScoreModel {
            separation_weight: 0.5,
            ..ScoreModel::GUIDED
        };
        [ScoreModel::GUIDED, ScoreModel::PAPER, between]
    }

    /// In all corners of a window and rotations, whichever part stays.
    #[test]
    fn energies_in_a_window_are_those_of_the_whole_pair_to_the_last_bit() {
        let [plate, rod] = parts();
        let mut rng = SmallRng::seed_from_u64(9);
        for (parts, model) in [[&plate, &rod], [&rod, &plate]]
            .into_iter()
            .flat_map(|parts| models().map(|model| (parts, model)))
        {
            let [fixed, moving] = parts.map(Clone::clone);
            let mut setup = PairSetup::new(fixed, moving);
            setup.model = model;
            setup.builder.spacing = Some(1.3e-3);
            setup.builder.halo = Some(0.008);
            setup.half_extent = Some(DVec3::new(0.004, 0.006, 0.003));
            let middle = setup.moving.bounds().center();
            let [fixed_middle, turn] = [setup.fixed.bounds().center(), DVec3::new(0.2, 0.1, 0.9)];
            setup.assembled.rotation = DQuat::from_scaled_axis(turn);
            setup.assembled.translation = fixed_middle - setup.assembled.rotation * middle;
            let whole = setup.load(&Silent).unwrap();
            let partial = setup.load_in_window(&Silent).unwrap();
            let nodes = |p: &crate::Pair| p.fixed().lattice().len() + p.moving().lattice().len();
            assert!(2 * nodes(&partial) < nodes(&whole), "{}", nodes(&partial));
            assert_eq!(partial.provenance(), whole.provenance());
            // In real time few points may be chosen otherwise of a part than of the whole.
            for (options, off) in [(DirectOptions::FULL, 0.0), (DirectOptions::REAL_TIME, 0.03)] {
                let sources =
                    [&whole, &partial].map(|p| DirectEvaluator::new(p, &options).unwrap());
                let scale = whole.model().gamma * whole.mould_score();
                let box_ = setup.displacements(whole.pivot());
                for k in 0..8 {
                    let share = |i: usize| if k >> i & 1 == 1 { 1.0 } else { 0.0 };
                    let share = DVec3::new(share(0), share(1), share(2));
                    let turn =
                        DVec3::from_array(std::array::from_fn(|_| rng.random_range(-2.0..2.0)));
                    let rotation = DQuat::from_scaled_axis(turn);
                    let pose = whole.pose(rotation, box_.min + share * box_.size());
                    let [a, b] = sources.each_ref().map(|s| s.evaluate_full(&pose).response);
                    let energies = (a.energy - b.energy).abs();
                    assert!(energies <= off * scale, "{k}: {energies} of {scale} J");
                    let forces = a.wrench.force.distance(b.wrench.force);
                    assert!(forces <= off * scale / 1e-3, "{k}: {forces} N");
                }
            }
        }
    }

    /// Also where the smaller part is the one that stays, and where it is out of reach.
    #[test]
    fn energies_at_poses_are_those_of_the_whole_pair_to_the_last_bit() {
        let [plate, rod] = parts();
        let mut rng = SmallRng::seed_from_u64(8);
        for parts in [[&plate, &rod], [&rod, &plate]] {
            let [fixed, moving] = parts.map(Clone::clone);
            let mut setup = PairSetup::new(fixed, moving);
            setup.builder.spacing = Some(1e-3);
            let spread = [0.01, 0.01, 0.06, 0.06, 0.06, 0.4];
            let poses = spread.map(|s| near(&mut rng, &setup, s));
            let whole = setup.load(&Silent).unwrap();
            let whole_source = DirectEvaluator::new(&whole, &DirectOptions::FULL).unwrap();
            let expected = poses.map(|p| whole_source.evaluate_full(&p));
            assert!(expected[..2].iter().all(|e| e.response.energy.abs() > 0.0));
            let found = setup.load_at(&poses, &Silent).unwrap();
            let mut all: Vec<usize> = Vec::new();
            for (pair, indices) in &found {
                let nodes = pair.fixed().lattice().len() + pair.moving().lattice().len();
                assert!(nodes < whole.fixed().lattice().len() + whole.moving().lattice().len());
                assert!((pair.mould_score() / whole.mould_score() - 1.0).abs() < 1e-12);
                let source = DirectEvaluator::new(pair, &DirectOptions::FULL).unwrap();
                for i in indices {
                    assert_eq!(source.evaluate_full(&poses[*i]), expected[*i], "{i}");
                    all.push(*i);
                }
            }
            all.sort_unstable();
            assert_eq!(all, (0..poses.len()).collect::<Vec<_>>());
        }
    }

    #[test]
    fn poses_that_are_far_apart_are_reached_apart() {
        let [plate, rod] = parts();
        let setup = PairSetup::new(plate, rod);
        let plan = setup.plan().unwrap();
        let parts = [&*setup.fixed, &*setup.moving];
        let at = |x: f64| Pose::from_translation(DVec3::new(x, 0.0, 0.0));
        let apart = plan.grouped(super::Side::Fixed, &[at(0.0), at(0.2), at(-0.2), at(1e-3)]);
        let groups: Vec<&[usize]> = apart.iter().map(|g| g.1.as_slice()).collect();
        assert_eq!(groups.len(), 3, "{groups:?}");
        let one = plan.bytes_at(parts, &[at(0.0)]);
        assert!(2 * one < plan.bytes, "{one} of {} bytes", plan.bytes);
        // So many that they are reached together: the whole part at most.
        let many: Vec<Pose> = (-30..30).map(|k| at(0.05 * f64::from(k))).collect();
        let all = plan.bytes_at(parts, &many);
        assert!((one + 1..=plan.bytes).contains(&all), "{all} bytes");
        assert!(plan.bytes_at(parts, &[]) < one);
    }
}
