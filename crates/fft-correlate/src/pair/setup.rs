//! Two parts and all that decides their pair: where docking, tables and the haptic loop begin.
//! The energy scale gamma and the lattice spacing are chosen here.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;
use sdf_grid::{Aabb, DensityError, FieldCache, KernelError, Monitor, TriangleMesh};

use crate::geometry::placement::Placement;
use crate::geometry::se3::Pose;
use crate::pair::builder::{PairBuildError, PairBuilder, PairPlan, coarsening, contact_bytes};
use crate::pair::contact::jump;
use crate::pair::fields::Pair;
use crate::pair::model::ScoreModel;

/// Two parts, each in its own frame, and the options of their pair. All but the placement refers to
/// the shapes ([`Placement::to_shapes`]), wherever a scene puts them.
///
/// ```
/// use std::sync::Arc;
///
/// use fft_correlate::{EnergyScale, PairBuilder, PairSetup};
/// use sdf_grid::{Silent, shapes::PegInHole};
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let setup = PairSetup {
///     builder: PairBuilder { spacing: Some(0.004), ..PairBuilder::default() },
///     energy: EnergyScale::PeakForce(5.0),
///     ..PairSetup::new(Arc::new(hole), Arc::new(peg))
/// };
/// // Half the peg's 30 mm either way.
/// assert!((setup.reach().x - 0.015).abs() < 1e-12);
/// let pair = setup.load(&Silent)?;
/// assert_eq!(pair.model().gamma, setup.gamma()?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct PairSetup {
    /// The part that stays.
    pub fixed: Arc<TriangleMesh>,
    /// The part that moves.
    pub moving: Arc<TriangleMesh>,
    /// Weights and kernel thickness; [`PairSetup::energy`] replaces gamma.
    pub model: ScoreModel,
    /// How finely the densities are computed, and within which memory.
    pub builder: PairBuilder,
    /// What fixes gamma.
    pub energy: EnergyScale,
    /// Pose of the moving part in which the parts fit.
    pub assembled: Pose,
    /// Middle of the displacements of interest from the assembled pose, metres, along the fixed
    /// part's own axes.
    pub center: DVec3,
    /// Half the sides of their box along these axes, metres; chosen from the moving part if absent
    /// ([`PairSetup::reach`]).
    pub half_extent: Option<DVec3>,
    /// Where a scene puts the parts; decides nothing about the pair.
    pub placement: Placement,
    /// Where fields are kept between runs.
    pub cache: Option<FieldCache>,
}

/// Why a setup gives no pair.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PairSetupError {
    /// The fields cannot be computed.
    #[error(transparent)]
    Build(PairBuildError),
    /// The energy scale is out of range.
    #[error(transparent)]
    Energy(#[from] EnergyScaleError),
    /// The monitor asked to stop.
    #[error("cancelled")]
    Cancelled,
}

impl From<PairBuildError> for PairSetupError {
    fn from(error: PairBuildError) -> Self {
        match error {
            PairBuildError::Density {
                source: DensityError::Cancelled,
                ..
            } => Self::Cancelled,
            other => Self::Build(other),
        }
    }
}

impl PairSetup {
    /// Two parts that fit where they are: the guided model as it is, lattices chosen from the parts,
    /// no memory limit, no cache.
    pub fn new(fixed: Arc<TriangleMesh>, moving: Arc<TriangleMesh>) -> Self {
        Self {
            fixed,
            moving,
            model: ScoreModel::GUIDED,
            builder: PairBuilder::default(),
            energy: EnergyScale::Gamma(ScoreModel::GUIDED.gamma),
            assembled: Pose::IDENTITY,
            center: DVec3::ZERO,
            half_extent: None,
            placement: Placement::IDENTITY,
            cache: None,
        }
    }

    /// Half the sides of the box of displacements, metres: half the longest side of the moving part
    /// either way unless given.
    pub fn reach(&self) -> DVec3 {
        let longest = || self.moving.bounds().size().max_element();
        self.half_extent
            .unwrap_or_else(|| DVec3::splat(0.5 * longest()))
    }

    /// The energy scale of the pair, joules per cubic metre; nothing else is computed.
    ///
    /// # Errors
    /// As [`EnergyScale::gamma`].
    pub fn gamma(&self) -> Result<f64, EnergyScaleError> {
        self.energy.gamma(&self.model, &self.fixed, &self.moving)
    }

    /// Lattices, halo, pivot and memory of the pair; nothing of their size is allocated.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`].
    pub fn plan(&self) -> Result<PairPlan, PairBuildError> {
        self.builder.plan(&self.fixed, &self.moving, &self.model)
    }

    /// The setup of a loop: on a lattice on which the pair's evaluator has about as many points as it
    /// may at most ([`DirectOptions::max_points`](crate::DirectOptions::max_points)), where its own
    /// gives more: 60 to 100 % of them, 40 where a long part lies askew. The evaluator would leave a finer lattice by itself
    /// ([`DirectEvaluator::new`](crate::DirectEvaluator::new)), after its fields were computed; here
    /// nothing is. With separation, and without smoothing, the setup as it is.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`], but for memory.
    pub fn with_points(&self, max_points: usize) -> Result<Self, PairBuildError> {
        let (parts, most) = ([&*self.fixed, &*self.moving], max_points as f64);
        let mut setup = self.clone();
        loop {
            let plan = setup.plan_unlimited()?;
            let excess = plan
                .estimated_points(parts)
                .map_or(0.0, |points| points / most);
            if excess <= 1.0 {
                return Ok(setup);
            }
            setup.builder.spacing = Some(coarsening(excess) * plan.spacing());
        }
    }

    /// The pair with its energy scale; fields come from the cache or are computed.
    ///
    /// # Errors
    /// As [`PairPlan::build`] and [`EnergyScale::gamma`].
    pub fn load(&self, monitor: &dyn Monitor) -> Result<Pair, PairSetupError> {
        let cache = self.cache.as_ref();
        let pair = self
            .plan()?
            .build(&self.fixed, &self.moving, cache, monitor)?;
        Ok(pair
            .with_gamma(self.gamma()?)
            .map_err(PairBuildError::from)?)
    }

    /// The displacements of the pivot of interest, metres ([`PairSetup::reach`]), for a pair with this
    /// pivot.
    pub fn displacements(&self, pivot: DVec3) -> Aabb {
        let middle = self.center + self.assembled.apply(pivot) - pivot;
        let reach = self.reach();
        Aabb::around([middle - reach, middle + reach])
    }

    /// The pair for poses in the setup's box of displacements; where that is most of it, the whole
    /// ([`PairSetup::load_partly`]).
    ///
    /// # Errors
    /// As it.
    pub fn load_in_window(&self, monitor: &dyn Monitor) -> Result<Pair, PairSetupError> {
        let pivot = self.plan_unlimited()?.pivot;
        self.load_in(&self.displacements(pivot), monitor)
    }

    /// The same for another box of displacements of the pivot, metres.
    ///
    /// # Errors
    /// As [`PairSetup::load_partly`].
    pub fn load_in(
        &self,
        displacements: &Aabb,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairSetupError> {
        self.load_partly(displacements, MOST_OF_IT, monitor)
    }

    /// The pair for poses whose displacement of the pivot lies in a box, metres, in all rotations: of
    /// the larger part the density is computed only where the smaller one gets. Energies and wrenches
    /// at these poses are those of the whole pair ([`PairSetup::load`]); at others they are not. The
    /// whole pair where that needs more than the share `most` of its bytes.
    ///
    /// # Errors
    /// As [`PairSetup::load`]; the memory limit is for what is computed.
    pub fn load_partly(
        &self,
        displacements: &Aabb,
        most: f64,
        monitor: &dyn Monitor,
    ) -> Result<Pair, PairSetupError> {
        let plan = self.plan_unlimited()?;
        let pair = plan.build_in(
            [&self.fixed, &self.moving],
            // Nodes of a window lie up to a spacing beyond its box.
            (displacements.grown(2.0 * plan.spacing()), most),
            self.builder.memory_limit,
            self.cache.as_ref(),
            monitor,
        )?;
        let pair = pair.with_gamma(self.gamma()?);
        Ok(pair.map_err(PairBuildError::from)?)
    }

    /// [`PairSetup::plan`] whatever memory it needs: of a pair of which only a part is to be computed.
    ///
    /// # Errors
    /// As [`PairBuilder::plan`], but for memory.
    pub fn plan_unlimited(&self) -> Result<PairPlan, PairBuildError> {
        let unlimited = PairBuilder {
            memory_limit: None,
            ..self.builder
        };
        let mut plan = unlimited.plan(&self.fixed, &self.moving, &self.model)?;
        plan.contact_bytes = contact_bytes(self.builder.memory_limit);
        Ok(plan)
    }

    /// The pair as far as some poses of the moving part reach: of the larger part the density is
    /// computed only where the smaller one gets. Energies and wrenches at these poses are those of the
    /// whole pair ([`PairSetup::load`]); at others they are not. Poses that lie far apart get pairs of
    /// their own; each comes with the indices of its poses.
    ///
    /// # Errors
    /// As [`PairSetup::load`]; the memory limit is for what is computed.
    pub fn load_at(
        &self,
        poses: &[Pose],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Pair, Vec<usize>)>, PairSetupError> {
        let parts = [&*self.fixed, &*self.moving];
        let plan = self.plan_unlimited()?;
        plan.require_bytes(plan.bytes_at(parts, poses), self.builder.memory_limit)?;
        let gamma = self.gamma()?;
        let scaled = |(pair, indices): (Pair, Vec<usize>)| {
            let pair = pair.with_gamma(gamma).map_err(PairBuildError::from)?;
            Ok((pair, indices))
        };
        let pairs = plan.build_at(parts, poses, self.cache.as_ref(), monitor)?;
        pairs.into_iter().map(scaled).collect()
    }
}

/// From this share of a pair on, all of it is computed for a table.
const MOST_OF_IT: f64 = 0.8;

/// The number that fixes the energy scale gamma of a pair. Gamma follows from it, the shapes and
/// the model; it never depends on where the parts lie.
///
/// ```
/// use fft_correlate::{EnergyScale, ScoreModel};
/// use sdf_grid::shapes::PegInHole;
///
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let of = |scale: EnergyScale| scale.gamma(&ScoreModel::GUIDED, &hole, &peg);
/// assert_eq!(of(EnergyScale::Gamma(2e4))?, 2e4);
/// // Twice the force needs twice the energy per score.
/// let [once, twice] = [EnergyScale::PeakForce(5.0), EnergyScale::PeakForce(10.0)].map(of);
/// assert!((twice? / once? - 2.0).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EnergyScale {
    /// Joules per cubic metre.
    Gamma(f64),
    /// The force, newtons, with which contact presses the smaller part in a perfect mould of itself,
    /// along the direction in which that is greatest (`docs/conventions.md`, energy scale).
    PeakForce(f64),
}

/// Why a pair has no such energy scale.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EnergyScaleError {
    /// The force asked for is out of range.
    #[error("peak force must be positive and finite, found {found} N")]
    PeakForce {
        /// What was given, newtons.
        found: f64,
    },
    /// Sigma is out of range.
    #[error(transparent)]
    Kernel(#[from] KernelError),
}

impl EnergyScale {
    /// Gamma of two parts, joules per cubic metre: of a peak force `P` it is
    /// `P / (c min(A_f, A_m))`, with `c` the slope of the contact energy per area
    /// (`docs/conventions.md`, contact slope) and `A` the pressing area of each part.
    ///
    /// # Errors
    /// If the peak force is not positive and finite, or the model's sigma is out of range.
    pub fn gamma(
        &self,
        model: &ScoreModel,
        fixed: &TriangleMesh,
        moving: &TriangleMesh,
    ) -> Result<f64, EnergyScaleError> {
        match *self {
            Self::Gamma(gamma) => Ok(gamma),
            Self::PeakForce(found) if !(found.is_finite() && found > 0.0) => {
                Err(EnergyScaleError::PeakForce { found })
            }
            Self::PeakForce(newtons) => {
                let area = pressing_area(fixed).min(pressing_area(moving));
                Ok(newtons / (-jump(model)? * area))
            }
        }
    }
}

/// Directions from which the greatest area is looked for.
const DIRECTIONS: usize = 256;
/// How many of the best are followed to their maximum.
const FOLLOWED: usize = 16;

/// `½ ∮ |n·t| dA` along the direction `t` in which it is greatest, square metres: the largest shadow
/// of a convex part; of any other, all faces that push back when it is moved along `t`.
///
/// The sum is convex in `t`, and between changes of the signs of `n·t` linear: each step
/// `t <- Σ sign(n·t) n dA`, normalized, raises it until no sign changes.
fn pressing_area(part: &TriangleMesh) -> f64 {
    let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a);
    let areas: Vec<DVec3> = part.faces().map(area).collect();
    let sum = |t: DVec3| -> DVec3 { areas.iter().map(|a| a.dot(t).signum() * *a).sum() };
    // Directions spread evenly over half the sphere.
    let mut starts: Vec<(f64, DVec3)> = (0..DIRECTIONS)
        .into_par_iter()
        .map(|i| {
            let z = (i as f64 + 0.5) / DIRECTIONS as f64;
            let (sin, cos) = (i as f64 * GOLDEN_ANGLE).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let t = DVec3::new(r * cos, r * sin, z);
            (sum(t).dot(t), t)
        })
        .collect();
    starts.sort_by(|a, b| b.0.total_cmp(&a.0));
    starts.truncate(FOLLOWED);
    let followed = starts.into_par_iter().map(|(mut greatest, mut t)| {
        loop {
            let total = sum(t);
            if total.length() <= greatest * (1.0 + 1e-12) {
                return greatest;
            }
            (greatest, t) = (total.length(), total.normalize());
        }
    });
    0.5 * followed.reduce(|| 0.0, f64::max)
}

/// The turn from one direction to the next that spreads them evenly, radians.
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// The distance between the nodes of both parts' lattices.
///
/// ```
/// use fft_correlate::LatticeStep;
/// use sdf_grid::shapes::PegInHole;
///
/// // 40 steps along the 40 mm of the block.
/// let (hole, peg) = PegInHole::Rectangular.pair(0.0)?;
/// let spacing = LatticeStep::Points(40).spacing(&hole, &peg);
/// assert!((spacing.expect("stated") - 0.001).abs() < 1e-12);
/// assert_eq!(LatticeStep::Automatic.spacing(&hole, &peg), None);
/// # Ok::<(), sdf_grid::MeshError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LatticeStep {
    /// Metres.
    Spacing(f64),
    /// Nodes along the longest side of the larger part.
    Points(u32),
    /// Chosen from the parts.
    #[default]
    Automatic,
}

impl LatticeStep {
    /// Metres; `None` where it is to be chosen.
    pub fn spacing(&self, fixed: &TriangleMesh, moving: &TriangleMesh) -> Option<f64> {
        match *self {
            Self::Spacing(spacing) => Some(spacing),
            Self::Points(points) => {
                let longest = |m: &TriangleMesh| m.bounds().size().max_element();
                Some(longest(fixed).max(longest(moving)) / f64::from(points))
            }
            Self::Automatic => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basin::peak_force;
    use crate::direct::evaluator::{DirectEvaluator, DirectOptions};
    use crate::geometry::se3::Pose;
    use crate::pair::setup::PairSetup;
    use glam::DQuat;
    use glam::DVec3;
    use sdf_grid::{Silent, shapes, shapes::PegInHole};
    use std::sync::Arc;

    fn anywhere(part: &TriangleMesh, k: f64) -> TriangleMesh {
        let turn = DQuat::from_scaled_axis(DVec3::new(0.4 * k, -1.1, 0.7 + k));
        part.transformed(turn, DVec3::new(3.0, -2.0 * k, 0.5))
    }

    #[test]
    fn the_pressing_area_of_a_convex_part_is_its_largest_shadow_in_any_frame() {
        let (a, b, c) = (0.02, 0.03, 0.007);
        let cuboid = shapes::cuboid(DVec3::new(a, b, c)).unwrap();
        let sphere = shapes::icosphere(0.01, 20).unwrap();
        let shadow = (a * b).hypot(b * c).hypot(c * a);
        for k in 0..6 {
            let found = pressing_area(&anywhere(&cuboid, f64::from(k)));
            assert!((found / shadow - 1.0).abs() < 1e-12, "{found} {shadow}");
            let found = pressing_area(&anywhere(&sphere, f64::from(k)));
            let disc = std::f64::consts::PI * 1e-4;
            assert!((found / disc - 1.0).abs() < 5e-3, "{found} {disc}");
        }
    }

    /// Wherever parts lie and whichever of them stays, and however small they are: force is as force
    /// was, since gamma goes with one over the area.
    #[test]
    fn the_scale_belongs_to_the_shapes_and_not_to_where_they_lie() {
        let model = ScoreModel::GUIDED;
        let scale = EnergyScale::PeakForce(5.0);
        for kind in [
            PegInHole::Rectangular,
            PegInHole::Circular,
            PegInHole::Combined,
        ] {
            let (hole, peg) = kind.pair(2e-4).unwrap();
            let own = scale.gamma(&model, &hole, &peg).unwrap();
            let (hole, peg) = (anywhere(&hole, 2.0), anywhere(&peg, 3.0));
            for pair in [[&hole, &peg], [&peg, &hole]] {
                let gamma = scale.gamma(&model, pair[0], pair[1]).unwrap();
                assert!((gamma / own - 1.0).abs() < 1e-6, "{own} {gamma}");
            }
        }
        let (hole, peg) = PegInHole::Circular.pair(0.0).unwrap();
        for force in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            let refused = EnergyScale::PeakForce(force).gamma(&model, &hole, &peg);
            assert!(matches!(refused, Err(EnergyScaleError::PeakForce { .. })));
        }
        let given = EnergyScale::Gamma(7.0).gamma(&model, &hole, &peg);
        assert_eq!(given, Ok(7.0));
    }

    /// What docs/scene.md says of `peak_force`: in walls of the paper's pairs forces are between the
    /// half and the double of it.
    #[test]
    fn forces_in_walls_are_about_the_peak_force() {
        for kind in [
            PegInHole::Rectangular,
            PegInHole::Circular,
            PegInHole::Combined,
        ] {
            let [hole, peg] = <[_; 2]>::from(kind.pair(0.0).unwrap()).map(Arc::new);
            let mut setup = PairSetup {
                energy: EnergyScale::PeakForce(3.0),
                ..PairSetup::new(hole, peg)
            };
            setup.builder.spacing = Some(2e-3);
            let pair = setup.load(&Silent).unwrap();
            let source = DirectEvaluator::new(&pair, &DirectOptions::REAL_TIME).unwrap();
            let (peak, _) = peak_force(&source, &Pose::IDENTITY, setup.reach());
            assert!((1.5..6.0).contains(&peak), "{kind:?}: {peak}");
        }
    }

    /// Whichever part stays and gives the points; and a lattice that has few enough is left alone.
    #[test]
    fn a_loops_lattice_gives_about_as_many_points_as_it_may() {
        let plate = shapes::cuboid(DVec3::new(0.1, 0.08, 0.006)).unwrap();
        let pin = shapes::cuboid(DVec3::new(0.006, 0.007, 0.02)).unwrap();
        let pairs = [
            <[_; 2]>::from(PegInHole::Combined.pair(0.0).unwrap()),
            [plate, pin],
        ];
        for [a, b] in pairs.map(|pair| pair.map(Arc::new)) {
            for [fixed, moving] in [[&a, &b], [&b, &a]] {
                let setup = PairSetup::new(Arc::clone(fixed), Arc::clone(moving));
                for most in [7000, 14_000] {
                    let few = setup.with_points(most).unwrap();
                    let pair = few.load(&Silent).unwrap();
                    let source = DirectEvaluator::new(&pair, &DirectOptions::FULL).unwrap();
                    let share = source.describe().points() as f64 / most as f64;
                    assert!((0.6..1.05).contains(&share), "{share} of {most} points");
                    let many = few.with_points(most + most / 5).unwrap();
                    assert_eq!(many.builder.spacing, few.builder.spacing);
                }
            }
        }
    }

    #[test]
    fn points_are_counted_along_the_longest_side_of_the_larger_part() {
        let small = shapes::cuboid(DVec3::new(0.01, 0.02, 0.03)).unwrap();
        let large = shapes::cuboid(DVec3::new(0.04, 0.08, 0.02)).unwrap();
        for (fixed, moving) in [(&small, &large), (&large, &small)] {
            let spacing = LatticeStep::Points(40).spacing(fixed, moving).unwrap();
            assert!((spacing - 0.002).abs() < 1e-12, "{spacing}");
        }
        assert_eq!(LatticeStep::Automatic.spacing(&small, &large), None);
        assert_eq!(LatticeStep::Spacing(0.5).spacing(&small, &large), Some(0.5));
    }
}
